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
    z, top = np.full(len(xy), -np.inf), np.zeros(len(xy), np.int64)
    x, y = np.ascontiguousarray(xy.T)
    for k, part in enumerate(parts):
        for piece in part.pieces:
            inside = np.flatnonzero(find_inside(piece.outline, x, y))
            heights = piece.height_at(xy[inside])
            is_higher = heights > z[inside]
            z[inside[is_higher]], top[inside[is_higher]] = heights[is_higher], k
    return z, top
