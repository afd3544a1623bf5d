"""Geometries from WKB; surfaces in space, unknown to GEOS, become polygons' collections."""

from __future__ import annotations

import struct

import numpy as np
import shapely

POINT, LINE_TYPE, POLYGON_TYPE, MULTI_POLYGON, COLLECTION = 1, 2, 3, 6, 7
"""Kinds of geometry in the plan by their number in WKB (OGC 06-103r4, table 7)."""

POLYHEDRAL_SURFACE, TIN, TRIANGLE = 15, 16, 17
"""Kinds of surface in space by their number there."""

AS_POLYGONS = {POLYHEDRAL_SURFACE: MULTI_POLYGON, TIN: MULTI_POLYGON, TRIANGLE: POLYGON_TYPE}
"""Surfaces that are laid out in bytes as polygons are, and differ by their number alone."""

Z_FLAG, M_FLAG, SRID_FLAG = 1 << 31, 1 << 30, 1 << 29
"""Bits of the number in PostGIS's WKB; ISO adds 1000 for z, 2000 for m, 3000 for both."""


def decode_geometries(wkb: np.ndarray) -> np.ndarray:
    """Return geometries (n,) of WKB (n,), unclosed rings closed, None if unreadable."""
    decoded = np.array(
        [as_polygons(body) if body is not None else None for body in wkb], dtype=object
    )
    try:
        return shapely.from_wkb(decoded, on_invalid="fix")
    except (shapely.errors.ShapelyError, NotImplementedError, ValueError):
        return np.array([decode_geometry(body) for body in decoded], dtype=object)


def decode_geometry(body: bytes | None) -> shapely.Geometry | None:
    """Decode one geometry, None where it cannot be read."""
    try:
        return shapely.from_wkb(body, on_invalid="fix")
    except (shapely.errors.ShapelyError, NotImplementedError, ValueError):
        return None


def as_polygons(body: bytes) -> bytes:
    """Return WKB with polygons in place of faces of surfaces and of triangles.

    >>> body = bytearray(shapely.to_wkb(shapely.box(0, 0, 1, 1)))
    >>> body[1] = TRIANGLE
    >>> shapely.from_wkb(as_polygons(bytes(body))).geom_type
    'Polygon'
    """
    if len(body) < 5 or decode_kind(body, 0)[1] not in {*AS_POLYGONS, COLLECTION}:
        return body
    renamed = bytearray(body)
    try:
        rename(renamed, 0)
    except (struct.error, IndexError):  # cut short
        return body
    return bytes(renamed)


def decode_kind(body: bytes | bytearray, position: int) -> tuple[str, int, int, int]:
    """Return byte order, kind, dimensions and content's place of the geometry at `position`."""
    order = "<" if body[position] else ">"
    (code,) = struct.unpack_from(f"{order}I", body, position + 1)
    iso, kind = divmod(code & ~(Z_FLAG | M_FLAG | SRID_FLAG), 1000)
    has_z, has_m = bool(code & Z_FLAG) or iso in (1, 3), bool(code & M_FLAG) or iso in (2, 3)
    return order, kind, 2 + has_z + has_m, position + (9 if code & SRID_FLAG else 5)


def rename(body: bytearray, position: int) -> int:
    """Rename the surfaces within the geometry at byte `position`; the byte after it."""
    order, kind, dimensions, start = decode_kind(body, position)
    (code,) = struct.unpack_from(f"{order}I", body, position + 1)
    struct.pack_into(f"{order}I", body, position + 1, code - kind + AS_POLYGONS.get(kind, kind))
    if kind == POINT:
        return start + 8 * dimensions
    (count,) = struct.unpack_from(f"{order}I", body, start)
    start += 4
    if kind == LINE_TYPE:
        return start + 8 * dimensions * count
    for _ in range(count):
        if kind in (POLYGON_TYPE, TRIANGLE):
            (points,) = struct.unpack_from(f"{order}I", body, start)
            start += 4 + 8 * dimensions * points
        else:
            start = rename(body, start)
    return start
