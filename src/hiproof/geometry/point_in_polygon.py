"""Whether a point lies in rings, and how near: the even-odd rule, edge by edge. Compiled."""

from __future__ import annotations

import numpy as np
import shapely

from ..compiled import compiled


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


@compiled
def update_nearest(x0, y0, x1, y1, x, y, squared, inside):
    """Update how near edges are, `squared` (n,), and what lies `inside` (n,), for one edge more.

    It runs from (x0, y0) to (x1, y1), beside places x, y (n,).
    """
    dx, dy = x1 - x0, y1 - y0
    length = max(dx * dx + dy * dy, 1e-18)
    for k in range(len(x)):
        inside[k] ^= flips(x0, y0, x1, y1, x[k], y[k])
        t = min(max(((x[k] - x0) * dx + (y[k] - y0) * dy) / length, 0.0), 1.0)
        squared[k] = min(squared[k], (x0 + t * dx - x[k]) ** 2 + (y0 + t * dy - y[k]) ** 2)


def find_inside(area: shapely.Geometry, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return which places x, y (n,) lie inside an area or on its border.

    >>> find_inside(shapely.box(0, 0, 2, 1), np.array([1.0, 2.0, 3.0]), np.full(3, 0.5)).tolist()
    [True, True, False]
    """
    shapely.prepare(area)
    return np.asarray(shapely.intersects_xy(area, x, y))
