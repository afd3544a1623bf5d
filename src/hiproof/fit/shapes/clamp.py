"""Limit roofs to the range of their points' heights.

What lies far beyond becomes a level part.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import shapely

from ...geometry.rings import intersect, subtract, unite, with_area
from ...model import Part, Piece
from .regions import list_polygons

# Limit (m) beyond the lowest and highest point: ridges are often not hit, eaves not seen.
CLAMP_M = 0.4
NO_AREA = shapely.Polygon()  # The area where no place of a piece exceeds a limit.
LEAST_EXCESS_M2 = 0.1  # Least area (m2) beyond a limit. Less is the tip of a corner and no part.
# Distance of a tip or corner from the nearest point, in spacings of points: half the diagonal
# between four of them.
MISSED_SPACINGS = 0.7


def clamp_parts(parts: list[Part], z_low: float, z_high: float, spacing: float) -> list[Part]:
    """Limit `parts` to `z_low` and `z_high`, and add level parts instead of the rest.

    They may exceed the limits by what points `spacing` (m) apart miss.
    """
    new_parts = []
    for part in parts:
        steepest = max(float(np.hypot(*piece.planes[:, :2].T).max()) for piece in part.pieces)
        missed = MISSED_SPACINGS * spacing * steepest
        new_parts += clamp_part(part, z_low - CLAMP_M, z_high + CLAMP_M + missed, missed)
    return new_parts


def clamp_part(part: Part, z_low: float, z_high: float, missed: float = 0.0) -> list[Part]:
    """Return the part between `z_low` and `z_high`, and level parts below and above.

    It stays as it is where it exceeds neither, or falls below `z_low` by no more than what points
    may have `missed` (m) of an eave.
    """
    kept_pieces, beneath, overhead = [], [], []
    for outline in part.outlines:
        pieces = [piece for piece in part.pieces if piece.outline == outline]
        sunken, risen = find_excess(pieces, z_low - missed, z_high)
        if sunken.area + risen.area < LEAST_EXCESS_M2:
            kept_pieces += pieces
            continue
        sunken = find_excess(pieces, z_low, z_high)[0] if sunken.area > 0.0 else sunken
        beneath += list_polygons(sunken)
        overhead += list_polygons(risen)
        remainder = subtract(outline, with_area(shapely.union(sunken, risen)))
        kept_pieces += [
            Piece(polygon, piece.planes) for polygon in list_polygons(remainder) for piece in pieces
        ]
    if not beneath and not overhead:
        return [part]
    new_parts = [dataclasses.replace(part, pieces=tuple(kept_pieces))] if kept_pieces else []
    return new_parts + [
        make_level_part(polygons, z)
        for polygons, z in ((beneath, z_low), (overhead, z_high))
        if polygons
    ]


def find_excess(
    pieces: list[Piece], z_low: float, z_high: float
) -> tuple[shapely.Geometry, shapely.Geometry]:
    """Return where the highest of pieces is below `z_low`, and where above `z_high`.

    They have one outline.
    """
    outline, (lowest, highest) = pieces[0].outline, measure_range(pieces)
    sunken = subtract(outline, find_above(pieces, z_low)) if lowest < z_low else NO_AREA
    risen = intersect(outline, find_above(pieces, z_high)) if highest > z_high else NO_AREA
    return with_area(sunken), with_area(risen)


def measure_range(pieces: list[Piece]) -> tuple[float, float]:
    """Return bounds on the heights of pieces, from their planes at the corners of their outline."""
    xy = shapely.get_coordinates(pieces[0].outline)
    heights = [xy @ piece.planes[:, :2].T + piece.planes[:, 2] for piece in pieces]
    lowest = max(float(z.min()) for z in heights)
    return lowest, max(float(z.max(axis=0).min()) for z in heights)


def find_above(pieces: list[Piece], z: float) -> shapely.Geometry:
    """Return where a piece lies above `z`, within a box around their outline."""
    x0, y0, x1, y1 = pieces[0].outline.bounds
    rings = []
    for piece in pieces:
        ring = [(x0 - 1, y0 - 1), (x1 + 1, y0 - 1), (x1 + 1, y1 + 1), (x0 - 1, y1 + 1)]
        for a, b, c in piece.planes.tolist():
            ring = clip_ring(ring, a, b, c - z)
        rings.append(shapely.Polygon(ring))
    return unite(rings)


def make_level_part(polygons: list[shapely.Polygon], z: float) -> Part:
    """Make a flat part over `polygons` at height `z`."""
    x0, y0, x1, y1 = shapely.total_bounds(np.array(polygons, object))
    plane = np.array([[0.0, 0.0, z]])
    size = {"width": float(y1 - y0), "length": float(x1 - x0)}
    return Part(
        "flat",
        tuple(Piece(p, plane) for p in polygons),
        size,
        0.0,
        np.array([0.5 * (x0 + x1), 0.5 * (y0 + y1), z]),
    )


def clip_ring(
    ring: list[tuple[float, float]], a: float, b: float, c: float
) -> list[tuple[float, float]]:
    """Clip a convex ring to where a x + b y + c >= 0 (Sutherland and Hodgman 1974)."""
    signed = [a * x + b * y + c for x, y in ring]
    vertices = []
    for k, (vertex, z) in enumerate(zip(ring, signed, strict=True)):
        z_before = signed[k - 1]
        if (z >= 0.0) != (z_before >= 0.0):
            (x0, y0), share = ring[k - 1], z_before / (z_before - z)
            vertices.append((x0 + share * (vertex[0] - x0), y0 + share * (vertex[1] - y0)))
        if z >= 0.0:
            vertices.append(vertex)
    return vertices if len(vertices) > 2 else []
