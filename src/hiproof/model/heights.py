"""Heights of roofs at many points. Compiled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..compiled import compiled
from ..geometry.point_in_polygon import flips
from ..geometry.rings import ring_edges
from .roof import Part


def find_highest(parts: Sequence[Part], xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Height (n,) of the roof of `parts` at `xy` (n, 2), minus infinity beside it, and the part
    (n,) it is of, the first of several, by its number: `Part.height_at` for many points. On a
    border that two pieces share it is one of them that holds a point.
    """
    z, top, (x, y) = (
        np.full(len(xy), -np.inf),
        np.zeros(len(xy), np.int64),
        np.ascontiguousarray(xy.T),
    )
    for k, part in enumerate(parts):
        for piece in part.pieces:
            raise_over(
                z, top, k, x, y, *ring_edges(piece.outline), np.ascontiguousarray(piece.planes)
            )
    return z, top


@compiled
def raise_over(z, top, number, x, y, starts, ends, planes):
    """Raise heights z (n,) at x, y to the lowest of `planes` (k, 3) inside the edges `starts`,
    `ends` (m, 2), `top` (n,) there becomes `number`.
    """
    inside = np.zeros(len(x), np.bool_)
    for e in range(len(starts)):
        for i in range(len(x)):
            inside[i] ^= flips(starts[e, 0], starts[e, 1], ends[e, 0], ends[e, 1], x[i], y[i])
    for k in np.nonzero(inside)[0]:
        lowest = np.inf
        for a, b, c in planes:
            lowest = min(lowest, a * x[k] + b * y[k] + c)
        if lowest > z[k]:
            z[k], top[k] = lowest, number
