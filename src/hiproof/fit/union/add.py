"""Add volumes one by one, and improve all after each. Compiled."""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ...compiled import compiled
from ..prices import (
    FREELY_UNITS,
    NEW_MOVED_UNITS,
    NEW_UNITS,
    ROOF_UNITS,
)
from .around import measure_context
from .candidates import SAME_SLOPE, find_best_rectangles
from .edges import NO_GAIN, move_edges
from .improve import improve
from .objective import compute_costs, compute_objective_with
from .refit import refit
from .volumes import (
    DIRECTION,
    LEAN0,
    N_SIDES,
    REPLACES,
    U0,
    U1,
    V0,
    V1,
    compute_roof_heights,
)

MOST_VOLUMES = 24  # Most volumes that are searched or changed all at once: a limit on time.
TRIED_EACH_WAY = 2  # Number of candidates, those of the largest gain, that are fitted.
UNEXPLAINED = 0.98  # Share of the highest misfit from which on a point counts as unexplained.
FEWEST_UNEXPLAINED = 4  # Fewest unexplained points that are worth a further volume.
# Share of the highest misfit from which on points count in a roof that leaves none unexplained but
# costs much: the base half way up a skirt lies within a quarter of a metre of all of it.
POORLY = 0.3
CUT_LEAST_M = 0.3  # Least length (m) by which a neighbour is cut back for a new volume.
CUT_MOST_SHARE = 0.6  # Largest share of a neighbour that is cut back for a new volume.

# How adding ends: no candidate helps, or nothing is left to explain (or the most additions were
# tried).
NONE_HELPS, NOTHING_LEFT = range(2)

# The data of growth: the scene, the cells (directions, n + g) between its lines along u and along v
# in which points and unobserved cells lie, and the slopes (m,) to try for a further plane.
GrowthGrid = namedtuple("GrowthGrid", "scene cell_u cell_v slopes")


@compiled
def add_candidates(volumes, value, ground, candidates, additions):
    """Add at most `additions` volumes, as long as a candidate helps.

    Returns the volumes, their objective, how it ended, and how many may still be added.
    """
    scene = ground.scene
    while additions > 0:
        additions -= 1
        if (
            len(find_unexplained(volumes, scene)) < FEWEST_UNEXPLAINED
            or len(volumes) >= MOST_VOLUMES
        ):
            return volumes, value, NOTHING_LEFT, 0
        trial, trial_value = find_best_addition(volumes, value, ground, candidates)
        if trial_value == np.inf:
            return volumes, value, NONE_HELPS, additions
        volumes, value = improve(trial, scene, trial_value, ground.slopes, 1)
    return volumes, value, NOTHING_LEFT, 0


@compiled
def find_unexplained(volumes, scene):
    """Return the points (m,) that the roof leaves unexplained.

    If there are hardly any but the roof is expensive, these are the points that it explains poorly.
    """
    z, _ = compute_roof_heights(volumes, scene.U, scene.V)
    cost = compute_costs(z, scene)[: scene.n]
    unexplained_points = np.nonzero(cost > UNEXPLAINED)[0]
    if len(unexplained_points) < FEWEST_UNEXPLAINED and cost.sum() > ROOF_UNITS * scene.unit:
        return np.nonzero(cost > POORLY)[0]
    return unexplained_points


@compiled
def find_best_addition(volumes, value, ground, candidates):
    """Add the volume that lowers the objective most.

    Returns the volumes and their objective, which is infinite if no candidate helps.
    """
    best, lowest, scene = volumes, np.inf, ground.scene
    if len(candidates) == 0:
        return best, lowest
    context = measure_context(volumes, scene.U, scene.V, len(volumes))
    z_now = context.roof_without
    cost_now = compute_costs(z_now, scene)
    for replacing in (False, True):
        gains, cells = find_best_rectangles(
            scene, candidates, ground.cell_u, ground.cell_v, cost_now, z_now, replacing
        )
        for _ in range(TRIED_EACH_WAY):
            m = np.argmax(gains)
            if not gains[m] > 0.0:
                break
            extended = np.concatenate((volumes, candidates[m : m + 1]))
            lines, new = scene.lines[int(candidates[m, DIRECTION])], extended[-1]
            new[U0], new[U1] = lines[0, cells[m, 0]], lines[0, cells[m, 1]]
            new[V0], new[V1] = lines[1, cells[m, 2]], lines[1, cells[m, 3]]
            surcharge = FREELY_UNITS * scene.unit if has_free_plane(new, scene) else 0.0
            if replacing and len(volumes) > 1:
                new[REPLACES] = 1.0
            trial, trial_value = settle_new(
                extended.copy(), scene, min(value, lowest) - surcharge, context
            )
            if trial_value < np.inf:
                best, lowest = trial, trial_value
            if replacing:
                new[REPLACES] = 0.0
                best, lowest = cut_back_neighbours(
                    volumes, extended, scene, best, lowest, value, surcharge
                )
            gains[m] = -np.inf
    return best, lowest


@compiled
def has_free_plane(volume, scene):
    """Return whether a plane of the volume faces neither along an axis nor a wall."""
    for plane in range(N_SIDES):
        lean = abs(volume[LEAN0 + plane])
        if lean > 0.0:
            walls = scene.leans[int(volume[DIRECTION]), plane // 2]
            if np.abs(np.abs(walls) - lean).min() > SAME_SLOPE:
                return True
    return False


@compiled
def cut_back_neighbours(volumes, extended, scene, best, lowest, value, surcharge):
    """Cut back each volume that the last of the `extended` ones overlaps, in turn.

    It is cut to where the last one begins. Returns the best roof of these and of `best`, which
    costs `lowest`.
    """
    last = len(extended) - 1
    for j in range(1, last):
        if extended[j, DIRECTION] != extended[last, DIRECTION]:
            continue
        if not has_overlap(extended[j], extended[last]):
            continue
        for edge in range(4):
            start, end = extended[j, U0 + (edge & 2)], extended[j, U1 + (edge & 2)]
            stop = extended[last, U0 + (edge ^ 1)]
            overhang = stop - start if edge % 2 == 0 else end - stop
            if CUT_LEAST_M < overhang < CUT_MOST_SHARE * (end - start):
                cut = extended.copy()
                cut[j, U0 + edge] = stop
                context = measure_context(cut, scene.U, scene.V, last)
                trial, trial_value = settle_new(cut, scene, min(value, lowest) - surcharge, context)
                if trial_value < np.inf:
                    best, lowest = trial, trial_value
    return best, lowest


@compiled
def has_overlap(row, other):
    """Return whether two rectangles have more than a strip in common."""
    u = min(row[U1], other[U1]) - max(row[U0], other[U0])
    return min(u, min(row[V1], other[V1]) - max(row[V0], other[V0])) > CUT_LEAST_M


@compiled
def settle_new(volumes, scene, value, context):
    """Fit the last volume, which is new, and move its edges, twice.

    Returns the volumes and their objective, which is infinite if it is not below `value`. A volume
    that begins too far above `value` is given up.
    """
    k, trial_value = len(volumes) - 1, np.inf
    for units in NEW_UNITS, NEW_MOVED_UNITS:
        refit(volumes, scene, k, context)
        trial_value = compute_objective_with(volumes, scene, k, context)
        if trial_value > value + units * scene.unit:
            return volumes, np.inf
        trial_value = move_edges(volumes, scene, k, trial_value, context)
    return volumes, trial_value if trial_value < value - NO_GAIN else np.inf
