"""Heights of points over a roof, without regard to where exactly its steps lie."""

from __future__ import annotations

import numpy as np

from ..model import Part, Roof
from ..model.heights import find_highest

STEP_REACH_M = 0.4
"""How far (m) a step or an edge of the roof may lie from where the model has it: two standard
deviations of the horizontal difference between two surveys, which is 0.2 m."""

ON_SURFACE_M = 0.1
"""Distance (m) from the surface below a point within which the point lies on it, whatever shows
nearby: two standard deviations of the points of two surveys, which are 0.05 m each."""

DIRECTIONS = np.array([(np.cos(a), np.sin(a)) for a in np.arange(8) * np.pi / 4])


def measure_residuals(roof: Roof, points: np.ndarray) -> np.ndarray:
    """Return the height (n,) of points (n, 3) over the roof, in the roof's frame.

    It is that over the surface below a point where the point lies on it. Otherwise the nearest in
    height counts of all surfaces that show within STEP_REACH_M. The height is NaN beside the roof.
    """
    pieces = [Part("", (piece,)) for piece in roof.pieces]
    result = points[:, 2] - find_highest(pieces, np.ascontiguousarray(points[:, :2]))[0]
    other = np.flatnonzero(np.abs(result) > ON_SURFACE_M)
    result[other] = measure_nearest(roof, pieces, points[other], result[other])
    return np.where(np.isfinite(result), result, np.nan)


def measure_nearest(
    roof: Roof, pieces: list[Part], points: np.ndarray, own: np.ndarray
) -> np.ndarray:
    """Return the height (n,) of points (n, 3) over the surface nearest in height.

    `own` (n,) is that over the surface below them; others show within STEP_REACH_M.
    """
    xy = points[:, :2]
    around = (xy + STEP_REACH_M * DIRECTIONS[:, None, :]).reshape(-1, 2)
    found, top = find_highest(pieces, around)
    heights = np.array([piece.height_at(xy) for piece in roof.pieces])
    over = points[:, 2] - heights[top.reshape(len(DIRECTIONS), -1), np.arange(len(points))]
    over[~np.isfinite(found).reshape(over.shape)] = np.inf
    over = np.concatenate([own[None], over])
    return over[np.abs(over).argmin(axis=0), np.arange(len(points))]


def find_slopes(roof: Roof, xy: np.ndarray) -> np.ndarray:
    """Return the gradient (n, 2) of the roof at `xy` (n, 2), NaN beside it."""
    result = np.full((len(xy), 2), np.nan)
    if not len(xy):
        return result
    pieces = [Part("", (piece,)) for piece in roof.pieces]
    heights, top = find_highest(pieces, np.ascontiguousarray(xy))
    for number, piece in enumerate(roof.pieces):
        mask = (top == number) & np.isfinite(heights)
        if mask.any():
            z = xy[mask] @ piece.planes[:, :2].T + piece.planes[:, 2]
            result[mask] = piece.planes[z.argmin(axis=1), :2]
    return result
