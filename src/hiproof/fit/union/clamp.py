"""No roof leaves the range of its points' heights by much: what would is cut off and becomes a level part."""

from __future__ import annotations

import dataclasses

import numpy as np
import shapely

from ...model import Part, Piece
from ...rings import GRID_M
from .regions import polygons_of

CLAMP_M = 0.4  # m beyond the lowest and highest point: ridges are often not hit, eaves not seen
LEAST_M2 = 0.1  # of a piece beyond; less is the tip of a corner and no part
MISSED_SPACINGS = (
    0.7  # of the points: half the diagonal between four, by which none need be nearer to a tip or a corner
)


def clamped(parts: list[Part], low: float, high: float, spacing: float) -> list[Part]:
    """`parts` within `low` and `high` but for what points `spacing` (m) apart miss, and level parts in place of what lies beyond."""
    found = []
    for part in parts:
        steepest = max(float(np.hypot(*piece.planes[:, :2].T).max()) for piece in part.pieces)
        margin = CLAMP_M + MISSED_SPACINGS * spacing * steepest
        found += clamped_part(part, low - margin, high + margin)
    return found


def clamped_part(part: Part, low: float, high: float) -> list[Part]:
    """The part where it is between `low` and `high`, and a level part where it is below or above."""
    if all(is_within(piece, low, high) for piece in part.pieces):
        return [part]
    kept, beneath, above = [], [], []
    for piece in part.pieces:
        if is_within(piece, low, high):
            kept.append(piece)
            continue
        z, sunken, risen = corner_heights(piece), shapely.Polygon(), shapely.Polygon()
        if z.min() < low:
            beneath_low = [half_plane([0.0, 0.0, low] - plane, piece.outline) for plane in piece.planes]
            sunken = shapely.union_all(beneath_low, grid_size=GRID_M)
        if z.max(axis=0).min() > high:
            above_high = [half_plane(plane - [0.0, 0.0, high], piece.outline) for plane in piece.planes]
            risen = shapely.intersection_all(above_high)
        sunken, risen = (shapely.intersection(piece.outline, beyond, grid_size=GRID_M) for beyond in (sunken, risen))
        if sunken.area + risen.area < LEAST_M2:
            kept.append(piece)
            continue
        beneath += polygons_of(sunken)
        above += polygons_of(risen)
        rest = shapely.difference(piece.outline, shapely.union(sunken, risen), grid_size=GRID_M)
        kept += [Piece(polygon, piece.planes) for polygon in polygons_of(rest)]
    found = [dataclasses.replace(part, pieces=tuple(kept))] if kept else []
    return found + [level_part(polygons, z) for polygons, z in ((beneath, low), (above, high)) if polygons]


def is_within(piece: Piece, low: float, high: float) -> bool:
    """Whether a piece is nowhere below `low`, and one of its planes nowhere above `high`."""
    z = corner_heights(piece)
    return bool(z.min() >= low and z.max(axis=0).min() <= high)


def corner_heights(piece: Piece) -> np.ndarray:
    """Heights (n, k) of a piece's k planes at the corners of its outline."""
    return shapely.get_coordinates(piece.outline) @ piece.planes[:, :2].T + piece.planes[:, 2]


def level_part(polygons: list[shapely.Polygon], z: float) -> Part:
    """A flat part over `polygons` at height `z`."""
    x0, y0, x1, y1 = shapely.total_bounds(np.array(polygons, object))
    plane = np.array([[0.0, 0.0, z]])
    size = {"width": float(y1 - y0), "length": float(x1 - x0)}
    return Part(
        "flat", tuple(Piece(p, plane) for p in polygons), size, 0.0, np.array([0.5 * (x0 + x1), 0.5 * (y0 + y1), z])
    )


def half_plane(line: np.ndarray, polygon: shapely.Polygon) -> shapely.Polygon:
    """Where a x + b y + c >= 0 of `line` (3,) within the bounds of `polygon`."""
    x0, y0, x1, y1 = shapely.bounds(polygon)
    box = [(x0 - 1.0, y0 - 1.0), (x1 + 1.0, y0 - 1.0), (x1 + 1.0, y1 + 1.0), (x0 - 1.0, y1 + 1.0)]
    return shapely.Polygon(ring_above(box, *line))


def ring_above(ring: list[tuple[float, float]], a: float, b: float, c: float) -> list[tuple[float, float]]:
    """The part of a convex ring where a x + b y + c >= 0 (Sutherland and Hodgman 1974)."""
    signed = [a * x + b * y + c for x, y in ring]
    kept = []
    for k, (vertex, z) in enumerate(zip(ring, signed, strict=True)):
        z_before = signed[k - 1]
        if (z >= 0.0) != (z_before >= 0.0):
            (x0, y0), share = ring[k - 1], z_before / (z_before - z)
            kept.append((x0 + share * (vertex[0] - x0), y0 + share * (vertex[1] - y0)))
        if z >= 0.0:
            kept.append(vertex)
    return kept if len(kept) > 2 else []
