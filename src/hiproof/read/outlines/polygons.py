"""Plan polygons put right: flattened, split, repaired; what has no area becomes empty.

Surfaces in WKB that GEOS does not know become collections of polygons.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import Any

import numpy as np
import shapely

from ...geometry.rings import repair_polygons
from ..plausible import is_plausible

Layer = str | int | None  # of a file, by name or number; None for its only one

# Metadata (fields and crs), feature numbers, geometries and columns of a layer.
Features = tuple[dict[str, Any], np.ndarray, np.ndarray, list[np.ndarray]]

# of a repaired footprint's area; smaller fragments are artefacts of the self-intersection
SLIVER_SHARE = 0.01
SLIVER_M2 = 0.5  # m2; what repairing a polygon leaves beside it, less than any building
JOIN_M = 0.001  # m; faces of one body that are as far apart were one before they were rounded
LEVEL_SHARE = 0.01  # units of height that a flat outline's heights may differ by
DEGENERATE_M2 = 1e-6  # m2; a smaller area is rounding
# beyond any building; what is kept of terrain around one grows with the square of it
WIDEST_BUILDING_M = 4000.0
MOST_MEETINGS = 20_000  # of edges that follow not on one another: mending takes time for each
EDGES_A_LOOK = 256  # edges looked up at once: memory stays small for outlines of any length


def simple_polygons(
    geometry: shapely.Geometry | None, is_body: bool = False
) -> list[shapely.Polygon]:
    """Return the valid polygons of any geometry, without heights.

    One empty polygon stands for a geometry that encloses no area. A self-intersecting polygon is
    repaired (its holes and loops kept as areas), and slivers of the repair dropped. Polygons that
    overlap are one, and so are all that touch where they are faces of a body.

    >>> bow_tie = shapely.Polygon([(0, 0), (4, 4), (4, 0), (0, 4)])
    >>> sorted(p.area for p in simple_polygons(bow_tie))
    [4.0, 4.0]
    >>> simple_polygons(shapely.Point(1, 1))
    [<POLYGON EMPTY>]
    """
    members = [shapely.force_2d(member) for member in polygons_in(geometry)]
    if is_body:  # walls stand on a line
        members = [member for member in members if member.area > DEGENERATE_M2]
    flat = [polygon for member in members for polygon in repair_polygon(member)]
    if is_body or overlap(flat):
        flat = unite_polygons(flat)
    return flat or [shapely.Polygon()]


def is_surface(geometry: shapely.Geometry | None) -> bool:
    """Return whether a geometry has several polygons that do not lie at one height."""
    if (
        geometry is None
        or not shapely.has_z(geometry)
        or len(polygons := polygons_in(geometry)) < 2
    ):
        return False
    z = shapely.get_coordinates(polygons, include_z=True)[:, 2]
    z = z[np.isfinite(z)]
    return len(z) > 0 and float(np.ptp(z)) > LEVEL_SHARE


def overlap(polygons: list[shapely.Polygon]) -> bool:
    """Return whether any two valid polygons share more than a border."""
    if len(polygons) < 2:
        return False
    first, second = shapely.STRtree(polygons).query(polygons, predicate="intersects")
    pairs = np.array(polygons)[np.stack([first, second])[:, first < second]]
    return bool((shapely.area(shapely.intersection(*pairs)) > DEGENERATE_M2).any())


def unite_polygons(polygons: list[shapely.Polygon]) -> list[shapely.Polygon]:
    """Return the union of polygons without the hairline gaps that rounding leaves."""
    whole = shapely.simplify(shapely.union_all(polygons, grid_size=JOIN_M), JOIN_M)
    return [
        shapely.Polygon(
            part.exterior,
            [hole for hole in part.interiors if shapely.Polygon(hole).area > SLIVER_M2],
        )
        for part in polygons_in(whole)
        if part.area > SLIVER_M2
    ]


def polygons_in(geometry: shapely.Geometry | None) -> list[shapely.Polygon]:
    """Return the polygons of a geometry and its collections, without points and lines."""
    if geometry is None:
        return []
    parts = shapely.get_parts(geometry)
    if geometry.geom_type == "GeometryCollection":
        return [polygon for part in parts for polygon in polygons_in(part)]
    return [part for part in parts if part.geom_type == "Polygon" and not part.is_empty]


def repair_polygon(polygon: shapely.Polygon) -> list[shapely.Polygon]:
    """Return `polygon`, or the valid polygons that make_valid finds in it.

    Slivers are left out. There are none where it is no building's: without numbers, wider than
    WIDEST_M, or tangled beyond MOST_MEETINGS.
    """
    if not is_buildings_size(polygon):
        return []
    if shapely.is_valid(polygon):
        result = [polygon]
    elif meetings(polygon) > MOST_MEETINGS:
        return []
    else:  # the area that its rings enclose; what they enclose twice counts once
        result = polygons_in(repair_polygons(polygon))
    smallest = min(SLIVER_M2, SLIVER_SHARE * sum(part.area for part in result))
    return [part for part in result if part.area > max(smallest, DEGENERATE_M2)]


def is_buildings_size(polygon: shapely.Polygon) -> bool:
    """Return whether all coordinates are on this Earth, no farther apart than buildings."""
    xy = shapely.get_coordinates(polygon)
    return len(xy) > 0 and bool(
        is_plausible(xy).all() and np.ptp(xy, axis=0).max() <= WIDEST_BUILDING_M
    )


def meetings(polygon: shapely.Polygon) -> int:
    """Count pairs of edges whose boxes meet, without neighbours, to a little over the most."""
    xy, ring = shapely.get_coordinates(shapely.get_rings(polygon), return_index=True)
    edges = shapely.linestrings(np.stack([xy[:-1], xy[1:]], axis=1)[ring[:-1] == ring[1:]])
    tree, count = shapely.STRtree(edges), 0
    for start in range(0, len(edges), EDGES_A_LOOK):
        first, second = tree.query(edges[start : start + EDGES_A_LOOK])
        count += int((second > first + start + 1).sum())
        if count > MOST_MEETINGS:
            break
    return count


# Kinds of geometry in the plan by their number in WKB (OGC 06-103r4, table 7).
POINT, LINE_TYPE, POLYGON_TYPE, MULTI_POLYGON, COLLECTION = 1, 2, 3, 6, 7

POLYHEDRAL_SURFACE, TIN, TRIANGLE = 15, 16, 17  # kinds of surface in space by their number there

# Surfaces that are laid out in bytes as polygons are, and differ by their number alone.
AS_POLYGONS = {POLYHEDRAL_SURFACE: MULTI_POLYGON, TIN: MULTI_POLYGON, TRIANGLE: POLYGON_TYPE}

# Bits of the number in PostGIS's WKB; ISO adds 1000 for z, 2000 for m, 3000 for both.
Z_FLAG, M_FLAG, SRID_FLAG = 1 << 31, 1 << 30, 1 << 29


def decode_geometries(wkb: Iterable[bytes | None]) -> np.ndarray:
    """Return geometries (n,) of WKB (n,), unclosed rings closed, None if unreadable."""
    bodies = [body and as_polygons(body) for body in wkb]
    geometries = np.empty(len(bodies), object)
    try:
        geometries[:] = shapely.from_wkb(np.array(bodies, object), on_invalid="fix")
    except (shapely.errors.ShapelyError, NotImplementedError, ValueError):
        if len(bodies) > 1:
            geometries[:] = [decode_geometries([body])[0] for body in bodies]
    return geometries


def as_polygons(body: bytes) -> bytes:
    """Return WKB with polygons in place of faces of surfaces and of triangles.

    >>> body = bytearray(shapely.to_wkb(shapely.box(0, 0, 1, 1)))
    >>> body[1] = TRIANGLE
    >>> shapely.from_wkb(as_polygons(bytes(body))).geom_type
    'Polygon'
    """
    renamed = bytearray(body)
    try:
        rename(renamed, 0)
    except (struct.error, IndexError):  # cut short, or of a kind without points in a row
        return body
    return bytes(renamed)


def rename(body: bytearray, position: int) -> int:
    """Rename the surfaces within the geometry at byte `position`; the byte after it."""
    number = struct.Struct("<I" if body[position] else ">I")
    (code,) = number.unpack_from(body, position + 1)
    iso, kind = divmod(code & ~(Z_FLAG | M_FLAG | SRID_FLAG), 1000)
    if kind > COLLECTION and kind not in AS_POLYGONS:
        raise IndexError(f"no geometry of points, lines and polygons: {kind}")
    number.pack_into(body, position + 1, code - kind + AS_POLYGONS.get(kind, kind))
    has_z, has_m = bool(code & Z_FLAG) or iso in (1, 3), bool(code & M_FLAG) or iso in (2, 3)
    point_bytes, start = 8 * (2 + has_z + has_m), position + (9 if code & SRID_FLAG else 5)
    if kind == POINT:
        return start + point_bytes
    (count,) = number.unpack_from(body, start)
    start += 4
    if kind == LINE_TYPE:
        return start + point_bytes * count
    for _ in range(count):
        if kind in (POLYGON_TYPE, TRIANGLE):
            start += 4 + point_bytes * number.unpack_from(body, start)[0]
        else:
            start = rename(body, start)
    return start
