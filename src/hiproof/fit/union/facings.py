"""Moves that turn planes: square to walls that are not quite along the axes, or freely as their points say. Compiled.

All functions take volumes (k, COLUMNS) and the objective's value, and return the better of what they got and what they found.
What is `around` volume k they leave as it is.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from .around import shows_at
from .edges import EVERYWHERE, LEAST_GAIN
from .moves import settled
from .objective import objective_with
from .prices import FREE_UNITS
from .refit import refit
from .volumes import (
    DIRECTION,
    LEAN,
    LEVEL,
    OFFSET,
    SIDES,
    SLOPE,
    U0,
    U1,
    coefficients,
    lowest_plane,
)

# turns of a plane towards what its points say; most of a turn, as rise over run along its edge
TURNS, MOST_TURN = 4, 0.45


@compiled
def face_walls(volumes, scene, value, k, around):
    """The two planes along each axis of volume k face along it or square to walls, each to one of `scene.leans`, or freely.

    Where all walls are along the axes no other way is looked for.
    """
    for axis in range(2):
        walls = scene.leans[int(volumes[k, DIRECTION]), axis]
        low, high = 2 * axis, 2 * axis + 1
        if walls[0] == np.inf or (volumes[k, OFFSET + low] == np.inf and volumes[k, OFFSET + high] == np.inf):
            continue
        _, middles = turns_of_planes(volumes, scene, k, around)
        best, best_value = volumes, value - LEAST_GAIN
        there = int(np.isfinite(walls).sum())
        for a in range(-1, there):
            for b in range(-1, there):
                trial = volumes.copy()
                for plane, wall in ((low, a), (high, b)):
                    lean = 0.0 if wall < 0 else walls[wall]
                    turn_plane(trial[k], plane, (lean if plane % 2 else -lean) + 0.0, middles[plane])
                refit(trial, scene, k, around)
                found = objective_with(trial, scene, k, around, best_value)
                if found < best_value:
                    best, best_value = trial, found
        best, best_value = face_freely(best, scene, best_value, k, axis, around)
        if best_value < value - LEAST_GAIN:
            volumes, value = best, best_value
            trial, found = settled(volumes.copy(), scene, k, value, EVERYWHERE, around)
            if found < np.inf:
                volumes, value = trial, found
    return volumes, value


@compiled
def face_freely(volumes, scene, value, k, axis, around):
    """The two planes along an axis of volume k face as their points say, where that is clearly better than any wall."""
    trial, limit = volumes.copy(), value - FREE_UNITS * scene.evidence
    for _ in range(TURNS):
        turns, middles = turns_of_planes(trial, scene, k, around)
        for plane in (2 * axis, 2 * axis + 1):
            lean = trial[k, LEAN + plane] + turns[plane]
            turn_plane(trial[k], plane, min(max(lean, -MOST_TURN), MOST_TURN), middles[plane])
        refit(trial, scene, k, around)
        found = objective_with(trial, scene, k, around, limit)
        if found < limit:
            volumes, value, limit = trial.copy(), found, found
    return volumes, value


@compiled
def turns_of_planes(volumes, scene, k, around):
    """By how much the lean of each inclined plane (4,) of volume k has to change for the points that it explains, and u, v (4, 2)
    in the middle of these; in that of its rectangle where there are none."""
    direction, n = int(volumes[k, DIRECTION]), scene.n
    u, v, c = scene.U[direction], scene.V[direction], coefficients(volumes, k)
    sums = np.zeros(
        (SIDES, 6)
    )  # of 1, u, v, what is left, and of y^2 and what is left times y, y along the plane's eave
    for i in range(n):
        h, plane = lowest_plane(c, u[i], v[i])
        left = scene.z[i] - h
        if (
            plane < LEVEL
            and abs(left) < scene.dead + scene.width
            and shows_at(volumes, k, around, i, h, u[i], v[i])
        ):
            y = v[i] if plane < 2 else u[i]
            for q, term in enumerate((1.0, u[i], v[i], left, y * y, left * y)):
                sums[plane, q] += term
    turns, middles = np.zeros(SIDES), np.empty((SIDES, 2))
    for plane in range(SIDES):
        for axis in range(2):
            middle = 0.5 * (volumes[k, U0 + 2 * axis] + volumes[k, U1 + 2 * axis])
            middles[plane, axis] = sums[plane, 1 + axis] / sums[plane, 0] if sums[plane, 0] > 0.0 else middle
        y = middles[plane, 1] if plane < 2 else middles[plane, 0]
        spread = sums[plane, 4] - sums[plane, 0] * y * y
        if spread > 1e-9 and volumes[k, SLOPE + plane] > 0.0:
            turns[plane] = (sums[plane, 5] - sums[plane, 3] * y) / spread / volumes[k, SLOPE + plane]
    return turns, middles


@compiled
def turn_plane(row, plane, lean, middle):
    """Make a plane of a volume lean by `lean`, in place, as high at `middle` (u, v) as it was; one that is not there stays so."""
    if row[OFFSET + plane] == np.inf:
        return
    across = middle[1] if plane < 2 else middle[0]
    row[OFFSET + plane] += row[SLOPE + plane] * (row[LEAN + plane] - lean) * across
    row[LEAN + plane] = lean
