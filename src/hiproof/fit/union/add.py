"""Volumes added one by one, each where it gains most, all of them improved after each. Compiled."""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ...compiled import compiled
from .around import look_around
from .candidates import best_rectangles
from .edges import EVERYWHERE, LEAST_GAIN, MIN_SIDE_M, move_edges
from .improve import improve
from .objective import costs, objective_with
from .prices import (
    FREELY_UNITS,
    NEW_MOVED_UNITS,
    NEW_UNITS,
    REGROWN_UNITS,
    ROOF_UNITS,
    SAME_BEFORE_UNITS,
    SAME_UNITS,
)
from .refit import refit
from .volumes import DIRECTION, LEAN, REPLACES, SIDES, U0, U1, V0, V1, is_fixed, roof_heights

MOST_VOLUMES = 24  # of one building: a bound on time
TRIED_EACH_WAY = 2  # candidates of the largest gain that are tried in earnest
# of the highest misfit, from which on a point counts as unexplained; points worth a further volume
UNEXPLAINED, FEWEST_UNEXPLAINED = 0.98, 4
# of the highest misfit, from which on points count in a roof that leaves none unexplained but costs
# much: the base half way up a skirt lies within a quarter of a metre of it all
POORLY = 0.3
ALONG_WALL = 1e-6  # of a lean; numerically the same
CUT_LEAST_M, CUT_MOST_SHARE = 0.3, 0.6  # how much a neighbour may be cut back for a new volume

# How adding ends: no candidate helps; nothing is left to explain, or as much as may be was tried; a known roof has come back.
NONE_HELPS, ENOUGH, COME_BACK = 0, 1, 2

# What volumes grow on: the scene, in which cells (directions, n + g) of its lines along u and v the points and ghosts lie, and the slopes
# (m,) to try for a further plane.
Ground = namedtuple("Ground", "scene cell_u cell_v slopes")


@compiled
def add_volumes(volumes, value, ground, candidates, additions, known_count, known_value):
    """The volumes with more of them added one by one as long as a candidate helps, at most `additions`: they, their objective, how
    it ended, and how many may still be added.

    It ends, too, when there are as many as in a known roof (`known_count`, 0 where there is none) for as much: nothing can be added to
    that one, and it has come back.
    """
    scene = ground.scene
    while additions > 0:
        additions -= 1
        if len(unexplained(volumes, scene)) < FEWEST_UNEXPLAINED or len(volumes) >= MOST_VOLUMES:
            return volumes, value, ENOUGH, 0
        trial, found = best_addition(volumes, value, ground, candidates)
        if found == np.inf:
            return volumes, value, NONE_HELPS, additions
        if len(trial) == known_count and is_the_same(found, known_value, scene, SAME_BEFORE_UNITS):
            return trial, found, COME_BACK, additions
        volumes, value = improve(trial, scene, found, ground.slopes, 1)
        if len(volumes) == known_count and is_the_same(value, known_value, scene, SAME_UNITS):
            return volumes, value, COME_BACK, additions
    return volumes, value, ENOUGH, 0


@compiled
def is_the_same(value, known, scene, more_units):
    """Whether a roof costs as much as a known one, but for the `more_units` that fitting may still gain."""
    return -min(more_units, REGROWN_UNITS) < (value - known) / scene.evidence < more_units


@compiled
def unexplained(volumes, scene):
    """Points (m,) that the roof leaves unexplained; where there are none, those that it explains poorly if that is dear."""
    z, _ = roof_heights(volumes, scene.U, scene.V)
    cost = costs(z, scene)[: scene.n]
    far = np.nonzero(cost > UNEXPLAINED)[0]
    if len(far) < FEWEST_UNEXPLAINED and cost.sum() > ROOF_UNITS * scene.evidence:
        return np.nonzero(cost > POORLY)[0]
    return far


@compiled
def best_addition(volumes, value, ground, candidates):
    """The volumes with the one more that lowers the objective most, and that objective; infinite where none does."""
    best, lowest, scene = volumes, np.inf, ground.scene
    if len(candidates) == 0:
        return best, lowest
    around = look_around(volumes, scene.U, scene.V, len(volumes))
    z_now = around.without
    cost_now = costs(z_now, scene)
    for replacing in (False, True):
        gains, cells = best_rectangles(scene, candidates, ground.cell_u, ground.cell_v, cost_now, z_now, replacing)
        for m in np.argsort(-gains, kind="mergesort")[:TRIED_EACH_WAY]:
            if not gains[m] > 0.0:
                break
            joined = np.concatenate((volumes, candidates[m : m + 1]))
            lines, new = scene.lines[int(candidates[m, DIRECTION])], joined[-1]
            new[U0], new[U1] = lines[0, cells[m, 0]], lines[0, cells[m, 1]]
            new[V0], new[V1] = lines[1, cells[m, 2]], lines[1, cells[m, 3]]
            least = FREELY_UNITS * scene.evidence if leans_freely(new, scene) else 0.0
            if replacing and len(volumes) > 1:
                new[REPLACES] = 1.0
            trial, found = settle_new(joined.copy(), scene, min(value, lowest) - least, around)
            if found < np.inf:
                best, lowest = trial, found
            if replacing:
                new[REPLACES] = 0.0
                best, lowest = with_neighbour_cut(volumes, joined, scene, best, lowest, value, least)
    return best, lowest


@compiled
def leans_freely(volume, scene):
    """Whether a plane of the volume faces neither along an axis nor a wall."""
    for plane in range(SIDES):
        lean = abs(volume[LEAN + plane])
        if lean > 0.0:
            walls = scene.leans[int(volume[DIRECTION]), plane // 2]
            if np.abs(np.abs(walls) - lean).min() > ALONG_WALL:
                return True
    return False


@compiled
def with_neighbour_cut(volumes, joined, scene, best, lowest, value, least):
    """The best of `best`, `lowest` in cost, and the ways of having the last of the volumes `joined` by cutting one that it overlaps back to
    where it begins."""
    last = len(joined) - 1
    for j in range(1, last):
        if is_fixed(joined, j) or joined[j, DIRECTION] != joined[last, DIRECTION]:
            continue
        if not overlap(joined[j], joined[last]):
            continue
        for edge in range(4):
            low, high = joined[j, U0 + (edge & 2)], joined[j, U1 + (edge & 2)]
            stop = joined[last, U0 + (edge ^ 1)]
            over = stop - low if edge % 2 == 0 else high - stop
            if CUT_LEAST_M < over < CUT_MOST_SHARE * (high - low) and high - low - over >= MIN_SIDE_M:
                cut = joined.copy()
                cut[j, U0 + edge] = stop
                around = look_around(cut, scene.U, scene.V, last)
                trial, found = settle_new(cut, scene, min(value, lowest) - least, around)
                if found < np.inf:
                    best, lowest = trial, found
    return best, lowest


@compiled
def overlap(one, other):
    """Whether two rectangles have more than a strip in common."""
    u = min(one[U1], other[U1]) - max(one[U0], other[U0])
    return min(u, min(one[V1], other[V1]) - max(one[V0], other[V0])) > CUT_LEAST_M


@compiled
def settle_new(volumes, scene, value, around):
    """Volumes whose last one is new, that one fitted and its edges moved twice; infinite where that is not below `value`.

    One that begins too far above `value` to come below it is given up.
    """
    k, found = len(volumes) - 1, np.inf
    for units in NEW_UNITS, NEW_MOVED_UNITS:
        refit(volumes, scene, k, around)
        found = objective_with(volumes, scene, k, around, value + units * scene.evidence)
        if found == np.inf:
            break
        found = move_edges(volumes, scene, k, found, EVERYWHERE, around)
    return volumes, found if found < value - LEAST_GAIN else np.inf
