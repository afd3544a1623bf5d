"""Exact distances from points to bounded planar polygons, compiled.

All residual figures build on them.

The distance of a point to a polygon is the distance to its plane where the foot of the
perpendicular lies inside the polygon, else the distance to the nearest edge. The plane distance
bounds both from below, so a polygon whose plane is farther than the best distance so far is
skipped.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..compiled import compiled
from ..errors import InputError
from ..geometry.point_in_polygon import flips
from ..model import as_xyz

Ring = np.ndarray
"""(m, 3) vertices without the closing one; a polygon is a ring or a sequence of rings, the outer
first, holes after.
"""


def point_surface_distances(
    points: np.ndarray, polygons: Sequence[Ring | Sequence[Ring]]
) -> np.ndarray:
    """Return the distance (n,) in metres of `points` (n, 3) to the polygons.

    It is that to the nearest of the bounded `polygons`, all in one frame.

    inf without polygons. Raises InputError for arrays of another shape.

    >>> square = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]])
    >>> point_surface_distances(np.array([[1.0, 1, 3], [5, 1, 4]]), [square]).tolist()
    [3.0, 5.0]
    """
    points = checked_points(points)
    return nearest_distances(points, *flatten_polygons(polygons))


def vertical_distances(points: np.ndarray, polygons: Sequence[Ring | Sequence[Ring]]) -> np.ndarray:
    """Return the least |dz| (n,) from `points` (n, 3) to the polygons.

    Polygons count that lie over or under the point; it is inf where none does.

    >>> square = np.array([[0.0, 0, 0], [2, 0, 2], [2, 2, 2], [0, 2, 0]])
    >>> vertical_distances(np.array([[1.0, 1, 3], [5, 1, 4]]), [square]).tolist()
    [2.0, inf]
    """
    points = checked_points(points)
    return vertical_gaps(points, *flatten_polygons(polygons))


def surface_and_vertical_distances(
    points: np.ndarray, polygons: Sequence[Ring | Sequence[Ring]]
) -> tuple[np.ndarray, np.ndarray]:
    """Return surface distances and vertical distances of the same points.

    They are as from `point_surface_distances` and `vertical_distances`.
    """
    points, flat = checked_points(points), flatten_polygons(polygons)
    return nearest_distances(points, *flat), vertical_gaps(points, *flat)


def checked_points(points: np.ndarray) -> np.ndarray:
    """Convert points to the form that compiled code takes."""
    return np.ascontiguousarray(as_xyz(points))


def flatten_polygons(
    polygons: Sequence[Ring | Sequence[Ring]],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return all vertices (m, 3), ring starts and polygon starts.

    Rings start in the vertices, polygons in the rings (both with the end).
    """
    rings: list[np.ndarray] = []
    polygon_start = [0]
    for polygon in polygons:
        single = isinstance(polygon, np.ndarray) and polygon.ndim == 2
        for ring in (polygon,) if single else polygon:
            ring = np.asarray(ring, float)
            if ring.ndim != 2 or ring.shape[1] != 3 or len(ring) < 3:
                raise InputError(
                    f"expected rings of shape (m, 3) with at least 3 vertices, got {ring.shape}"
                )
            rings.append(ring)
        polygon_start.append(len(rings))
    vertices = np.concatenate(rings) if rings else np.empty((0, 3))
    ring_start = np.concatenate([[0], np.cumsum([len(ring) for ring in rings])]).astype(np.int64)
    return np.ascontiguousarray(vertices), ring_start, np.array(polygon_start, np.int64)


@compiled
def nearest_distances(points, vertices, ring_start, polygon_start):
    """Return the distance (n,) of each point (n, 3) to the nearest polygon.

    Polygons are as from `flatten_polygons`.
    """
    nearest = np.full(points.shape[0], np.inf)
    for polygon in range(polygon_start.shape[0] - 1):
        rings = ring_start[polygon_start[polygon] : polygon_start[polygon + 1] + 1]
        normal, origin, is_flat = fit_ring_plane(vertices, rings)
        first, second = plan_axes(normal)
        for i in range(points.shape[0]):
            p = points[i]
            height = 0.0
            if is_flat:
                height = (
                    (p[0] - origin[0]) * normal[0]
                    + (p[1] - origin[1]) * normal[1]
                    + (p[2] - origin[2]) * normal[2]
                )
                if abs(height) >= nearest[i]:
                    continue
                x, y = p[first] - height * normal[first], p[second] - height * normal[second]
                if contains(vertices, rings, first, second, x, y):
                    nearest[i] = abs(height)
                    continue
            nearest[i] = min(nearest[i], edge_distance(vertices, rings, p))
    return nearest


@compiled
def vertical_gaps(points, vertices, ring_start, polygon_start):
    """Return the least height (n,) between points (n, 3) and polygons.

    Polygons count that lie over or under the point; it is inf where there is none.
    """
    nearest = np.full(points.shape[0], np.inf)
    for polygon in range(polygon_start.shape[0] - 1):
        rings = ring_start[polygon_start[polygon] : polygon_start[polygon + 1] + 1]
        normal, origin, is_flat = fit_ring_plane(vertices, rings)
        if not is_flat or abs(normal[2]) < 1e-6:
            continue
        for i in range(points.shape[0]):
            x, y = points[i, 0], points[i, 1]
            height = (
                origin[2] - ((x - origin[0]) * normal[0] + (y - origin[1]) * normal[1]) / normal[2]
            )
            gap = abs(points[i, 2] - height)
            if gap < nearest[i] and contains(vertices, rings, 0, 1, x, y):
                nearest[i] = gap
    return nearest


@compiled
def fit_ring_plane(vertices, rings):
    """Return unit normal (Newell) and centroid of the outer ring.

    The flag is false for a ring without area.
    """
    origin, normal = np.zeros(3), np.zeros(3)
    begin, end = rings[0], rings[1]
    for i in range(begin, end):
        origin += vertices[i]
    origin /= end - begin
    for i in range(begin, end):
        a = vertices[i] - origin
        b = vertices[i + 1 if i + 1 < end else begin] - origin
        normal[0] += a[1] * b[2] - a[2] * b[1]
        normal[1] += a[2] * b[0] - a[0] * b[2]
        normal[2] += a[0] * b[1] - a[1] * b[0]
    length = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    if length < 1e-12:
        return normal, origin, False
    return normal / length, origin, True


@compiled
def plan_axes(normal):
    """Return the two axes onto which a polygon projects with most area.

    `normal` is the polygon's.
    """
    largest = np.argmax(np.abs(normal))
    return (largest + 1) % 3, (largest + 2) % 3


@compiled
def contains(vertices, rings, first, second, x, y):
    """Return whether a place is inside by the even-odd rule over all rings.

    Holes are outside. A point on a shared edge belongs to one side only.
    """
    inside = False
    for ring in range(rings.shape[0] - 1):
        j = rings[ring + 1] - 1
        for i in range(rings[ring], rings[ring + 1]):
            if flips(
                vertices[i, first],
                vertices[i, second],
                vertices[j, first],
                vertices[j, second],
                x,
                y,
            ):
                inside = not inside
            j = i
    return inside


@compiled
def edge_distance(vertices, rings, p):
    """Return the distance of the point `p` (3,) to the nearest edge of all rings."""
    nearest_squared = np.inf
    for ring in range(rings.shape[0] - 1):
        j = rings[ring + 1] - 1
        for i in range(rings[ring], rings[ring + 1]):
            ex = vertices[i, 0] - vertices[j, 0]
            ey = vertices[i, 1] - vertices[j, 1]
            ez = vertices[i, 2] - vertices[j, 2]
            dx, dy, dz = p[0] - vertices[j, 0], p[1] - vertices[j, 1], p[2] - vertices[j, 2]
            length_squared = ex * ex + ey * ey + ez * ez
            t = 0.0
            if length_squared > 0.0:
                t = min(1.0, max(0.0, (dx * ex + dy * ey + dz * ez) / length_squared))
            squared = (dx - t * ex) ** 2 + (dy - t * ey) ** 2 + (dz - t * ez) ** 2
            nearest_squared = min(nearest_squared, squared)
            j = i
    return np.sqrt(nearest_squared)
