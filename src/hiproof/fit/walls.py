"""Points that lie on walls.

Points much higher stand beside them, nearer than any roof is steep.

Compiled.
"""

from __future__ import annotations

import numpy as np

from ..compiled import compiled
from ..geometry.arrays import find_place, sort_order

WALL_REACH_SPACINGS = 1.2  # how far around a point is looked
STEEPEST_ROOF = 2.0  # slope of a roof: 63 degrees


@compiled
def on_walls(points, neighbours, spacing):
    """Return which of `points` (n, 3) lie on a wall of a roof.

    The roof is that of `neighbours` (m, 3), about `spacing` (m) apart in plan.

    >>> roof = np.array([[0.0, 0.0, 5.0], [0.4, 0.0, 5.0], [0.8, 0.0, 5.0]])
    >>> on_walls(np.array([[-0.05, 0.0, 2.0], [-0.05, 0.0, 4.8]]), roof, 0.5)
    array([ True, False])
    """
    reach, result = WALL_REACH_SPACINGS * spacing, np.zeros(len(points), np.bool_)
    x_of_neighbours = neighbours[:, 0].copy()
    order = sort_order(x_of_neighbours)
    ascending = x_of_neighbours[order]
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        k = find_place(ascending, x - reach)
        while k < len(order) and ascending[k] <= x + reach and not result[i]:
            j = order[k]
            mask = (neighbours[j, 0] - x) ** 2 + (neighbours[j, 1] - y) ** 2 < reach * reach
            result[i] = mask and neighbours[j, 2] > z + STEEPEST_ROOF * reach
            k += 1
    return result
