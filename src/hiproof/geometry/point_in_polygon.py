"""Whether a point lies in rings: the even-odd rule, edge by edge. Compiled."""

from __future__ import annotations

import numpy as np
import shapely

from ..compiled import compiled
from .rings import ring_edges

MOST_OWN_CORNERS = 200  # Of more, shapely is faster: it looks only at those near a point.


@compiled
def flips(x0, y0, x1, y1, x, y):
    """Return whether an edge crosses the ray from (x, y) towards larger x.

    The edge runs from (x0, y0) to (x1, y1). A point is inside those rings of whose edges an odd
    number do; on a shared edge it is on one side only. Without a branch or a division, the
    processor looks at several points at once.
    """
    turn = (x - x0) * (y1 - y0) - (y - y0) * (x1 - x0)
    is_left = ((turn < 0.0) & (y1 > y0)) | ((turn > 0.0) & (y1 < y0))
    return ((y0 > y) != (y1 > y)) & is_left


def find_inside(area: shapely.Geometry, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return which places x, y (n,) lie inside an area or on its border.

    For the few corners of a building, it takes a fifth of the time of `shapely.intersects_xy`.

    >>> find_inside(shapely.box(0, 0, 2, 1), np.array([1.0, 2.0, 3.0]), np.full(3, 0.5)).tolist()
    [True, True, False]
    """
    starts, ends = ring_edges(area)
    if len(starts) > MOST_OWN_CORNERS:
        shapely.prepare(area)
        return np.asarray(shapely.intersects_xy(area, x, y))
    inside = np.zeros(len(x), bool)
    x0, y0, x1, y1 = area.bounds
    near = np.flatnonzero((x >= x0) & (x <= x1) & (y >= y0) & (y <= y1))
    inside[near] = mark_inside(np.asarray(x[near], float), np.asarray(y[near], float), starts, ends)
    return inside


@compiled
def mark_inside(x, y, starts, ends):
    """Return which x, y (n,) lie inside or on rings of edges `starts` to `ends` (m, 2)."""
    inside, is_on = np.zeros(len(x), np.bool_), np.zeros(len(x), np.bool_)
    for e in range(len(starts)):
        x0, y0, x1, y1 = starts[e, 0], starts[e, 1], ends[e, 0], ends[e, 1]
        low_x, high_x, low_y, high_y = min(x0, x1), max(x0, x1), min(y0, y1), max(y0, y1)
        for i in range(len(x)):
            inside[i] ^= flips(x0, y0, x1, y1, x[i], y[i])
            is_beside = (x[i] >= low_x) & (x[i] <= high_x) & (y[i] >= low_y) & (y[i] <= high_y)
            is_on[i] |= ((x[i] - x0) * (y1 - y0) == (y[i] - y0) * (x1 - x0)) & is_beside
    return inside | is_on
