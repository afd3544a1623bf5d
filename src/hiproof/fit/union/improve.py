"""Make all moves in turn while they lower the objective. Compiled."""

from __future__ import annotations

import math

from ...compiled import compiled
from .around import measure_context
from .edges import EVERYWHERE, NO_GAIN, move_edges
from .facings import face_walls
from .moves import (
    add_planes,
    change_ties,
    drop_planes,
    drop_volumes,
    move_all_edges,
    refit_volume,
)
from .objective import compute_objective
from .volumes import DIRECTION, LEVEL, OFFSET0, SETTLED, U0, U1, V0, V1

DIGEST_REACH_M = 0.5  # Volumes nearer than this (m) belong to each other's surroundings.
DIGEST_STEP = 0.02  # Smaller changes of metres and of slopes are none.
DIGEST_FACTOR = 6_364_136_223_846_793_005  # An odd number that spreads bits well.
DIGEST_BITS = (1 << 52) - 1  # The bits that a float64 holds exactly.
HIGH_ABOVE = 1e5  # All larger heights (m) are one.


@compiled
def improve(volumes, scene, value, slopes, rounds):
    """Make all moves in turn, for at most `rounds` rounds.

    It ends earlier if a round brings next to nothing. A volume that no move changed is left alone
    until something around it changes.
    """
    for _ in range(rounds):
        value_before = value
        for k in range(len(volumes)):
            if k == 0 or is_unsettled(volumes, scene.turn, k):
                context = measure_context(volumes, scene.U, scene.V, k)
                volumes, value = refit_volume(volumes, scene, value, k, context)
        for k in range(1, len(volumes)):
            if is_unsettled(volumes, scene.turn, k):
                context = measure_context(volumes, scene.U, scene.V, k)
                value = move_edges(volumes, scene, k, value, EVERYWHERE, context)
        volumes, value = drop_volumes(volumes, scene, value)
        for k in range(1, len(volumes)):
            if is_unsettled(volumes, scene.turn, k):
                start = value
                volumes, value = change_planes(volumes, scene, value, k, slopes)
                if value == start:
                    volumes[k, SETTLED] = digest_surroundings(volumes, scene.turn, k)
        volumes, value = drop_base(volumes, scene, value)
        if value > value_before - 0.05 * scene.unit:
            break
    return volumes, value


@compiled
def change_planes(volumes, scene, value, k, slopes):
    """Make all moves that change which planes volume k has, their ties and facings."""
    context = measure_context(volumes, scene.U, scene.V, k)
    volumes, value = drop_planes(volumes, scene, value, k, context)
    volumes, value = change_ties(volumes, scene, value, k, context)
    volumes, value = face_walls(volumes, scene, value, k, context)
    return add_planes(volumes, scene, value, k, slopes, context)


@compiled
def drop_base(volumes, scene, value):
    """Lower the base below everything, if the volumes can cover the outline alone."""
    if volumes[0, OFFSET0 + LEVEL] <= scene.low - 0.6 or not is_unsettled(volumes, scene.turn, 0):
        return volumes, value
    volumes[0, SETTLED] = digest_surroundings(volumes, scene.turn, 0)
    trial = volumes.copy()
    trial[0, OFFSET0 + LEVEL] = scene.low - 0.7
    trial_value = compute_objective(trial, scene)
    if trial_value < value + 0.3 * scene.n:
        trial_value = move_all_edges(trial, scene, trial_value, EVERYWHERE)
    return (trial, trial_value) if trial_value < value - NO_GAIN else (volumes, value)


@compiled
def is_unsettled(volumes, turn, k):
    """Return whether volume k may change, and its surroundings did since the last try."""
    return volumes[k, SETTLED] != digest_surroundings(volumes, turn, k)


@compiled
def digest_surroundings(volumes, turn, k):
    """Compute a digest of volume k and of what may meet it.

    These are the base's height, and volumes whose rectangles may meet its own.
    """
    total = math.floor(volumes[0, OFFSET0 + LEVEL] / DIGEST_STEP)
    for j in range(1, len(volumes)):
        if not may_meet(volumes, j, k, turn):
            continue
        term = 1
        for q in range(SETTLED):
            x = min(volumes[j, q], HIGH_ABOVE) / DIGEST_STEP
            term = (term + math.floor(x + 0.5)) * DIGEST_FACTOR
            term ^= term >> 29
        total += term
    return float(total & DIGEST_BITS) + 1.0


@compiled
def may_meet(volumes, j, k, turn):
    """Return whether volume j reaches within DIGEST_REACH_M of volume k, in the axes of k."""
    other, direction = int(volumes[j, DIRECTION]), int(volumes[k, DIRECTION])
    cosine = turn[other, 0] * turn[direction, 0] + turn[other, 1] * turn[direction, 1]
    sine = turn[other, 1] * turn[direction, 0] - turn[other, 0] * turn[direction, 1]
    half_u, half_v = (
        0.5 * (volumes[j, U1] - volumes[j, U0]),
        0.5 * (volumes[j, V1] - volumes[j, V0]),
    )
    u, v = volumes[j, U0] + half_u, volumes[j, V0] + half_v
    reach_u = abs(cosine) * half_u + abs(sine) * half_v + DIGEST_REACH_M
    reach_v = abs(sine) * half_u + abs(cosine) * half_v + DIGEST_REACH_M
    u, v = cosine * u - sine * v, sine * u + cosine * v
    return (
        u - reach_u <= volumes[k, U1]
        and u + reach_u >= volumes[k, U0]
        and v - reach_v <= volumes[k, V1]
        and v + reach_v >= volumes[k, V0]
    )
