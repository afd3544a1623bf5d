"""The targets of beams: half-spaces, triangles and crowns of buildings, solids, trees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely

from ..errors import InputError
from ..frames import Box, turn_points
from ..geometry.rings import ring_normal
from ..model import ROOF, Piece, Solid
from .relief import Plane, Relief
from .roofs import (
    NOT_ROOF,
    ROOF_TYPES,
    SimBuilding,
    box,
    find_label,
    make_part,
    random_parameters,
)

# what a beam met, by its place in SOURCES
SOURCE_ROOF, SOURCE_WALL, SOURCE_GROUND, SOURCE_TREE, SOURCE_CLUTTER = range(5)
SOURCES = ("roof", "wall", "ground", "tree", "clutter")
DISC_SLACK_M = 3.0  # a building's walls may go this far down below its own ground


@dataclass(frozen=True)
class Defects:
    """Probabilities of a building's and a cloud's defects, and outliers' share."""

    tree: float = 0.35
    chimney: float = 0.4
    dormer: float = 0.2
    antenna: float = 0.15
    neighbour: float = 0.35
    missing_strip: float = 0.12
    partial: float = 0.1
    swath_edge: float = 0.2
    outliers: float = 0.004

    @classmethod
    def none(cls) -> Defects:
        """Return a bare building under a faultless scanner."""
        return cls(*(0.0,) * 9)


@dataclass(frozen=True)
class Scene:
    """Bodies in one local frame.

    `halfspaces` (k, 4) in bodies `starts` (b + 1) within `discs` (b, 4), `source` and `label` (k,)
    of each side and, after these, of each of the `triangles` (m, 3, 3); `crowns`
    (t, 5); `terrain` the ground below all.
    """

    halfspaces: np.ndarray
    starts: np.ndarray
    discs: np.ndarray
    source: np.ndarray
    label: np.ndarray
    crowns: np.ndarray = field(default_factory=lambda: np.empty((0, 5)))
    terrain: Plane | Relief = field(default_factory=Plane)
    triangles: np.ndarray = field(default_factory=lambda: np.empty((0, 3, 3)))


@dataclass(frozen=True)
class Body:
    """A prism of a piece's outline (frame less `shift`) under its planes, and what it is."""

    piece: Piece
    top_source: int = SOURCE_ROOF
    wall_source: int = SOURCE_WALL
    label: int = NOT_ROOF
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))


def list_halfspaces(piece: Piece) -> np.ndarray:
    """Return rows (nx, ny, nz, d), n . p <= d inside, of a piece; InputError if not convex."""
    ring = shapely.get_coordinates(piece.outline.exterior)
    if len(piece.outline.interiors):
        raise InputError(
            "expected convex roof pieces to scan, got a hole; split the outline or scan a solid "
            "instead"
        )
    edge = np.diff(ring, axis=0)
    turn = edge[:, 0] * np.roll(edge[:, 1], -1) - edge[:, 1] * np.roll(edge[:, 0], -1)
    sign = 1.0 if turn.sum() > 0 else -1.0
    if (sign * turn < -1e-6).any():
        raise InputError(
            "expected convex roof pieces to scan, got a re-entrant corner; split it or scan a "
            "solid instead"
        )
    walls = np.zeros((len(edge), 4))
    walls[:, 0], walls[:, 1] = sign * edge[:, 1], -sign * edge[:, 0]
    walls[:, 3] = (walls[:, :2] * ring[:-1]).sum(axis=1)
    roofs = np.ones((len(piece.planes), 4))
    roofs[:, :2], roofs[:, 3] = -piece.planes[:, :2], piece.planes[:, 2]
    return np.concatenate([walls, roofs])


def bound_body(body: Body) -> Box:
    """Return the disc (x, y, z, radius) that beams up to 45 degrees pass to hit the body."""
    corners = shapely.get_coordinates(body.piece.outline)
    smallest, largest = corners.min(axis=0), corners.max(axis=0)
    x, y = (smallest + largest) / 2 + body.shift[:2]
    radius = math.hypot(*(largest - smallest)) / 2
    planes = body.piece.planes
    peak = (corners @ planes[:, :2].T + planes[:, 2]).max(axis=0).min()
    half_height = peak / 2
    return x, y, half_height + body.shift[2], radius + half_height + DISC_SLACK_M


def make_scene(
    bodies: Sequence[Body], crowns: np.ndarray | None = None, terrain: Plane | Relief | None = None
) -> Scene:
    """Pack bodies, `crowns` and `terrain` in the scene's frame for the beams."""
    sides, discs, source, label = [np.empty((0, 4))], [], [], []
    for body in bodies:
        rows = list_halfspaces(body.piece)
        rows[:, 3] += rows[:, :3] @ body.shift
        tops = len(body.piece.planes)
        sides.append(rows)
        discs.append(bound_body(body))
        source += [body.wall_source] * (len(rows) - tops) + [body.top_source] * tops
        label += [NOT_ROOF] * (len(rows) - tops) + [body.label] * tops
    return Scene(
        np.concatenate(sides),
        np.cumsum([len(rows) for rows in sides]),
        np.array(discs).reshape(-1, 4),
        np.array(source, np.int8),
        np.array(label, np.int8),
        np.empty((0, 5)) if crowns is None else crowns,
        Plane() if terrain is None else terrain,
    )


def building_bodies(building: SimBuilding) -> list[Body]:
    """Return the building's pieces, each roof labelled with its part's type."""
    return [
        Body(piece, label=find_label(part.type))
        for part in building.roof.parts
        for piece in part.pieces
    ]


def random_scene(rng: np.random.Generator, building: SimBuilding, defects: Defects) -> Scene:
    """Draw surroundings in a building's frame: clutter, neighbours, trees, sloping ground."""
    bodies = building_bodies(building) + superstructures(rng, building, defects)
    has_neighbour, has_tree = rng.random(2) < (defects.neighbour, defects.tree)
    if has_neighbour:
        bodies += neighbour(rng, building)
    crowns = trees(rng, building) if has_tree else None
    terrain = Plane(*rng.normal(0.0, 0.03, 2)) if defects != Defects.none() else None
    return make_scene(bodies, crowns, terrain)


def superstructures(
    rng: np.random.Generator, building: SimBuilding, defects: Defects
) -> list[Body]:
    """Draw chimneys, dormers and antennas on the building's roof."""
    bodies = []
    has_chimney, has_dormer, has_antenna = rng.random(3) < (
        defects.chimney,
        defects.dormer,
        defects.antenna,
    )
    if has_chimney:
        bodies += [chimney(rng, building) for _ in range(1 + int(rng.random() < 0.3))]
    if has_dormer:
        bodies += dormers(rng, building)
    if has_antenna:
        bodies.append(antenna(rng, building))
    return bodies


def place_on_roof(rng: np.random.Generator, building: SimBuilding) -> tuple[np.ndarray, Piece]:
    """Draw a place on the roof, 15 % away from a random piece's border, and the piece."""
    pieces = building.roof.pieces
    piece = pieces[rng.integers(len(pieces))]
    corners = shapely.get_coordinates(piece.outline)[:-1]
    centre = corners.mean(axis=0)
    a, b = (corners[1] - corners[0]) / 2, (corners[-1] - corners[0]) / 2
    s, t = rng.uniform(-0.7, 0.7, 2)
    return centre + s * a + t * b, piece


def chimney(rng: np.random.Generator, building: SimBuilding) -> Body:
    xy, piece = place_on_roof(rng, building)
    z_top = piece.height_at(xy[None])[0] + rng.uniform(0.6, 1.8)
    size = (rng.uniform(0.5, 1.1), rng.uniform(0.5, 1.0))
    return Body(box(xy, size, z_top, building.kappa), SOURCE_CLUTTER, SOURCE_CLUTTER)


def antenna(rng: np.random.Generator, building: SimBuilding) -> Body:
    xy, piece = place_on_roof(rng, building)
    z_top = piece.height_at(xy[None])[0] + rng.uniform(1.0, 3.5)
    return Body(box(xy, (0.25, 0.25), z_top, building.kappa), SOURCE_CLUTTER, SOURCE_CLUTTER)


def dormers(rng: np.random.Generator, building: SimBuilding) -> list[Body]:
    """Draw one to three boxes out of a slope, which they meet behind; none on flat roofs."""
    bodies = []
    for _ in range(1 + int(2.5 * rng.random() ** 2)):
        xy, piece = place_on_roof(rng, building)
        planes = piece.planes
        gradient = planes[np.argmin(planes[:, :2] @ xy + planes[:, 2]), :2]
        steepness = math.hypot(*gradient)
        if steepness < 0.35:
            continue
        uphill = gradient / steepness
        depth, width = np.minimum(
            rng.uniform((1.2, 1.2), (2.4, 3.0)), 0.3 * math.sqrt(piece.outline.area)
        )
        z_back = piece.height_at((xy + uphill * depth / 2)[None])[0]
        side = math.atan2(uphill[1], uphill[0])
        rise = width / 2 * rng.uniform(0.3, 0.7) if rng.random() < 0.5 else 0.0
        top = box(xy, (depth, width), z_back, side, rise)
        bodies.append(Body(top, SOURCE_CLUTTER, SOURCE_CLUTTER))
    return bodies


def neighbour(rng: np.random.Generator, building: SimBuilding) -> list[Body]:
    """Draw a neighbour wall to wall or some metres off, whose points are clutter here."""
    part = building.largest
    type = ROOF_TYPES[rng.choice((0, 1, 2, 3))]
    parameters = random_parameters(rng, type)
    gap = 0.0 if rng.random() < 0.4 else rng.uniform(0.5, 4.0)
    outline = shapely.transform(building.outline, lambda xy: turn_points(xy, -part.kappa))
    u_low, v_low, u_high, v_high = outline.bounds
    sign = rng.choice((-1.0, 1.0))
    if rng.random() < 0.6:
        u = (u_high if sign > 0 else u_low) + sign * (gap + parameters["length"] / 2)
        v = (v_low + v_high) / 2 + rng.normal(0.0, 1.0)
    else:
        u = (u_low + u_high) / 2 + rng.normal(0.0, 1.0)
        v = (v_high if sign > 0 else v_low) + sign * (gap + parameters["width"] / 2)
    x, y = turn_points(np.array([[u, v]]), part.kappa)[0]
    eave = max(2.2, part.translation[2] + rng.normal(0.0, 1.5))
    body = make_part(type, parameters, part.kappa, np.array([x, y, eave]))
    return [Body(piece, SOURCE_CLUTTER, SOURCE_CLUTTER) for piece in body.pieces]


def trees(rng: np.random.Generator, building: SimBuilding) -> np.ndarray:
    """Draw one to three crowns (t, 5) over the roof, trunks outside, mostly at a corner."""
    corners = shapely.get_coordinates(building.outline.exterior)[:-1]
    centre = corners.mean(axis=0)
    crowns = []
    for _ in range(1 + int(rng.integers(3))):
        position = rng.integers(len(corners))
        share = 0.3 * rng.random()
        foot = (1 - share) * corners[position] + share * corners[(position + 1) % len(corners)]
        outward = (foot - centre) / max(math.hypot(*(foot - centre)), 1e-9)
        radius, half_height = rng.uniform(1.2, 3.8), rng.uniform(1.5, 4.5)
        foot = foot + outward * radius * rng.uniform(0.3, 1.1) + rng.normal(0.0, 0.5, 2)
        crowns.append((*foot, rng.uniform(2.0, 6.0) + half_height, radius, half_height))
    return np.array(crowns)


def solids_scene(solids: list[Solid], labels: list[int]) -> Scene:
    """Return closed solids as triangles, RoofSurfaces with `labels` (of `find_label`)."""
    triangles, source, label = [np.empty((0, 3, 3))], [], []
    for solid, roof_label in zip(solids, labels, strict=True):
        for face in solid.faces:
            pieces = triangulate(solid.vertices, face.rings)
            is_roof = face.kind == ROOF
            triangles.append(pieces)
            source += [SOURCE_ROOF if is_roof else SOURCE_WALL] * len(pieces)
            label += [roof_label if is_roof else NOT_ROOF] * len(pieces)
    return replace(
        make_scene([]),
        triangles=np.concatenate(triangles),
        source=np.array(source, np.int8),
        label=np.array(label, np.int8),
    )


def triangulate(vertices: np.ndarray, rings: tuple[tuple[int, ...], ...]) -> np.ndarray:
    """Return triangles (m, 3, 3) of a polygon with holes, cut in the plane it faces most."""
    outer = vertices[list(rings[0])]
    if len(rings) == 1 and len(outer) == 3:
        return outer[None]
    normal = ring_normal(outer)
    drop = int(np.argmax(np.abs(normal)))
    selection = [axis for axis in range(3) if axis != drop]
    flat = shapely.make_valid(
        shapely.Polygon(
            outer[:, selection], [vertices[list(ring)][:, selection] for ring in rings[1:]]
        )
    )
    if abs(normal[drop]) < 1e-9 or flat.area < 1e-9:
        return np.empty((0, 3, 3))
    cells = shapely.get_parts(shapely.constrained_delaunay_triangles(flat))
    cells = cells[shapely.area(cells) > 0]
    corners = shapely.get_coordinates(cells).reshape(-1, 4, 2)[:, :3]
    out = np.empty((len(corners), 3, 3))
    out[:, :, selection] = corners
    offset = normal @ outer.mean(axis=0)
    out[:, :, drop] = (offset - corners @ normal[selection]) / normal[drop]
    return out
