"""The underside of a solid that does not stand on one level.

Its walls reach down to the terrain, and passages lead through below it. `finish_solid`
gives a model the underside that it is to have.

The solid over one level is composed first. Its ground is cut in plan into cells: the ground itself,
and each passage. Then walls get new feet, cells at different heights get a wall between them, a
passage gets a ceiling, and the ground is cut into triangles where it is not level. Coordinates are
whole tenths of a millimetre throughout.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely

from ..errors import CompositionError
from ..geometry.rings import intersect, list_between, subtract, unite, with_area
from ..model import CEILING, GROUND, ROOF, WALL, Face, Model, Passage, Solid, Underside
from ..settings import ComposeSettings
from .arrangement import GRID_M
from .building_parts import list_edges
from .check import check_solid
from .settle import PLAN_DIGITS

LEAST_ROOM_M = 0.5  # between the ground and a passage's ceiling; nobody goes through less
SNAP_UNITS = 1000.0  # 0.1 m; corners of passages so near a wall lie on it
ON_EDGE_UNITS = 2.0  # 0.2 mm; rounding moves a corner off its edge by less
ON_ROOF_UNITS = 10.0  # 1 mm; a corner lies under a roof face so near in plan

Place = tuple[int, int]  # a place in plan, in units of the grid

Corner = tuple[int, int, int]  # a corner of a solid, in units of the grid


class GroundCell(NamedTuple):
    """A part of the ground in plan with its `ceiling` in grid units, None on the ground."""

    polygon: shapely.Polygon
    ceiling: int | None


def make_underside(solid: Solid, underside: Underside, options: ComposeSettings) -> Solid:
    """Return a valid `solid` that stands on one level with its `underside` made.

    Both are in the roof's frame. Where terrain rises above a roof, the ground gives way. Raises
    CompositionError for a passage that is too low or not under the roof, and where no valid solid
    comes out.
    """
    findings: tuple = ()
    clearance = options.ground_clearance_m
    for cap in (cap_by_place(solid, clearance), cap_everywhere(solid, clearance)):
        result = Shell(solid, underside, cap).close()
        findings = check_solid(result, planarity_m=options.planarity_m)
        if not findings:
            return result
        if not underside.terrain:
            break
    raise CompositionError(
        "expected a valid solid over its terrain and passages, got one that is none by ISO 19107 "
        f"(code {findings[0].code}); leave them out"
    )


# The greatest height (n,) of the ground at places (n, 2), in units of the grid.
Cap = Callable[[np.ndarray], np.ndarray]


def cap_by_place(solid: Solid, clearance_m: float) -> Cap:
    """Return a height below the lowest roof face over each place."""
    roofs = solid.select_faces(ROOF)
    polygons = np.array(
        [shapely.transform(solid.project_face(face), lambda xy: xy / GRID_M) for face in roofs]
    )
    planes = np.array([fit_plane(solid, face) for face in roofs])

    def cap(xy: np.ndarray) -> np.ndarray:
        over = shapely.distance(shapely.points(xy)[:, None], polygons[None]) <= ON_ROOF_UNITS
        z = xy @ planes[:, :2].T + (planes[:, 2] - clearance_m) / GRID_M
        return np.where(over, z, np.inf).min(axis=1)

    return cap


def cap_everywhere(solid: Solid, clearance_m: float) -> Cap:
    """Return a height below the lowest roof for every place."""
    lowest = min(
        solid.vertices[list(ring), 2].min()
        for face in solid.select_faces(ROOF)
        for ring in face.rings
    )
    return lambda xy: np.full(len(xy), (lowest - clearance_m) / GRID_M)


def fit_plane(solid: Solid, face: Face) -> np.ndarray:
    """Return the plane (a, b, c) of a face that is not upright."""
    xyz = solid.vertices[[vertex for ring in face.rings for vertex in ring]]
    design = np.column_stack([xyz[:, :2], np.ones(len(xyz))])
    return np.linalg.lstsq(design, xyz[:, 2], rcond=None)[0]


class Shell:
    """A solid while its underside is made; places within `on_edge_units` lie on an edge."""

    on_edge_units = ON_EDGE_UNITS

    def __init__(self, solid: Solid, underside: Underside, cap: Cap) -> None:
        self.solid = solid
        self.grid: list[Corner] = [
            (x, y, z) for x, y, z in np.rint(solid.vertices / GRID_M).astype(int).tolist()
        ]
        grounds = [ring for face in solid.select_faces(GROUND) for ring in face.rings]
        self.ground_edges = {edge for ring in grounds for edge in list_edges(ring)}
        self.on_ground = {vertex for edge in self.ground_edges for vertex in edge}
        self.z_base = self.grid[grounds[0][0]][2]
        rings = [[self.grid[vertex][:2] for vertex in reversed(ring)] for ring in grounds]
        self.profile = Profile(underside.terrain) if underside.terrain else None
        self.bends: set[Place] = set()
        self.cells = self.cut_ground(rings, underside.passages)
        self.rings = self.node_cells(rings)
        self.ground = self.measure_ground(cap)
        self.cell_at = {
            edge: number
            for number, cell_rings in enumerate(self.rings)
            for ring in cell_rings
            for edge in list_edges(ring)
        }
        self.refuse_unusable()
        self.levels = self.collect_levels()

    def cut_ground(
        self, rings: list[list[Place]], passages: tuple[Passage, ...]
    ) -> list[GroundCell]:
        """Return the cells of the ground within `rings`, and keep where the feet of walls bend."""
        self.bends = self.find_bends(rings)
        return cut_cells(shapely.Polygon(rings[0], rings[1:]), passages)

    def find_bends(self, rings: list[list[Place]]) -> set[Place]:
        """Return the places at which the feet of walls along rings bend."""
        if self.profile is None:
            return set()
        bends: set[Place] = set()
        for start, end in (edge for ring in rings for edge in list_edges(ring)):
            knots = self.profile.place_knots(*(np.array([start, end]) * GRID_M))
            bends |= {(x, y) for x, y in np.rint(knots / GRID_M).astype(int).tolist()}
        return bends

    def node_cells(self, ground: list[list[Place]]) -> list[list[list[Place]]]:
        """Return rings of all cells with every place on their edges: corners and bends of walls."""
        rings = [list_rings(cell.polygon) for cell in self.cells]
        pool = {place for ring in [*ground, *itertools.chain(*rings)] for place in ring}
        self.pool = np.array(sorted(pool | self.bends))
        return [[self.node_ring(ring) for ring in cell_rings] for cell_rings in rings]

    def node_ring(self, ring: list[Place]) -> list[Place]:
        return [
            place
            for start, end in list_edges(ring)
            for place in (start, *self.find_on_edge(start, end))
        ]

    def find_on_edge(self, start: Place, end: Place) -> list[Place]:
        """Return the places between the ends of an edge that lie on it, in its order."""
        inner = list_between(start, end, self.pool, self.on_edge_units)
        return [(x, y) for x, y in self.pool[inner].tolist()]

    def measure_ground(self, cap: Cap) -> dict[Place, int]:
        """Return the height of the ground at every place of a cell."""
        places = sorted({place for rings in self.rings for ring in rings for place in ring})
        if self.profile is None:
            return dict.fromkeys(places, self.z_base)
        xy = np.array(places, float)
        z = np.minimum(self.profile.height_at(xy * GRID_M) / GRID_M, cap(xy))
        return dict(zip(places, np.floor(z).astype(int).tolist(), strict=True))

    def refuse_unusable(self) -> None:
        """Raise CompositionError for a passage that is too low, or too high for the roof."""
        roofs = self.solid.select_faces(ROOF)
        for cell, rings in zip(self.cells, self.rings, strict=True):
            if cell.ceiling is None:
                continue
            ground = max(self.ground[place] for ring in rings for place in ring)
            if (cell.ceiling - ground) * GRID_M < LEAST_ROOM_M:
                raise CompositionError(
                    f"expected a passage at least {LEAST_ROOM_M:g} m high, got one of "
                    f"{(cell.ceiling - ground) * GRID_M:.2f} m over the ground; raise its ceiling"
                )
            lowest = min(find_lowest_roof(self.solid, face, cell.polygon) for face in roofs)
            if lowest - cell.ceiling * GRID_M < LEAST_ROOM_M:
                raise CompositionError(
                    f"expected a passage at least {LEAST_ROOM_M:g} m below the roof, got one "
                    f"{lowest - cell.ceiling * GRID_M:.2f} m below it; lower its ceiling"
                )

    def find_bottom(self, cell: int, place: Place) -> int:
        """Return the height at which the solid begins over a place of a cell."""
        ceiling = self.cells[cell].ceiling
        return self.ground[place] if ceiling is None else ceiling

    def collect_levels(self) -> dict[Place, list[int]]:
        """Return the heights of all corners over each place, in order."""
        levels: dict[Place, set[int]] = {}
        for vertex, (x, y, z) in enumerate(self.grid):
            if vertex not in self.on_ground:
                levels.setdefault((x, y), set()).add(z)
        for number, rings in enumerate(self.rings):
            for place in itertools.chain(*rings):
                levels.setdefault(place, set()).add(self.find_bottom(number, place))
        return {place: sorted(heights) for place, heights in levels.items()}

    def close(self) -> Solid:
        """Return the solid with its new faces."""
        faces: list[tuple[list[list[Corner]], str, int]] = []
        for number, face in enumerate(self.solid.faces):
            if face.kind == WALL:
                faces += [(rings, WALL, -1) for rings in self.lower_wall(number)]
            elif face.kind != GROUND:
                faces.append(([self.keep_ring(ring) for ring in face.rings], face.kind, face.part))
        faces += [([ring], WALL, -1) for ring in self.list_inner_walls()]
        for number in range(len(self.cells)):
            faces += [(rings, kind, -1) for rings, kind in self.list_undersides(number)]
        return number_faces(faces)

    def keep_ring(self, ring: tuple[int, ...]) -> list[Corner]:
        """Return the ring of a roof face."""
        return [self.grid[vertex] for vertex in ring]

    def lower_wall(self, number: int) -> list[list[list[Corner]]]:
        """Return the rings of a wall, a face of the solid, with its new foot."""
        return [[self.lower_ring(ring) for ring in self.solid.faces[number].rings]]

    def lower_ring(self, ring: tuple[int, ...]) -> list[Corner]:
        """Return the ring of a wall with its new foot."""
        corners: list[Corner] = []
        for start, end in list_edges(ring):
            if (end, start) in self.ground_edges:
                corners += self.list_foot(self.grid[start][:2], self.grid[end][:2])
            elif start not in self.on_ground:
                corners.append(self.grid[start])
        return self.pass_levels(corners)

    def list_foot(self, start: Place, end: Place) -> list[Corner]:
        """Return the corners of a wall's foot from one end to the other."""
        places = [start, *self.find_on_edge(start, end), end]
        corners: list[Corner] = []
        for a, b in itertools.pairwise(places):
            if (a, b) not in self.cell_at:
                raise CompositionError(
                    "expected passages whose corners lie on the walls they cross, got one beside "
                    "a wall; draw it across the outline"
                )
            cell = self.cell_at[a, b]
            corners += [(*a, self.find_bottom(cell, a)), (*b, self.find_bottom(cell, b))]
        return corners

    def pass_levels(self, corners: list[Corner]) -> list[Corner]:
        """Return a ring with every corner that upright edges pass, each once."""
        ring: list[Corner] = []
        for start, end in list_edges(corners):
            if start == end:
                continue
            ring.append(start)
            if start[:2] == end[:2]:
                low, high = sorted((start[2], end[2]))
                between = [z for z in self.levels[start[:2]] if low < z < high]
                ring += [(*start[:2], z) for z in (between if start[2] < end[2] else between[::-1])]
        return ring

    def list_inner_walls(self) -> Iterable[list[Corner]]:
        """Yield the walls beside passages, each as a ring seen from the passage."""
        for (a, b), cell in self.cell_at.items():
            other = self.cell_at.get((b, a))
            if other is None:
                continue
            low = self.find_bottom(cell, a), self.find_bottom(cell, b)
            high = self.find_upper_end((a, b), other)
            if low[0] <= high[0] and low[1] <= high[1] and low != high:
                yield self.pass_levels([(*a, low[0]), (*b, low[1]), (*b, high[1]), (*a, high[0])])

    def find_upper_end(self, edge: tuple[Place, Place], other: int) -> tuple[int, int]:
        """Return the heights at which a wall over an edge ends, up to the `other` cell's."""
        return self.find_bottom(other, edge[0]), self.find_bottom(other, edge[1])

    def list_undersides(self, number: int) -> Iterable[tuple[list[list[Corner]], str]]:
        """Yield the faces below a cell: its ceiling, or the ground as level as it is."""
        rings = [
            [(*place, self.find_bottom(number, place)) for place in ring]
            for ring in self.rings[number]
        ]
        heights = {corner[2] for ring in rings for corner in ring}
        if len(heights) == 1:
            kind = GROUND if self.cells[number].ceiling is None else CEILING
            yield [ring[::-1] for ring in rings], kind
            return
        outer, *holes = ([corner[:2] for corner in ring] for ring in rings)
        polygon = shapely.Polygon(outer, holes)
        for triangle in shapely.get_parts(shapely.constrained_delaunay_triangles(polygon)):
            places = shapely.get_coordinates(shapely.orient_polygons(triangle))[:3].astype(int)
            yield [[(x, y, self.ground[x, y]) for x, y in places.tolist()][::-1]], GROUND


def list_rings(polygon: shapely.Polygon) -> list[list[Place]]:
    """Return the rings of a polygon on the grid, its area on their left."""
    polygon = shapely.orient_polygons(polygon)
    return [
        [(x, y) for x, y in np.rint(shapely.get_coordinates(ring)[:-1]).astype(int).tolist()]
        for ring in (polygon.exterior, *polygon.interiors)
    ]


def cut_cells(area: shapely.Polygon, passages: Iterable[Passage]) -> list[GroundCell]:
    """Cut the ground into cells (grid units), the first passage first, slivers with theirs."""
    cells: list[GroundCell] = []
    rest: shapely.Geometry = area
    for passage in passages:
        outline = shapely.transform(passage.outline, lambda xy: np.rint(xy / GRID_M))
        outline = snap_corners(outline, area)
        covered = intersect(outline, rest, 1.0)
        remainder = subtract(rest, covered, 1.0)
        slivers = [
            part
            for part in shapely.get_parts(remainder)
            if shapely.buffer(part, -SNAP_UNITS / 2).is_empty
        ]
        if slivers:
            covered = unite([covered, *slivers], 1.0)
            remainder = subtract(rest, covered, 1.0)
        ceiling = round(passage.ceiling / GRID_M)
        cells += [GroundCell(part, ceiling) for part in list_areas(covered)]
        rest = remainder
    return [*cells, *(GroundCell(part, None) for part in list_areas(rest))]


def list_areas(geometry: shapely.Geometry) -> list[shapely.Polygon]:
    return [part for part in shapely.get_parts(geometry) if not part.is_empty]


def snap_corners(outline: shapely.Polygon, area: shapely.Polygon) -> shapely.Geometry:
    """Return a passage whose corners near the outline's lie on it."""
    border = shapely.boundary(area)
    corners = shapely.multipoints(shapely.get_coordinates(area))

    def snap(xy: np.ndarray) -> np.ndarray:
        result = xy.copy()
        for number, point in enumerate(shapely.points(xy)):
            for target in (corners, border):
                if shapely.distance(point, target) <= SNAP_UNITS:
                    nearest = shapely.shortest_line(point, target)
                    result[number] = np.rint(shapely.get_coordinates(nearest)[-1])
                    break
        return result

    return shapely.make_valid(shapely.transform(outline, snap))


def find_lowest_roof(solid: Solid, face: Face, polygon: shapely.Polygon) -> float:
    """Return the lowest height of a roof face over a polygon on the grid."""
    roof = shapely.transform(solid.project_face(face), lambda xy: xy / GRID_M)
    shared = with_area(shapely.intersection(roof, polygon))
    if shared.area < SNAP_UNITS:
        return np.inf
    a, b, c = fit_plane(solid, face)
    return float((shapely.get_coordinates(shared) * GRID_M @ [a, b] + c).min())


def number_faces(faces: Iterable[tuple[list[list[Corner]], str, int]]) -> Solid:
    """Return the solid of faces given by their rings of corners."""
    numbers: dict[Corner, int] = {}
    numbered = tuple(
        Face(
            tuple(
                tuple(numbers.setdefault(corner, len(numbers)) for corner in ring) for ring in rings
            ),
            kind,
            part,
        )
        for rings, kind, part in faces
    )
    return Solid(np.round(np.array(list(numbers), float) * GRID_M, 4), numbered)


SPACING_M = 1.0  # between samples along a wall; the lines have a vertex at least as often
# m; a wall's foot follows the terrain so closely. Ground points are no more accurate.
FOOT_TOLERANCE_M = 0.05


class Profile:
    """The heights along closed `lines` (m, 3)."""

    def __init__(self, lines: tuple[np.ndarray, ...]) -> None:
        self.lines = lines
        self.plans = np.array([shapely.linestrings(line[:, :2]) for line in lines])
        self.lengths = [
            np.append(0.0, np.hypot(*np.diff(line[:, :2], axis=0).T).cumsum()) for line in lines
        ]

    def height_at(self, xy: np.ndarray) -> np.ndarray:
        """Return the height (n,) of the nearest place on the lines at `xy` (n, 2)."""
        points = shapely.points(xy)
        nearest = shapely.distance(points[:, None], self.plans[None]).argmin(axis=1)
        along = shapely.line_locate_point(self.plans[nearest], points)
        return np.array(
            [
                np.interp(at, self.lengths[k], self.lines[k][:, 2])
                for k, at in zip(nearest, along, strict=True)
            ]
        )

    def place_knots(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return the places (k, 2), the same from either end, where a wall's foot bends."""
        if tuple(end) < tuple(start):
            start, end = end, start
        count = math.ceil(math.dist(start, end) / SPACING_M)
        share = np.linspace(0.0, 1.0, count + 1)
        xy = start + share[:, None] * (end - start)
        bends = find_bends(share, self.height_at(xy), FOOT_TOLERANCE_M)
        return xy[bends]


def find_bends(t: np.ndarray, z: np.ndarray, tolerance: float) -> list[int]:
    """Return the samples at which a profile bends (Douglas and Peucker).

    Profiles of heights `z` (n,) at `t` (n,) stay within `tolerance` of the line through their ends
    and bends.

    >>> find_bends(np.arange(4.0), np.array([0.0, 0.0, 0.0, 3.0]), 0.05)
    [2]
    """
    off = np.abs(z - np.interp(t, t[[0, -1]], z[[0, -1]]))
    worst = int(off.argmax())
    if off[worst] <= tolerance:
        return []
    before = find_bends(t[: worst + 1], z[: worst + 1], tolerance)
    after = find_bends(t[worst:], z[worst:], tolerance)
    return [*before, worst, *(worst + bend for bend in after)]


def add_underside(model: Model, underside: Underside) -> Model:
    """Return the model with its `underside`; raises CompositionError as `make_underside`."""
    level = model.on_one_level
    if underside.is_level:
        return replace(model, solid=level, underside=underside, level_solid=None)
    solid = finish_solid(level, underside, model.roof.frame.origin, model.compose)
    return replace(model, solid=solid, underside=underside, level_solid=level)


def add_passage(model: Model, outline: shapely.Polygon, z_ceiling: float) -> Model:
    """Return the model with a passage: `outline` in the roof's frame, ceiling in the world."""
    passage = Passage(outline, z_ceiling - float(model.roof.frame.origin[2]))
    passages = (*model.underside.passages, passage)
    return add_underside(model, replace(model.underside, passages=passages))


def finish_solid(
    level: Solid, underside: Underside, origin: np.ndarray, compose: ComposeSettings | None = None
) -> Solid:
    """Return a solid over one level (in the world), its underside made; frame from `origin`."""
    local = Solid(np.round(level.vertices - origin, PLAN_DIGITS), level.faces)
    return make_underside(local, underside, compose or ComposeSettings()).move(origin)
