"""All moves in turn as long as they lower the objective, and the simplification under a more tolerant one. Compiled."""

from __future__ import annotations

import math

import numpy as np

from ...compiled import compiled
from .around import look_around
from .edges import EVERYWHERE, LEAST_GAIN, move_edges
from .facings import face_walls
from .joins import join_neighbours, merge_volumes
from .moves import (
    add_planes,
    change_ties,
    drop_planes,
    drop_volumes,
    flatten,
    move_all_edges,
    refit_each,
    refitted,
    without,
)
from .objective import objective
from .prices import BEGIN_SHARE, BEGIN_UNITS
from .volumes import DIRECTION, LEVEL, OFFSET, SETTLED, SIDES, SLOPE, U0, U1, V0, V1, is_fixed

AROUND_M = 0.5  # volumes nearer than this take part in each other's surroundings
DIGEST_STEP = 0.02  # of metres and of slopes: changes smaller than this are none
# of a digest: an odd number that spreads bits well, the bits that a float64 holds, and m above which all heights are one
DIGEST_FACTOR, DIGEST_BITS, HIGH_ABOVE = 6_364_136_223_846_793_005, (1 << 52) - 1, 1e5


@compiled
def improve(volumes, scene, value, slopes, rounds):
    """All moves in turn, for at most `rounds` rounds or until one brings next to nothing.

    A volume that no move changed is left alone until something around it is another.
    """
    for _ in range(rounds):
        before = value
        for k in range(len(volumes)):
            if is_unsettled(volumes, k) or (k == 0 and not is_fixed(volumes, k)):
                volumes, value = refitted(volumes, scene, value, k)
        for k in range(1, len(volumes)):
            if is_unsettled(volumes, k):
                around = look_around(volumes, scene.U, scene.V, k)
                value = move_edges(volumes, scene, k, value, EVERYWHERE, around)
        volumes, value = drop_volumes(volumes, scene, value)
        k = 1
        while k < len(volumes):
            count, start = len(volumes), value
            if is_unsettled(volumes, k):
                volumes, value = change_structure(volumes, scene, value, k, slopes)
                if value == start:
                    volumes[k, SETTLED] = surroundings(volumes, k)
            k = k + 1 if len(volumes) == count else 1
        volumes, value = without_base(volumes, scene, value)
        if value > before - 0.05 * scene.evidence:
            break
    return volumes, value


@compiled
def change_structure(volumes, scene, value, k, slopes):
    """All moves that change the planes of volume k, or join it to its neighbours."""
    volumes, value = change_planes(volumes, scene, value, k, slopes)
    return join_neighbours(volumes, scene, value, k)


@compiled
def change_planes(volumes, scene, value, k, slopes):
    """All moves that change which planes volume k has, how they are tied and where they face."""
    around = look_around(volumes, scene.U, scene.V, k)
    volumes, value = drop_planes(volumes, scene, value, k, np.inf, around)
    volumes, value = flatten(volumes, scene, value, k, around)
    volumes, value = change_ties(volumes, scene, value, k, around)
    volumes, value = face_walls(volumes, scene, value, k, around)
    return add_planes(volumes, scene, value, k, slopes, around)


@compiled
def without_base(volumes, scene, value):
    """The base below everything, where the volumes can cover the outline by themselves."""
    if volumes[0, OFFSET + LEVEL] <= scene.low - 0.6 or not is_unsettled(volumes, 0):
        return volumes, value
    volumes[0, SETTLED] = surroundings(volumes, 0)
    trial = volumes.copy()
    trial[0, OFFSET + LEVEL] = scene.low - 0.7
    found = objective(trial, scene, value + 0.3 * scene.n)
    if found < np.inf:
        found = move_all_edges(trial, scene, found, EVERYWHERE)
    return (trial, found) if found < value - LEAST_GAIN else (volumes, value)


@compiled
def is_unsettled(volumes, k):
    """Whether volume k may change, and it or what is around it did since no move helped there."""
    return not is_fixed(volumes, k) and volumes[k, SETTLED] != surroundings(volumes, k)


@compiled
def surroundings(volumes, k):
    """A digest of volume k, of those whose rectangles meet its own or lie in another direction, and of the base's height."""
    total = math.floor(volumes[0, OFFSET + LEVEL] / DIGEST_STEP)
    for j in range(1, len(volumes)):
        if volumes[j, DIRECTION] == volumes[k, DIRECTION] and (
            volumes[j, U0] > volumes[k, U1] + AROUND_M
            or volumes[j, U1] < volumes[k, U0] - AROUND_M
            or volumes[j, V0] > volumes[k, V1] + AROUND_M
            or volumes[j, V1] < volumes[k, V0] - AROUND_M
        ):
            continue
        term = 1
        for q in range(SETTLED):
            x = min(volumes[j, q], HIGH_ABOVE) / DIGEST_STEP
            term = (term + math.floor(x + 0.5)) * DIGEST_FACTOR
            term ^= term >> 29
        total += term
    return float(total & DIGEST_BITS) + 1.0


@compiled
def simplify(volumes, scene, value, steepest):
    """Volumes and planes no steeper than `steepest` that do not pay under `scene` (a more tolerant one) go or are merged."""
    for _ in range(4):
        before = value
        k = 1
        while k < len(volumes):
            if volumes[k, SLOPE : SLOPE + SIDES].max() <= steepest:
                trial = without(volumes, k)
                found = objective(
                    trial, scene, value + BEGIN_UNITS * scene.evidence + 2.0 * BEGIN_SHARE * scene.n
                )
                if found < np.inf:
                    found = move_all_edges(trial, scene, found, EVERYWHERE)
                    trial, found = refit_each(trial, scene, found)
                    if found < value - LEAST_GAIN:
                        volumes, value = trial, found
                        continue
            around = look_around(volumes, scene.U, scene.V, k)
            volumes, value = drop_planes(volumes, scene, value, k, steepest, around)
            k += 1
        volumes, value = merge_volumes(volumes, scene, value, steepest)
        if value > before - LEAST_GAIN:
            break
    return volumes, value
