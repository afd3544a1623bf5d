"""Which points lie on walls: beside them, nearer than any roof is steep, stand points much higher."""

from __future__ import annotations

import numpy as np
import shapely

REACH_SPACINGS, NEIGHBOURS = 1.2, 8  # how far around a point is looked, and at how many points at most
STEEPEST = 2.0  # slope of a roof: 63 degrees
# m from the border of the points' shape within which a wall is an outer one: the scanner's noise, doubled
OUTER_M = 0.25


def on_walls(points: np.ndarray, spacing: float, shape: shapely.Polygon) -> tuple[np.ndarray, np.ndarray]:
    """Which of `points` (n, 3), about `spacing` (m) apart in plan, lie on a wall; and on one outside, on the border of `shape`."""
    from scipy.spatial import cKDTree

    reach = REACH_SPACINGS * spacing
    _, near = cKDTree(points[:, :2]).query(points[:, :2], NEIGHBOURS, distance_upper_bound=reach)
    z = np.append(points[:, 2], -np.inf)  # the last stands for no neighbour
    wall = z[near].max(axis=1) > points[:, 2] + STEEPEST * reach
    return wall, wall & shapely.dwithin(shape.exterior, shapely.points(points[:, :2]), OUTER_M)
