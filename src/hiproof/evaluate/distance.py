"""Exact distances from points to bounded planar polygons. Compiled.

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
from ..geometry.flat_shell import FlatShell
from ..geometry.point_in_polygon import flips
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
    points = np.ascontiguousarray(as_xyz(points))
    return measure_distances(points, *list_faces(polygons))


def vertical_distances(points: np.ndarray, polygons: Sequence[Ring | Sequence[Ring]]) -> np.ndarray:
    """Return the least |dz| (n,) from `points` (n, 3) to the polygons.

    Polygons count that lie over or under the point; it is inf where none does.

    >>> square = np.array([[0.0, 0, 0], [2, 0, 2], [2, 2, 2], [0, 2, 0]])
    >>> vertical_distances(np.array([[1.0, 1, 3], [5, 1, 4]]), [square]).tolist()
    [2.0, inf]
    """
    points = np.ascontiguousarray(as_xyz(points))
    return measure_gaps(points, *list_faces(polygons))


def list_faces(polygons: Sequence[Ring | Sequence[Ring]]) -> tuple[np.ndarray, ...]:
    """Return the edges of all polygons, from and to (m, 3), their starts, and unit normals (f, 3).

    A normal is zero without area. Raises InputError for arrays of another shape.
    """
    rings, counts = [], [0]
    for polygon in polygons:
        single = isinstance(polygon, np.ndarray) and polygon.ndim == 2
        rings += [np.asarray(ring, float) for ring in ((polygon,) if single else polygon)]
        counts.append(len(rings))
    for ring in rings:
        if ring.ndim != 2 or ring.shape[1] != 3 or len(ring) < 3:
            raise InputError(
                f"expected rings of shape (m, 3) with at least 3 vertices, got {ring.shape}"
            )
    vertices = np.concatenate([np.zeros((0, 3)), *rings])
    ring_start = np.cumsum([0, *map(len, rings)])
    shell = FlatShell(vertices, np.arange(len(vertices)), ring_start, np.array(counts))
    normals = shell.areas[shell.face_start[:-1]]
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    is_flat = length >= LEAST_AREA_M2
    normals = np.where(is_flat, normals / np.where(is_flat, length, 1.0), 0.0)
    return vertices, vertices[shell.after], ring_start[shell.face_start], normals


@compiled
def measure_distances(points, starts, ends, first, normals):
    """Return the distance (n,) of points (n, 3) to the nearest face, those of `list_faces`."""
    nearest = np.full(len(points), np.inf)
    for f in range(len(normals)):
        a, b, c = normals[f]
        origin = starts[first[f]]
        for i in range(len(points)):
            x, y, z = points[i]
            height = a * (x - origin[0]) + b * (y - origin[1]) + c * (z - origin[2])
            if abs(height) >= nearest[i]:
                continue
            foot = (x - height * a, y - height * b, z - height * c)
            if holds(foot, starts, ends, first, f, np.argmax(np.abs(normals[f]))):
                nearest[i] = abs(height)
                continue
            for k in range(first[f], first[f + 1]):
                nearest[i] = min(nearest[i], measure_edge(points[i], starts[k], ends[k]))
    return nearest


@compiled
def measure_gaps(points, starts, ends, first, normals):
    """Return the least |dz| (n,) of points (n, 3) to faces over or under them."""
    nearest = np.full(len(points), np.inf)
    for f in range(len(normals)):
        a, b, c = normals[f]
        origin = starts[first[f]]
        if abs(c) < UPRIGHT:
            continue
        for i in range(len(points)):
            x, y, z = points[i]
            gap = abs((a * (x - origin[0]) + b * (y - origin[1])) / c + z - origin[2])
            if gap < nearest[i] and holds((x, y, z), starts, ends, first, f, 2):
                nearest[i] = gap
    return nearest


@compiled
def holds(place, starts, ends, first, f, axis):
    """Return whether face f holds a place, seen along an axis. It has an area there."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    inside = False
    for k in range(first[f], first[f + 1]):
        inside ^= flips(starts[k, u], starts[k, v], ends[k, u], ends[k, v], place[u], place[v])
    return inside


@compiled
def measure_edge(point, start, end):
    """Return the distance of a point (3,) to the edge between two."""
    dot, length2 = 0.0, 0.0
    for q in range(3):
        dot += (point[q] - start[q]) * (end[q] - start[q])
        length2 += (end[q] - start[q]) ** 2
    share = min(max(dot / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
    distance2 = 0.0
    for q in range(3):
        distance2 += (point[q] - start[q] - share * (end[q] - start[q])) ** 2
    return np.sqrt(distance2)
