"""What regions of parts have in common: polygons, what touches, what covers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import shapely

from ...geometry.rings import intersect, unite
from ...model import Part, Piece

# Polygons further apart (m) do not touch after rounding to the grid of overlays.
OVERLAY_GAP_M = 1e-5


def list_polygons(geometry: shapely.Geometry) -> list[shapely.Polygon]:
    parts = getattr(geometry, "geoms", (geometry,))
    return [part for part in parts if part.geom_type == "Polygon" and part.area > 1e-9]


def unite_outlines(parts: Iterable[Part]) -> shapely.Geometry:
    """Return what parts cover together.

    Lines to which slivers shrink on the grid are left out.
    """
    return unite([piece.outline for part in parts for piece in part.pieces])


def select_touching(parts: Sequence[Part], area: shapely.Geometry) -> list[Part]:
    """Select the parts that touch an area."""
    rims = [(k, rim) for k, part in enumerate(parts) for rim in part.outlines]
    is_near = shapely.dwithin(area, [rim for _, rim in rims], OVERLAY_GAP_M)
    return [parts[k] for k in dict.fromkeys(rims[m][0] for m in np.flatnonzero(is_near))]


def exclude_parts(parts: Iterable[Part], excluded: Iterable[Part]) -> list[Part]:
    """Return the parts that are none of `excluded`."""
    return [part for part in parts if not any(part is item for item in excluded)]


def widen_gap(gap: shapely.Polygon) -> shapely.Polygon:
    """Return the `gap` a millimetre wider."""
    return shapely.buffer(gap, 1e-3, quad_segs=1)


def find_neighbour(
    wide_gap: shapely.Polygon, polygons: list[list[shapely.Polygon]]
) -> tuple[int, int]:
    """Return the two indices of the polygon that shares most area with a gap.

    Without any, these are zeros.
    """
    places = [(k, q) for k, group in enumerate(polygons) for q in range(len(group))]
    is_beside = shapely.intersects(wide_gap, [polygons[k][q] for k, q in places])
    neighbours = [place for place, beside in zip(places, is_beside, strict=True) if beside]
    return max(
        neighbours,
        key=lambda place: (wide_gap.intersection(polygons[place[0]][place[1]]).area, place),
        default=(0, 0),
    )


def cut_part(part: Part, outline: shapely.Polygon) -> Part:
    """Return the part over `outline`, or the share of each piece of several."""
    if len(part.outlines) == 1:
        return replace(part, pieces=tuple(Piece(outline, p.planes) for p in part.pieces))
    cut = [
        (
            list_polygons(intersect(p.outline, outline)),
            p.planes,
        )
        for p in part.pieces
    ]
    pieces = [Piece(polygon, planes) for polygons, planes in cut for polygon in polygons]
    return replace(part, pieces=tuple(pieces))
