"""Rings and areas: overlays on a grid, repair, direction and size."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from .flat_shell import FlatShell

# of coordinates (m) where polygons are overlaid: on a grid no overlay fails, nor loses a polygon
# whose sides all but lie on a neighbour's, as GEOS 3.14 does without one
OVERLAY_GRID_M = 1e-6


def repair_polygons(polygons: Any) -> Any:
    """Return valid areas that the rings of one or several polygons enclose.

    Crossing and touching rings are resolved. A spike without width encloses nothing.

    >>> repair_polygons(shapely.Polygon([(0, 0), (2, 0), (2, 1), (3, 1), (2, 1), (2, 2), (0,
    ...     2)])).area
    4.0
    """
    return shapely.make_valid(polygons, method="structure", keep_collapsed=False)


def clockwise(polygon: shapely.Polygon) -> shapely.Polygon:
    """Return the polygon with a clockwise outer ring and counter-clockwise holes.

    >>> clockwise(shapely.Polygon([(0, 0), (1, 0), (1, 1)])).exterior.is_ccw
    False
    """
    return shapely.orient_polygons(polygon, exterior_cw=True)


def counterclockwise(ring: shapely.LinearRing) -> np.ndarray:
    """Return the coordinates (n + 1, 2) of a ring, counter-clockwise.

    The first corner is repeated at the end.

    >>> counterclockwise(shapely.LinearRing([(0, 0), (0, 1), (1, 1)])).tolist()
    [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]]
    """
    return shapely.get_coordinates(ring)[:: 1 if shapely.is_ccw(ring) else -1]


def ring_edges(area: shapely.Geometry) -> tuple[np.ndarray, np.ndarray]:
    """Return starts and ends (m, 2) of all edges of one or several polygons."""
    rings = shapely.get_rings(shapely.get_parts(area))
    xy, ring_number = shapely.get_coordinates(rings, return_index=True)
    follows = ring_number[1:] == ring_number[:-1]
    return xy[:-1][follows], xy[1:][follows]


def with_area(geometry: shapely.Geometry) -> shapely.Geometry:
    """Keep the parts of a geometry that have an area.

    An intersection of areas that only touch has lines and points, which later intersections refuse.

    >>> one, other = shapely.box(0, 0, 2, 2), shapely.Polygon([(1, 0), (3, 0), (3, 4), (2, 4), (2,
    ...     1), (1, 1)])
    >>> shapely.intersection(one, other).geom_type, with_area(shapely.intersection(one, other)).area
    ('GeometryCollection', 1.0)
    """
    polygons = [part for part in shapely.get_parts(geometry) if part.geom_type == "Polygon"]
    return polygons[0] if len(polygons) == 1 else shapely.MultiPolygon(polygons)


def intersect(
    area: shapely.Geometry, other: shapely.Geometry, grid_m: float = OVERLAY_GRID_M
) -> shapely.Geometry:
    """Return what lies in both areas."""
    return with_area(shapely.intersection(area, other, grid_size=grid_m))


def subtract(
    area: shapely.Geometry, other: shapely.Geometry, grid_m: float = OVERLAY_GRID_M
) -> shapely.Geometry:
    """Return what lies in an area and not in the other."""
    return with_area(shapely.difference(area, other, grid_size=grid_m))


def join(
    area: shapely.Geometry, other: shapely.Geometry, grid_m: float = OVERLAY_GRID_M
) -> shapely.Geometry:
    """Return what lies in an area or in the other."""
    return with_area(shapely.union(area, other, grid_size=grid_m))


def unite(areas: Any, grid_m: float = OVERLAY_GRID_M) -> shapely.Geometry:
    """Return what lies in any of the `areas` (n,)."""
    return with_area(shapely.union_all(areas, grid_size=grid_m))


def list_between(
    start: Sequence[float] | np.ndarray,
    end: Sequence[float] | np.ndarray,
    places: np.ndarray,
    reach: float,
) -> np.ndarray:
    """Return which of `places` (n, d) lie on an edge, in its order.

    They are within `reach` of it, and farther than that from its ends.

    >>> places = np.array([[3.0, 0.0], [1.0, 0.0], [2.0, 1.0], [0.0, 0.0]])
    >>> list_between(np.zeros(2), np.array([4.0, 0.0]), places, 0.1).tolist()
    [1, 0]
    """
    along, offset = np.subtract(end, start), places - start
    length = float(np.linalg.norm(along))
    if length <= 2.0 * reach:
        return np.empty(0, int)
    t = offset @ along / length
    aside = np.linalg.norm(offset - np.outer(t / length, along), axis=1)
    is_on = (t > reach) & (t < length - reach) & (aside <= reach)
    return np.flatnonzero(is_on)[np.argsort(t[is_on])]


def ring_normal(ring: np.ndarray) -> np.ndarray:
    """Return the vector area (3,) of a ring (m, 3), first vertex once."""
    return ring_normals([ring])[0]


def ring_normals(rings: Sequence[np.ndarray]) -> np.ndarray:
    """Return the vector areas (n, 3) of n rings, each as from `ring_normal`."""
    vertices, start = np.concatenate(rings), np.cumsum([0, *map(len, rings)])
    return FlatShell(vertices, np.arange(len(vertices)), start, np.arange(len(start))).areas
