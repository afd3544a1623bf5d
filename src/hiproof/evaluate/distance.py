"""Exact distances from points to bounded planar polygons.

All residual figures build on them.

The distance of a point to a polygon is the distance to its plane where the foot of the
perpendicular lies inside the polygon, else the distance to the nearest edge. The plane distance
bounds both from below, so a polygon whose plane is farther than the best distance so far is
skipped.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from ..errors import InputError
from ..geometry.point_in_polygon import find_inside
from ..geometry.rings import ring_normal
from ..model import as_xyz

# (m, 3) vertices without the closing one; a polygon is a ring or a sequence of rings, the outer
# first, holes after.
Ring = np.ndarray


def point_surface_distances(
    points: np.ndarray, polygons: Sequence[Ring | Sequence[Ring]]
) -> np.ndarray:
    """Return the distance (n,) in metres of `points` (n, 3) to the polygons.

    It is that to the nearest of the bounded `polygons`, all in one frame. inf without polygons.
    Raises InputError for arrays of another shape.

    >>> square = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]])
    >>> point_surface_distances(np.array([[1.0, 1, 3], [5, 1, 4]]), [square]).tolist()
    [3.0, 5.0]
    """
    points = as_xyz(points)
    nearest = np.full(len(points), np.inf)
    for rings in list_polygons(polygons):
        normal, origin, near = *fit_ring_plane(rings[0]), np.arange(len(points))
        if normal.any():
            heights = (points - origin) @ normal
            near = np.flatnonzero(np.abs(heights) < nearest)
            heights = heights[near]
            feet = points[near] - heights[:, None] * normal
            kept = np.arange(3) != np.abs(normal).argmax()
            inside = contains(rings, kept, feet)
            nearest[near[inside]] = np.abs(heights[inside])
            near = near[~inside]
        for ring in rings:
            for start, end in zip(ring, np.roll(ring, -1, axis=0), strict=True):
                nearest[near] = np.minimum(nearest[near], edge_distance(points[near], start, end))
    return nearest


def vertical_distances(points: np.ndarray, polygons: Sequence[Ring | Sequence[Ring]]) -> np.ndarray:
    """Return the least |dz| (n,) from `points` (n, 3) to the polygons.

    Polygons count that lie over or under the point; it is inf where none does.

    >>> square = np.array([[0.0, 0, 0], [2, 0, 2], [2, 2, 2], [0, 2, 0]])
    >>> vertical_distances(np.array([[1.0, 1, 3], [5, 1, 4]]), [square]).tolist()
    [2.0, inf]
    """
    points = as_xyz(points)
    nearest = np.full(len(points), np.inf)
    for rings in list_polygons(polygons):
        normal, origin = fit_ring_plane(rings[0])
        if abs(normal[2]) < 1e-6:
            continue
        gaps = np.abs((points - origin) @ normal / normal[2])
        near = np.flatnonzero(gaps < nearest)
        near = near[contains(rings, np.array([True, True, False]), points[near])]
        nearest[near] = gaps[near]
    return nearest


def list_polygons(polygons: Sequence[Ring | Sequence[Ring]]) -> list[list[np.ndarray]]:
    """Return the rings of each polygon. Raises InputError for arrays of another shape."""
    result = []
    for polygon in polygons:
        single = isinstance(polygon, np.ndarray) and polygon.ndim == 2
        rings = [np.asarray(ring, float) for ring in ((polygon,) if single else polygon)]
        for ring in rings:
            if ring.ndim != 2 or ring.shape[1] != 3 or len(ring) < 3:
                raise InputError(
                    f"expected rings of shape (m, 3) with at least 3 vertices, got {ring.shape}"
                )
        result.append(rings)
    return result


def fit_ring_plane(ring: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return unit normal (Newell, zero without area) and centroid of a ring."""
    normal = ring_normal(ring)
    length = np.linalg.norm(normal)
    return (normal / length if length >= 1e-12 else np.zeros(3)), ring.mean(axis=0)


def contains(rings: list[np.ndarray], kept: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return whether points (n, 3) lie in a polygon with holes, seen along the dropped axis."""
    outer, *holes = (ring[:, kept] for ring in rings)
    return find_inside(shapely.Polygon(outer, holes), *points[:, kept].T)


def edge_distance(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the distance of points (n, 3) to an edge."""
    along, off = end - start, points - start
    share = np.clip(off @ along / max(float(along @ along), np.finfo(float).tiny), 0.0, 1.0)
    return np.linalg.norm(off - share[:, None] * along, axis=1)
