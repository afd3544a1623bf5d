"""Exact distances from points to bounded planar polygons, on which all residual figures build.

The distance of a point to a polygon follows from that to its plane and, in the plane, that of the
foot of the perpendicular to the polygon, by GEOS. The plane distance bounds it from below, so
points are passed over whose plane distance is no less than the best so far.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from ..errors import InputError
from ..geometry.point_in_polygon import find_inside
from ..model import as_xyz

# (m, 3) vertices without the closing one; a polygon is a ring or a sequence of rings, the outer
# first, holes after.
Ring = np.ndarray

UPRIGHT = 1e-6  # The upward part of the normal of a polygon that is upright.


def point_surface_distances(
    points: np.ndarray,
    polygons: Sequence[Ring | Sequence[Ring]],
    at_most: np.ndarray | float = np.inf,
) -> np.ndarray:
    """Return the distance (n,) in metres of `points` (n, 3) to the polygons.

    It is that to the nearest of the bounded `polygons`, all in one frame, and `at_most` (m, one
    for all or each) where they are farther, or there are none. Raises InputError for arrays of
    another shape.

    >>> square = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]])
    >>> point_surface_distances(np.array([[1.0, 1, 3], [5, 1, 4]]), [square]).tolist()
    [3.0, 5.0]
    """
    points = as_xyz(points)
    nearest = np.broadcast_to(at_most, len(points)).astype(float)
    for rings, axes in list_faces(polygons):
        corner = rings[0][0]
        flat = (points - corner) @ axes.T
        near = np.flatnonzero(np.abs(flat[:, 2]) < nearest)
        polygon = make_polygon([(ring - corner) @ axes.T for ring in rings])
        beside = shapely.distance(polygon, shapely.points(flat[near, :2]))
        nearest[near] = np.minimum(nearest[near], np.hypot(beside, flat[near, 2]))
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
    for rings, axes in list_faces(polygons):
        if abs(axes[2, 2]) < UPRIGHT:
            continue
        over = np.flatnonzero(find_inside(make_polygon(rings), points[:, 0], points[:, 1]))
        gap = np.abs((points[over] - rings[0][0]) @ axes[2] / axes[2, 2])
        nearest[over] = np.minimum(nearest[over], gap)
    return nearest


def make_polygon(rings: list[Ring]) -> shapely.Polygon:
    """Make a polygon of the first two coordinates of rings, the outer one first."""
    outer, *holes = (ring[:, :2] for ring in rings)
    return shapely.Polygon(outer, holes)


def list_faces(
    polygons: Sequence[Ring | Sequence[Ring]],
) -> Iterator[tuple[list[Ring], np.ndarray]]:
    """Yield the rings of each polygon and its axes (3, 3), of which the last is its normal.

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
        yield rings, np.linalg.svd(rings[0] - rings[0][0], full_matrices=False)[2]
