"""Points inside an outline that lie on a neighbour's roof, which reaches over it.

Where a higher house stands, its roof may reach over the common wall. Its overhang hides the lower
roof there, and would become a slice of the lower house. Points just inside the outline belong to it
if they continue the neighbour's surface, as far as where the building's own roof begins below it.
"""

from __future__ import annotations

import numpy as np
import shapely

from ..geometry.outline_edges import OutlineEdges, list_outline_edges
from .overhang import LONGEST_OVERHANG_M, ON_PLANE_M, OVERHANG_REACH_M, measure_gap

LEAST_DROP_M = 2.0 * ON_PLANE_M  # from an overhang to the roof below it; less is one surface
NEAREST_POINTS, NEAREST_M = 10, 1.0  # of a neighbour, through which its plane goes at an edge
LEAST_OVERHANG_SHARE = 0.75  # of the points up to an overhang's end on it, and below it beyond
FEWEST_BELOW = 4  # points of the roof below
LEVELLING_M2 = 1e-3  # holds the slope back across points on a line
END_BLUR_M = 0.1  # that points lie beyond the end of an overhang: their accuracy in plan


def find_neighbour_roofs(
    points: np.ndarray,
    outline: shapely.Polygon,
    surroundings: np.ndarray,
    neighbours: shapely.Geometry,
) -> np.ndarray:
    """Find the points on roofs of neighbours that reach over an outline.

    `points` (n, 3) lie in the outline, its `surroundings` (m, 3) in the area of its `neighbours`,
    in one frame. Returns a mask (n,).

    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(-3, 6, 0.3), np.arange(0, 6, 0.3)))
    >>> points = np.column_stack([x, y, np.where(x < 0.5, 9.0, 5.0)])
    >>> inside, beside = points[x > -0.01], points[x < -0.01]
    >>> house, neighbour = shapely.box(0, 0, 6, 6), shapely.box(-6, 0, 0, 6)
    >>> is_over = find_neighbour_roofs(inside, house, beside, neighbour)
    >>> bool((is_over == (inside[:, 2] == 9.0)).all()), int(is_over.sum())
    (True, 40)
    """
    is_over = np.zeros(len(points), bool)
    edges = list_outline_edges(outline)
    for number in np.flatnonzero(edges.lengths >= LONGEST_OVERHANG_M).tolist():
        if measure_gap(edges, number, neighbours) <= LONGEST_OVERHANG_M:
            inner, outer = (select_beside(xyz, edges, number) for xyz in (points, surroundings))
            if len(inner) >= FEWEST_BELOW and len(outer) >= NEAREST_POINTS:
                outwards, start = edges.normals[number], edges.starts[number]
                depth = (start - points[inner, :2]) @ outwards
                rise = measure_rise(points[inner], depth, outwards, surroundings[outer])
                is_over[inner] |= mark_overhang(depth, rise)
    return is_over


def select_beside(points: np.ndarray, edges: OutlineEdges, number: int) -> np.ndarray:
    """Return the numbers of the points (n, 3) that lie beside an edge."""
    start, length = edges.starts[number], edges.lengths[number]
    offset = points[:, :2] - start
    along = offset @ (edges.ends[number] - start) / length
    is_near = np.abs(offset @ edges.normals[number]) <= OVERHANG_REACH_M
    return np.flatnonzero(is_near & (along >= 0.0) & (along <= length))


def measure_rise(
    points: np.ndarray, depth: np.ndarray, outwards: np.ndarray, surface: np.ndarray
) -> np.ndarray:
    """Measure how far points (n, 3) lie above a neighbour's surface.

    They lie `depth` (n,) behind an edge with the normal `outwards`. Over each point runs the plane
    through the points of the `surface` (m, 3) nearest to its foot on the edge. The rise (n,) is NaN
    where they are far.
    """
    from scipy.spatial import cKDTree

    feet = points[:, :2] + depth[:, None] * outwards
    distance, nearest = cKDTree(surface[:, :2]).query(feet, NEAREST_POINTS)
    mean = surface[nearest].mean(axis=1)
    offset = surface[nearest] - mean[:, None]
    moments = offset.transpose(0, 2, 1) @ offset
    level = moments[:, :2, :2] + LEVELLING_M2 * np.eye(2)
    slopes = np.linalg.solve(level, moments[:, :2, 2:])[..., 0]
    z = mean[:, 2] + ((points[:, :2] - mean[:, :2]) * slopes).sum(axis=1)
    return np.where(distance[:, 0] <= NEAREST_M, points[:, 2] - z, np.nan)


def mark_overhang(depth: np.ndarray, rise: np.ndarray) -> np.ndarray:
    """Mark the points (n,) behind an edge that belong to an overhang.

    `rise` (n,) is how far they lie above the neighbour's surface, `depth` (n,) behind the edge.
    """
    is_on, is_below = np.abs(rise) < ON_PLANE_M, rise < -LEAST_DROP_M
    order = np.argsort(depth, kind="stable")
    order = order[np.isfinite(rise[order])]
    score_on = np.append(0, np.cumsum(2 * is_on[order] - 1))
    score_below = np.append(np.cumsum((2 * is_below[order] - 1)[::-1])[::-1], 0)
    count = int(np.argmax(score_on + score_below))
    if not 0 < count <= len(order) - FEWEST_BELOW:
        return np.zeros(len(depth), bool)
    end = depth[order[count - 1]]
    share = min(is_on[order[:count]].mean(), is_below[order[count:]].mean())
    is_overhang = share >= LEAST_OVERHANG_SHARE and end <= LONGEST_OVERHANG_M
    return is_overhang & (depth < end + END_BLUR_M) & (rise > -LEAST_DROP_M)
