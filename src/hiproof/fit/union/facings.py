"""Moves that turn planes: square to walls that are not quite along the axes, or freely as their points say. Compiled.

All functions take volumes (k, COLUMNS) and the objective's value, and return the better of what they got and what they found.
What is `around` volume k they leave as it is.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from .around import is_visible_at
from .edges import EVERYWHERE, NO_GAIN
from .moves import settle_move
from .objective import compute_objective_with
from .prices import FREE_UNITS
from .refit import refit
from .volumes import (
    DIRECTION,
    LEAN0,
    LEVEL,
    N_SIDES,
    OFFSET0,
    SLOPE0,
    U0,
    U1,
    find_lowest_plane,
    read_coefficients,
)

# turns of a plane towards what its points say; most of a turn, as rise over run along its edge
MOST_TURNS, MOST_TURN = 4, 0.45


@compiled
def face_walls(volumes, scene, value, k, context):
    """The two planes along each axis of volume k face along it or square to walls, each to one of `scene.leans`, or freely.

    Where all walls are along the axes no other way is looked for.
    """
    for axis in range(2):
        walls = scene.leans[int(volumes[k, DIRECTION]), axis]
        first_plane, second_plane = 2 * axis, 2 * axis + 1
        if walls[0] == np.inf or (
            volumes[k, OFFSET0 + first_plane] == np.inf
            and volumes[k, OFFSET0 + second_plane] == np.inf
        ):
            continue
        _, middles = measure_turns(volumes, scene, k, context)
        best, best_value = volumes, value - NO_GAIN
        n_walls = int(np.isfinite(walls).sum())
        for a in range(-1, n_walls):
            for b in range(-1, n_walls):
                trial = volumes.copy()
                for plane, wall in ((first_plane, a), (second_plane, b)):
                    lean = 0.0 if wall < 0 else walls[wall]
                    turn_plane(
                        trial[k], plane, (lean if plane % 2 else -lean) + 0.0, middles[plane]
                    )
                refit(trial, scene, k, context)
                trial_value = compute_objective_with(trial, scene, k, context, best_value)
                if trial_value < best_value:
                    best, best_value = trial, trial_value
        best, best_value = face_freely(best, scene, best_value, k, axis, context)
        if best_value < value - NO_GAIN:
            volumes, value = best, best_value
            trial, trial_value = settle_move(volumes.copy(), scene, k, value, EVERYWHERE, context)
            if trial_value < np.inf:
                volumes, value = trial, trial_value
    return volumes, value


@compiled
def face_freely(volumes, scene, value, k, axis, context):
    """The two planes along an axis of volume k face as their points say, where that is clearly better than any wall."""
    trial, limit = volumes.copy(), value - FREE_UNITS * scene.evidence
    for _ in range(MOST_TURNS):
        turns, middles = measure_turns(trial, scene, k, context)
        for plane in (2 * axis, 2 * axis + 1):
            lean = trial[k, LEAN0 + plane] + turns[plane]
            turn_plane(trial[k], plane, min(max(lean, -MOST_TURN), MOST_TURN), middles[plane])
        refit(trial, scene, k, context)
        trial_value = compute_objective_with(trial, scene, k, context, limit)
        if trial_value < limit:
            volumes, value, limit = trial.copy(), trial_value, trial_value
    return volumes, value


@compiled
def measure_turns(volumes, scene, k, context):
    """By how much the lean of each inclined plane (4,) of volume k has to change for the points that it explains, and u, v (4, 2)
    in the middle of these; in that of its rectangle where there are none."""
    direction, n = int(volumes[k, DIRECTION]), scene.n
    u, v, c = scene.U[direction], scene.V[direction], read_coefficients(volumes, k)
    sums = np.zeros(
        (N_SIDES, 6)
    )  # of 1, u, v, what is left, and of y^2 and what is left times y, y along the plane's eave
    for i in range(n):
        h, plane = find_lowest_plane(c, u[i], v[i])
        residual = scene.z[i] - h
        if (
            plane < LEVEL
            and abs(residual) < scene.dead + scene.width
            and is_visible_at(volumes, k, context, i, h, u[i], v[i])
        ):
            y = v[i] if plane < 2 else u[i]
            for q, term in enumerate((1.0, u[i], v[i], residual, y * y, residual * y)):
                sums[plane, q] += term
    turns, middles = np.zeros(N_SIDES), np.empty((N_SIDES, 2))
    for plane in range(N_SIDES):
        for axis in range(2):
            middle = 0.5 * (volumes[k, U0 + 2 * axis] + volumes[k, U1 + 2 * axis])
            middles[plane, axis] = (
                sums[plane, 1 + axis] / sums[plane, 0] if sums[plane, 0] > 0.0 else middle
            )
        y = middles[plane, 1] if plane < 2 else middles[plane, 0]
        spread = sums[plane, 4] - sums[plane, 0] * y * y
        if spread > 1e-9 and volumes[k, SLOPE0 + plane] > 0.0:
            turns[plane] = (
                (sums[plane, 5] - sums[plane, 3] * y) / spread / volumes[k, SLOPE0 + plane]
            )
    return turns, middles


@compiled
def turn_plane(row, plane, lean, middle):
    """Make a plane of a volume lean by `lean`, in place, as high at `middle` (u, v) as it was; one that is not there stays so."""
    if row[OFFSET0 + plane] == np.inf:
        return
    across = middle[1] if plane < 2 else middle[0]
    row[OFFSET0 + plane] += row[SLOPE0 + plane] * (row[LEAN0 + plane] - lean) * across
    row[LEAN0 + plane] = lean
