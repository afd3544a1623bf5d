"""Exact distances from points to bounded planar polygons, on which all residual figures build.

The distance of a point to a polygon follows from that to its plane and, in the plane, that of the
foot of the perpendicular to the polygon. The plane distance bounds it from below, so points are
passed over whose plane distance is no less than the best so far.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from ..errors import InputError
from ..geometry.point_in_polygon import find_inside
from ..geometry.rings import ring_normal
from ..model import as_xyz

# (m, 3) vertices without the closing one; a polygon is a ring or a sequence of rings, the outer
# first, holes after.
Ring = np.ndarray

LEAST_AREA_M2 = 1e-12  # A polygon with less area counts as its edges.
UPRIGHT = 1e-6  # The upward part of the normal of a polygon that is upright.


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
    for rings, normal in list_faces(polygons):
        height = (points - rings[0][0]) @ normal
        near = np.flatnonzero(np.abs(height) < nearest)
        feet = points[near] - height[near, None] * normal
        inside = find_over(rings, int(np.abs(normal).argmax()), feet)
        nearest[near[inside]] = np.abs(height[near[inside]])
        beside = np.delete(near, inside)
        nearest[beside] = np.minimum(nearest[beside], measure_edges(points[beside], rings))
    return nearest


def vertical_distances(points: np.ndarray, polygons: Sequence[Ring | Sequence[Ring]]) -> np.ndarray:
    """Return the least |dz| (n,) from `points` (n, 3) to the polygons.

    Polygons count that lie over or under the point; it is inf where none does.

    >>> square = np.array([[0.0, 0, 0], [2, 0, 2], [2, 2, 2], [0, 2, 0]])
    >>> vertical_distances(np.array([[1.0, 1, 3], [5, 1, 4]]), [square]).round(6).tolist()
    [2.0, inf]
    """
    points = as_xyz(points)
    nearest = np.full(len(points), np.inf)
    for rings, normal in list_faces(polygons):
        if abs(normal[2]) < UPRIGHT:
            continue
        over = find_over(rings, 2, points)
        gap = np.abs((points[over] - rings[0][0]) @ normal / normal[2])
        nearest[over] = np.minimum(nearest[over], gap)
    return nearest


def find_over(rings: list[Ring], axis: int, points: np.ndarray) -> np.ndarray:
    """Return which of `points` (n, 3) the rings hold, seen along an axis."""
    outer, *holes = (np.delete(ring, axis, axis=1) for ring in rings)
    return np.flatnonzero(
        find_inside(shapely.Polygon(outer, holes), *np.delete(points, axis, axis=1).T)
    )


def measure_edges(points: np.ndarray, rings: list[Ring]) -> np.ndarray:
    """Return the distances (n,) of points (n, 3) to the nearest edge of the rings."""
    start = np.concatenate(rings)
    along = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings]) - start
    length2 = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    off = points[:, None] - start
    share = np.clip(np.einsum("nmk,mk->nm", off, along) / length2, 0.0, 1.0)
    return np.linalg.norm(off - share[:, :, None] * along, axis=2).min(axis=1)


def list_faces(
    polygons: Sequence[Ring | Sequence[Ring]],
) -> Iterator[tuple[list[Ring], np.ndarray]]:
    """Yield the rings of each polygon and its unit normal (3,), zero without area.

    Raises InputError for arrays of another shape.
    """
    for polygon in polygons:
        single = isinstance(polygon, np.ndarray) and polygon.ndim == 2
        rings = [np.asarray(ring, float) for ring in ((polygon,) if single else polygon)]
        for ring in rings:
            if ring.ndim != 2 or ring.shape[1] != 3 or len(ring) < 3:
                raise InputError(
                    f"expected rings of shape (m, 3) with at least 3 vertices, got {ring.shape}"
                )
        normal = ring_normal(rings[0])
        length = np.linalg.norm(normal)
        yield rings, normal / length if length >= LEAST_AREA_M2 else np.zeros(3)
