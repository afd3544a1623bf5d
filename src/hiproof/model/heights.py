"""Heights of roofs at many points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry.point_in_polygon import find_inside
from .roof import Part


def find_highest(parts: Sequence[Part], xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the height (n,) of the roof of `parts` at `xy` (n, 2), and the part.

    Beside the roof the height is minus infinity. The part (n,) is given by its number, the first of
    several. This is `Part.height_at` for many points.
    """
    x, y = np.ascontiguousarray(xy.T)
    return join_highest([measure_part(part, x, y) for part in parts], len(xy))


def measure_part(part: Part, x: np.ndarray, y: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return which of the places x, y (n,) each piece of a part covers, and its heights there."""
    covered = []
    for piece in part.pieces:
        inside = np.flatnonzero(find_inside(piece.outline, x, y))
        covered.append((inside, piece.height_at(np.column_stack([x[inside], y[inside]]))))
    return covered


def join_highest(
    covered: Sequence[list[tuple[np.ndarray, np.ndarray]]], n: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return what `find_highest` does for what each part covers of n places."""
    z, top = np.full(n, -np.inf), np.zeros(n, np.int64)
    for k, pieces in enumerate(covered):
        for inside, heights in pieces:
            is_higher = heights > z[inside]
            z[inside[is_higher]], top[inside[is_higher]] = heights[is_higher], k
    return z, top
