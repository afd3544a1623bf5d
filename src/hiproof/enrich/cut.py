"""A solid whose walls are cut along their party walls.

The shell stays closed: a corner that a cut makes on an edge becomes a corner of every face beside
that edge.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from ..compose import check_solid
from ..geometry.rings import intersect, list_between, subtract
from ..model import Face, Solid
from .walls import Wall

# A strip of wall thinner than this (m) is part of the piece beside it. The second is for walls that
# the first leaves with a strip too thin for a valid face.
THINNEST_M = (0.05, 0.2)
# How far a corner of an area stands out of its shrunk form, by how much it shrank: corners sharper
# than 12 degrees are cut.
MOST_MITRE = 10.0
GRID_M = 0.0001  # grid (m) of cuts, on which solids are composed: no cut leaves a spike
SAME_CORNER_M = 0.001  # a new corner (m) this close to another, or to an edge, lies on it
SMALLEST_PIECE_M2 = 0.001  # area (m2) below which a piece of a wall is rounding
Region = tuple[str, shapely.Geometry]  # a neighbour's id, and where a wall touches it

Piece = tuple[str, Any]  # a neighbour's id, empty for an outer wall, and a polygon of the wall


def cut_walls(
    solid: Solid, walls: Sequence[Wall], regions: dict[int, list[Region]]
) -> tuple[Solid, dict[int, str]]:
    """Cut walls along their `regions`, given by face.

    Returns the solid and the neighbour of each party wall by face. Walls whose cuts would make an
    invalid solid stay whole, and are no party walls.
    """
    by_face = {wall.face: wall for wall in walls}
    cuts: dict[int, list[Piece]] = {}
    for thinnest in THINNEST_M:
        more = {
            face: cut_polygon(by_face[face].polygon, regions[face], thinnest)
            for face in sorted(regions)
            if face not in cuts
        }
        result, party = rebuild(solid, by_face, cuts | more)
        if not check_solid(result):
            return result, party
        for face, pieces in more.items():
            if not check_solid(rebuild(solid, by_face, cuts | {face: pieces})[0]):
                cuts[face] = pieces
    return rebuild(solid, by_face, cuts)


def cut_polygon(
    polygon: shapely.Polygon, regions: Sequence[Region], thinnest: float
) -> list[Piece]:
    """Cut a wall into party walls, earlier regions first, and a rest, none too thin (m)."""
    rest: shapely.Geometry = shapely.set_precision(polygon, GRID_M)
    party: list[Piece] = []
    for name, region in regions:
        outside = drop_thin(subtract(rest, region, GRID_M), thinnest)
        inside = drop_thin(subtract(rest, outside, GRID_M), thinnest)
        if inside.is_empty:
            continue
        party += [(name, part) for part in list_parts(inside)]
        rest = subtract(rest, inside, GRID_M)
    return [*party, *(("", part) for part in list_parts(rest))]


def list_parts(area: shapely.Geometry) -> list[shapely.Polygon]:
    """Return the polygons of an area, but those that rounding leaves."""
    return [part for part in shapely.get_parts(area) if part.area >= SMALLEST_PIECE_M2]


def drop_thin(area: shapely.Geometry, thinnest: float) -> shapely.Geometry:
    """Drop what is thinner than `thinnest` (m) of an area, which is shrunk and grown again."""
    half = thinnest / 2
    core = shapely.buffer(area, -half, join_style="mitre", mitre_limit=MOST_MITRE)
    grown = shapely.buffer(core, half, join_style="mitre", mitre_limit=MOST_MITRE)
    return intersect(area, grown, GRID_M)


def rebuild(
    solid: Solid, walls: dict[int, Wall], cuts: dict[int, list[Piece]]
) -> tuple[Solid, dict[int, str]]:
    """Return the solid with the pieces of walls in `cuts`, and the neighbour by face."""
    corners = Corners(solid.vertices)
    faces: list[Face] = []
    party: dict[int, str] = {}
    for number, face in enumerate(solid.faces):
        pieces = cuts.get(number, [("", None)])
        for name, polygon in pieces:
            party |= {len(faces): name} if name else {}
            rings = face.rings
            if len(pieces) > 1:
                rings = tuple(lift_rings(walls[number], polygon, corners))
            faces.append(Face(rings, face.kind, face.part))
    vertices = np.array(corners.xyz)
    added = range(len(solid.vertices), len(vertices))
    faces = [insert_corners(face, vertices, added) for face in faces]
    return Solid(vertices, tuple(faces)), party


class Corners:
    """The corners of a solid to which cuts add others, on a grid of 0.1 mm."""

    def __init__(self, vertices: np.ndarray) -> None:
        self.xyz = [*vertices]

    def add(self, place: np.ndarray) -> int:
        """Return the number of the corner at `place` (3,), a new one if there is none."""
        gap = np.abs(np.array(self.xyz) - place).max(axis=1)
        if gap.min() <= SAME_CORNER_M:
            return int(gap.argmin())
        self.xyz.append(np.round(place, 4))
        return len(self.xyz) - 1


def lift_rings(wall: Wall, polygon: shapely.Polygon, corners: Corners) -> Iterator[tuple[int, ...]]:
    """Yield the rings of a piece of a wall, seen from outside."""
    oriented = shapely.orient_polygons(polygon)
    for ring in (oriented.exterior, *oriented.interiors):
        numbers = [corners.add(xyz) for xyz in wall.lift(shapely.get_coordinates(ring)[:-1])]
        yield tuple(n for k, n in enumerate(numbers) if n != numbers[k - 1])


def insert_corners(face: Face, vertices: np.ndarray, added: range) -> Face:
    """Return the face with those `added` corners that lie on its edges."""
    rings = []
    for ring in face.rings:
        others = np.array([n for n in added if n not in ring], int)
        corners: list[int] = []
        for start, end in pairwise((*ring, ring[0])):
            inner = list_between(vertices[start], vertices[end], vertices[others], SAME_CORNER_M)
            corners += [start, *others[inner].tolist()]
        rings.append(tuple(corners))
    return Face(tuple(rings), face.kind, face.part)
