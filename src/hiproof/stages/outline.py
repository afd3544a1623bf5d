"""Outlines to fit over: one valid polygon, without needless vertices."""

from __future__ import annotations

import itertools
import math

import numpy as np
import shapely

from ..frames import LocalFrame
from ..geometry.rings import repair_polygons

# Of an outline that roofs are fitted over; the time grows with the square of them, and a building
# has no more corners.
MOST_OUTLINE_VERTICES = 500

# Of an outline of thousands that are simplified at once: teeth take Douglas and Peucker the square
# of them.
PIECE_VERTICES = 64


def largest_polygon(geometry: shapely.Geometry) -> shapely.Polygon:
    """Return the largest polygon of a geometry made valid, empty where there is none."""
    geometry = geometry if geometry.is_valid else repair_polygons(geometry)
    if geometry.geom_type == "Polygon":
        return geometry
    polygons = [g for g in shapely.get_parts(geometry) if g.geom_type == "Polygon"]
    return max(polygons, key=lambda polygon: polygon.area, default=shapely.Polygon())


def to_local(outline: shapely.Polygon | None, frame: LocalFrame) -> shapely.Polygon | None:
    return None if outline is None else shapely.transform(outline, frame.to_local)


def without_needless_vertices(
    outline: shapely.Polygon | None,
) -> tuple[shapely.Polygon | None, str]:
    """Return the outline to fit over, and what was left out.

    Of more than MOST_OUTLINE_VERTICES those within 1 cm of the line between their neighbours
    (Douglas and Peucker) go, or within 2, 4, 8 cm, ... until no more are left, and with them
    courtyards narrower than that.
    """
    if outline is None or (count := shapely.get_num_coordinates(outline)) <= MOST_OUTLINE_VERTICES:
        return outline, ""
    whole = largest_polygon(outline)
    simple, tolerance_m = whole, 0.005
    while shapely.get_num_coordinates(simple) > MOST_OUTLINE_VERTICES:
        tolerance_m *= 2
        courtyards = [
            ring for ring in whole.interiors if shapely.Polygon(ring).area > tolerance_m**2
        ]
        simple = largest_polygon(
            simplify_outline(shapely.Polygon(whole.exterior, courtyards), tolerance_m)
        )
    remainder = shapely.get_num_coordinates(simple)
    apart_m = shapely.distance(
        shapely.points(shapely.get_coordinates(whole.exterior)), simple.exterior
    ).max()
    if len(simple.interiors) < len(whole.interiors):
        apart_m = max(apart_m, tolerance_m)
    return (
        simple,
        f"its outline of {count} vertices was simplified to {remainder}, within {apart_m:.2g} m",
    )


def simplify_outline(polygon: shapely.Polygon, tolerance_m: float) -> shapely.Polygon:
    """Simplify by Douglas and Peucker, thousands of vertices by pieces: time is quadratic."""
    rings = []
    for ring in (polygon.exterior, *polygon.interiors):
        previous, xy = math.inf, shapely.get_coordinates(ring)
        while MOST_OUTLINE_VERTICES < len(xy) < 0.9 * previous:
            previous, xy = len(xy), simplify_in_pieces(xy, tolerance_m)
        rings.append(xy)
    outer, *holes = [ring if len(ring) >= 4 else None for ring in rings]
    if outer is None:
        return polygon
    rough = shapely.Polygon(outer, [hole for hole in holes if hole is not None])
    if shapely.get_num_coordinates(rough) > 2 * MOST_OUTLINE_VERTICES:
        return rough
    return shapely.simplify(rough, tolerance_m, preserve_topology=False)


def simplify_in_pieces(xy: np.ndarray, tolerance_m: float) -> np.ndarray:
    """Simplify a ring's coordinates (n, 2) in pieces of PIECE_VERTICES edges."""
    ends = np.append(np.arange(0, len(xy) - 2, PIECE_VERTICES), len(xy) - 1)
    vertices = np.concatenate(
        [np.arange(first, last + 1) for first, last in itertools.pairwise(ends)]
    )
    pieces = shapely.linestrings(
        xy[vertices], indices=np.repeat(np.arange(len(ends) - 1), np.diff(ends) + 1)
    )
    simple, piece = shapely.get_coordinates(
        shapely.simplify(pieces, tolerance_m, preserve_topology=False), return_index=True
    )
    # each piece begins where the one before it ends
    return simple[np.append(piece[1:] == piece[:-1], True)]
