"""All moves in turn as long as they lower the objective, and the simplification under a more tolerant one. Compiled."""

from __future__ import annotations

import math

import numpy as np

from ...compiled import compiled
from .around import measure_context
from .edges import EVERYWHERE, NO_GAIN, move_edges
from .facings import face_walls
from .joins import join_neighbours, merge_volumes
from .moves import (
    add_planes,
    change_ties,
    drop_planes,
    drop_volumes,
    flatten,
    move_all_edges,
    refit_volume,
    refit_volumes,
    remove_volume,
)
from .objective import compute_objective
from .prices import BEGIN_SHARE, BEGIN_UNITS
from .volumes import DIRECTION, LEVEL, N_SIDES, OFFSET0, SETTLED, SLOPE0, U0, U1, V0, V1, is_fixed

DIGEST_REACH_M = 0.5  # volumes nearer than this take part in each other's surroundings
DIGEST_STEP = 0.02  # of metres and of slopes: changes smaller than this are none
# of a digest: an odd number that spreads bits well, the bits that a float64 holds, and m above which all heights are one
DIGEST_FACTOR, DIGEST_BITS, HIGH_ABOVE = 6_364_136_223_846_793_005, (1 << 52) - 1, 1e5


@compiled
def improve(volumes, scene, value, slopes, rounds):
    """All moves in turn, for at most `rounds` rounds or until one brings next to nothing.

    A volume that no move changed is left alone until something around it is another.
    """
    for _ in range(rounds):
        value_before = value
        for k in range(len(volumes)):
            if is_unsettled(volumes, k) or (k == 0 and not is_fixed(volumes, k)):
                volumes, value = refit_volume(volumes, scene, value, k)
        for k in range(1, len(volumes)):
            if is_unsettled(volumes, k):
                context = measure_context(volumes, scene.U, scene.V, k)
                value = move_edges(volumes, scene, k, value, EVERYWHERE, context)
        volumes, value = drop_volumes(volumes, scene, value)
        k = 1
        while k < len(volumes):
            count, start = len(volumes), value
            if is_unsettled(volumes, k):
                volumes, value = change_structure(volumes, scene, value, k, slopes)
                if value == start:
                    volumes[k, SETTLED] = digest_surroundings(volumes, k)
            k = k + 1 if len(volumes) == count else 1
        volumes, value = drop_base(volumes, scene, value)
        if value > value_before - 0.05 * scene.evidence:
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
    context = measure_context(volumes, scene.U, scene.V, k)
    volumes, value = drop_planes(volumes, scene, value, k, np.inf, context)
    volumes, value = flatten(volumes, scene, value, k, context)
    volumes, value = change_ties(volumes, scene, value, k, context)
    volumes, value = face_walls(volumes, scene, value, k, context)
    return add_planes(volumes, scene, value, k, slopes, context)


@compiled
def drop_base(volumes, scene, value):
    """The base below everything, where the volumes can cover the outline by themselves."""
    if volumes[0, OFFSET0 + LEVEL] <= scene.low - 0.6 or not is_unsettled(volumes, 0):
        return volumes, value
    volumes[0, SETTLED] = digest_surroundings(volumes, 0)
    trial = volumes.copy()
    trial[0, OFFSET0 + LEVEL] = scene.low - 0.7
    trial_value = compute_objective(trial, scene, value + 0.3 * scene.n)
    if trial_value < np.inf:
        trial_value = move_all_edges(trial, scene, trial_value, EVERYWHERE)
    return (trial, trial_value) if trial_value < value - NO_GAIN else (volumes, value)


@compiled
def is_unsettled(volumes, k):
    """Whether volume k may change, and it or what is around it did since no move helped there."""
    return not is_fixed(volumes, k) and volumes[k, SETTLED] != digest_surroundings(volumes, k)


@compiled
def digest_surroundings(volumes, k):
    """A digest of volume k, of those whose rectangles meet its own or lie in another direction, and of the base's height."""
    total = math.floor(volumes[0, OFFSET0 + LEVEL] / DIGEST_STEP)
    for j in range(1, len(volumes)):
        if volumes[j, DIRECTION] == volumes[k, DIRECTION] and (
            volumes[j, U0] > volumes[k, U1] + DIGEST_REACH_M
            or volumes[j, U1] < volumes[k, U0] - DIGEST_REACH_M
            or volumes[j, V0] > volumes[k, V1] + DIGEST_REACH_M
            or volumes[j, V1] < volumes[k, V0] - DIGEST_REACH_M
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
        value_before = value
        k = 1
        while k < len(volumes):
            if volumes[k, SLOPE0 : SLOPE0 + N_SIDES].max() <= steepest:
                trial = remove_volume(volumes, k)
                trial_value = compute_objective(
                    trial, scene, value + BEGIN_UNITS * scene.evidence + 2.0 * BEGIN_SHARE * scene.n
                )
                if trial_value < np.inf:
                    trial_value = move_all_edges(trial, scene, trial_value, EVERYWHERE)
                    trial, trial_value = refit_volumes(trial, scene, trial_value)
                    if trial_value < value - NO_GAIN:
                        volumes, value = trial, trial_value
                        continue
            context = measure_context(volumes, scene.U, scene.V, k)
            volumes, value = drop_planes(volumes, scene, value, k, steepest, context)
            k += 1
        volumes, value = merge_volumes(volumes, scene, value, steepest)
        if value > value_before - NO_GAIN:
            break
    return volumes, value
