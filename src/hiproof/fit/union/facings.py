"""Turn planes square to walls, or freely as their points suggest. Compiled.

All functions take volumes (k, COLUMNS) and the objective's value, and return the better of these
and of what they find. The `context` of volume k does not change.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from ..prices import FREE_UNITS
from .around import is_visible_at
from .edges import NO_GAIN
from .moves import settle_move
from .objective import compute_objective_with
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

MOST_TURNS = 4  # Turns of a plane towards what its points suggest.
MOST_TURN = 0.45  # Largest turn, as rise over run along the plane's edge.


@compiled
def face_walls(volumes, scene, value, k, context):
    """Turn the two planes along each axis of volume k, each to the axis or a wall.

    Walls are those of `scene.leans`. Planes may also turn freely. Nothing else is tried if all
    walls are along the axes.
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
                trial_value = compute_objective_with(trial, scene, k, context)
                if trial_value < best_value:
                    best, best_value = trial, trial_value
        best, best_value = face_freely(best, scene, best_value, k, axis, context)
        if best_value < value - NO_GAIN:
            volumes, value = best, best_value
            trial, trial_value = settle_move(volumes.copy(), scene, k, value, context)
            if trial_value < np.inf:
                volumes, value = trial, trial_value
    return volumes, value


@compiled
def face_freely(volumes, scene, value, k, axis, context):
    """Turn the two planes along an axis of volume k as their points suggest.

    They turn if that is clearly better than any wall.
    """
    trial, limit = volumes.copy(), value - FREE_UNITS * scene.unit
    for _ in range(MOST_TURNS):
        turns, middles = measure_turns(trial, scene, k, context)
        for plane in (2 * axis, 2 * axis + 1):
            lean = trial[k, LEAN0 + plane] + turns[plane]
            turn_plane(trial[k], plane, min(max(lean, -MOST_TURN), MOST_TURN), middles[plane])
        refit(trial, scene, k, context)
        trial_value = compute_objective_with(trial, scene, k, context)
        if trial_value < limit:
            volumes, value, limit = trial.copy(), trial_value, trial_value
    return volumes, value


@compiled
def measure_turns(volumes, scene, k, context):
    """Return how much the lean of each inclined plane (4,) of volume k should change.

    It is that of the points that the plane explains. Also returns u, v (4, 2) in the middle of
    these, or of the rectangle without points.
    """
    direction, n = int(volumes[k, DIRECTION]), scene.n
    u, v, c = scene.U[direction], scene.V[direction], read_coefficients(volumes, k)
    # These are sums of 1, u, v, the residual, y^2 and the residual times y. y runs along the
    # plane's eave.
    sums = np.zeros((N_SIDES, 6))
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
    """Make a plane of a volume lean by `lean`, in place, as high at `middle`.

    A plane that is absent stays absent.
    """
    if row[OFFSET0 + plane] == np.inf:
        return
    across = middle[1] if plane < 2 else middle[0]
    row[OFFSET0 + plane] += row[SLOPE0 + plane] * (row[LEAN0 + plane] - lean) * across
    row[LEAN0 + plane] = lean
