"""Heights of points over a roof, without regard to where exactly its steps lie."""

from __future__ import annotations

import numpy as np

from ..model import Part, Roof
from ..model.heights import find_highest

STEP_REACH_M = 0.4
"""How far (m) a step or an edge of the roof may lie from where the model has it: two standard
deviations of the horizontal difference between two surveys, which is 0.2 m."""

DIRECTIONS = np.array([(0.0, 0.0), *((np.cos(a), np.sin(a)) for a in np.arange(8) * np.pi / 4)])


def find_surfaces(roof: Roof, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pieces that show at `xy` (n, 2) or within STEP_REACH_M, and heights.

    `xy` are in the roof's frame. Returns the numbers (9, n) of pieces and whether (9, n) the roof
    covers the place, the place itself first.
    """
    pieces = [Part("", (piece,)) for piece in roof.pieces]
    places = (xy + STEP_REACH_M * DIRECTIONS[:, None, :]).reshape(-1, 2)
    heights, top = find_highest(pieces, places)
    shape = (len(DIRECTIONS), len(xy))
    return top.reshape(shape), np.isfinite(heights).reshape(shape)


def measure_residuals(roof: Roof, points: np.ndarray) -> np.ndarray:
    """Return the height (n,) of points (n, 3) over the roof, in the roof's frame.

    Of the surfaces that show within STEP_REACH_M the nearest in height counts. The height is NaN
    beside the roof.
    """
    if not len(points):
        return np.zeros(0)
    xy = np.ascontiguousarray(points[:, :2])
    top, covered = find_surfaces(roof, xy)
    heights = np.array([piece.height_at(xy) for piece in roof.pieces])
    over = points[:, 2] - heights[top, np.arange(len(points))]
    over[~covered] = np.inf
    nearest = np.abs(over).argmin(axis=0)
    result = over[nearest, np.arange(len(points))]
    return np.where(np.isfinite(result), result, np.nan)


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
