"""Plan polygons put right: flattened, split, repaired. Nothing vanishes: what has no area becomes an empty polygon."""

from __future__ import annotations

import numpy as np
import shapely

SLIVER_SHARE = 0.01  # of a repaired footprint's area; smaller fragments are artefacts of the self-intersection
SLIVER_M2 = 0.5
DEGENERATE_M2 = 1e-6


def simple_polygons(geometry: shapely.Geometry | None) -> list[shapely.Polygon]:
    """The valid polygons of any geometry, heights left out; one empty polygon where it encloses no area.

    A self-intersecting polygon is repaired (its holes and loops kept as areas), and slivers of the repair dropped.

    >>> bow_tie = shapely.Polygon([(0, 0), (4, 4), (4, 0), (0, 4)])
    >>> sorted(p.area for p in simple_polygons(bow_tie))
    [4.0, 4.0]
    >>> simple_polygons(shapely.Point(1, 1))
    [<POLYGON EMPTY>]
    """
    flat = [polygon for member in polygons_in(geometry) for polygon in repaired(shapely.force_2d(member))]
    return flat or [shapely.Polygon()]


def polygons_in(geometry: shapely.Geometry | None) -> list[shapely.Polygon]:
    """Polygons of a geometry, those of multipolygons and collections one by one; points and lines are left out."""
    if geometry is None:
        return []
    parts = shapely.get_parts(geometry)
    if geometry.geom_type == "GeometryCollection":
        return [polygon for part in parts for polygon in polygons_in(part)]
    return [part for part in parts if part.geom_type == "Polygon" and not part.is_empty]


def repaired(polygon: shapely.Polygon) -> list[shapely.Polygon]:
    """`polygon` itself where it is valid, else the valid polygons that make_valid finds, without slivers."""
    if not shapely.get_coordinates(polygon).size or not shapely.is_valid(polygon):
        found = polygons_in(finite_make_valid(polygon))
    else:
        found = [polygon]
    total = sum(part.area for part in found)
    least = min(SLIVER_M2, SLIVER_SHARE * total)
    return [part for part in found if part.area > max(least if len(found) > 1 else 0.0, DEGENERATE_M2)]


def finite_make_valid(polygon: shapely.Polygon) -> shapely.Geometry | None:
    """make_valid, or None where the polygon has coordinates that are no numbers."""
    if not np.isfinite(shapely.get_coordinates(polygon)).all():
        return None
    return shapely.make_valid(polygon)
