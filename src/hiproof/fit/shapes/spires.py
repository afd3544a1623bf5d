"""Measure how near points lie to spires of equal sides."""

from __future__ import annotations

import math

import numpy as np

from ...primitives.cone import BROACH_SIDES, HEXAGON_SIDES

SIDES_OF_SPIRES = {"broach": BROACH_SIDES, "hexagonal_spire": HEXAGON_SIDES}
ROTATIONS = 6  # Rotations of a spire that are tried within one of its facets.
LEAST_SLOPE = 0.1  # Facets that rise less do not show where their middle is.
RIDGE = 1e-9  # Share of the mean diagonal that keeps what no point determines.


def fit_spires(
    points: np.ndarray, middles: np.ndarray, facings: np.ndarray, facets: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit spires to points (n, 3), each by one step from a start.

    A spire has its middle in `middles` (k, 2), which may be one (1, 2) for all. `facings` (k,) are
    the directions of one facet of each, and `facets` (k,) the turns to the next one (rad). Returns
    middles and facings after the step, and the distances (k, n) of the points in height (m).
    """
    x, y = (points[:, axis] - middles[:, axis, None] for axis in (0, 1))
    r, turns, facet = np.hypot(x, y), np.arctan2(y, x), facets[:, None]
    aside = (turns - facings[:, None] + 0.5 * facet) % facet - 0.5 * facet
    ahead = turns - aside  # the way that the facet under a point faces
    # A turn and a shift of the middle change heights by the slope times these columns.
    moves = r * np.sin(aside), -np.cos(ahead), -np.sin(ahead)
    design = np.stack([r * np.cos(aside), *moves, np.ones_like(aside)], axis=1)
    normal, z = design @ design.swapaxes(1, 2), points[:, 2] - points[:, 2].mean()
    count = normal.shape[1]
    ridge = RIDGE / count * normal.trace(axis1=1, axis2=2)[:, None, None] * np.eye(count)
    solution = np.linalg.solve(normal + ridge, design @ z[:, None])
    distances = np.abs(z - (solution.swapaxes(1, 2) @ design)[:, 0])
    slope = np.minimum(solution[:, 0], -LEAST_SLOPE)
    turn = np.clip(solution[:, 1] / slope, -0.5 * facet, 0.5 * facet)
    reach = r.max(axis=1, keepdims=True)
    shift = np.clip(solution[:, 2:4, 0] / slope, -reach, reach)
    is_steep = solution[:, 0] <= -LEAST_SLOPE
    return middles + is_steep * shift, facings + (is_steep * turn)[:, 0], distances


def measure_spires(points: np.ndarray, middle: np.ndarray, cap_m: float) -> float:
    """Measure how far (m, mean) points (n, 3) lie from a spire around a middle (2,).

    It is the spire nearest to them, and each counts up to `cap_m`.
    """
    facets = np.repeat([2.0 * math.pi / sides for sides in SIDES_OF_SPIRES.values()], ROTATIONS)
    facings = facets * np.tile(np.arange(ROTATIONS) / ROTATIONS, len(SIDES_OF_SPIRES))
    middles, facings, distances = fit_spires(points, middle[None], facings, facets)
    left = np.minimum(distances, cap_m).mean(axis=1)
    best = [int(np.argmin(left))]
    *_, distances = fit_spires(points, middles[best], facings[best], facets[best])
    return float(min(left[best[0]], np.minimum(distances, cap_m).mean()))
