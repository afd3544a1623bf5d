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
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely

from ..errors import CompositionError
from ..geometry.rings import intersect, list_between, subtract, unite, with_area
from ..model import CEILING, GROUND, ROOF, Face, Model, Passage, Solid, Underside
from ..settings import ComposeSettings
from .arrangement import GRID_M
from .check import check_solid
from .lids import (
    BESIDE_EDGE_UNITS,
    ON_EDGE_UNITS,
    Lid,
    Place,
    close_lids,
    draw_plan,
    list_edges,
    list_lids,
    list_places,
    list_rings,
    to_grid,
)
from .settle import PLAN_DIGITS

LEAST_ROOM_M = 0.5  # between the ground and a passage's ceiling; nobody goes through less
SNAP_UNITS = 1000.0  # 0.1 m; corners of passages so near a wall lie on it
SAME_PLACE_UNITS = 15.0  # 1.5 mm; composing a roof moves a corner of its outline by less
REACHES = (ON_EDGE_UNITS, BESIDE_EDGE_UNITS)  # of edges, in turn until the solid is valid
OPEN = 302  # the code of a shell that is not closed
ON_ROOF_UNITS = 10.0  # 1 mm; a corner lies under a roof face so near in plan


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
    roofs = list_lids(solid, ROOF)
    for cap in list_caps(solid, underside, options.ground_clearance_m):
        lids = list_undersides(solid, underside, cap, draw_ground(solid), list_places(roofs))
        for reach in REACHES:
            result = close_lids([*roofs, *lids], reach)
            findings = check_solid(result, planarity_m=options.planarity_m)
            if not findings:
                return result
    if underside.passages and findings[0].code == OPEN:
        raise CompositionError(
            "expected passages whose corners lie on the walls they cross, got one beside a wall; "
            "draw it across the outline"
        )
    raise CompositionError(
        "expected a valid solid over its terrain and passages, got one that is none by ISO 19107 "
        f"(code {findings[0].code}); leave them out"
    )


# The greatest height (n,) of the ground at places (n, 2), in units of the grid.
Cap = Callable[[np.ndarray], np.ndarray]


def list_caps(solid: Solid, underside: Underside, clearance_m: float) -> list[Cap]:
    """Return a height below the lowest roof face over each place, then one below them all."""
    roofs = solid.select_faces(ROOF)
    polygons = np.array(
        [shapely.transform(solid.project_face(face), lambda xy: xy / GRID_M) for face in roofs]
    )
    planes = np.array([fit_plane(solid, face) for face in roofs])

    def cap_by_place(xy: np.ndarray) -> np.ndarray:
        over = shapely.distance(shapely.points(xy)[:, None], polygons[None]) <= ON_ROOF_UNITS
        z = xy @ planes[:, :2].T + (planes[:, 2] - clearance_m) / GRID_M
        return np.where(over, z, np.inf).min(axis=1)

    lowest = min(solid.vertices[list(ring), 2].min() for face in roofs for ring in face.rings)
    everywhere = (lowest - clearance_m) / GRID_M
    caps: list[Cap] = [cap_by_place, lambda xy: np.full(len(xy), everywhere)]
    return caps if underside.terrain else caps[:1]


def fit_plane(solid: Solid, face: Face) -> np.ndarray:
    """Return the plane (a, b, c) of a face that is not upright."""
    xyz = solid.vertices[[vertex for ring in face.rings for vertex in ring]]
    design = np.column_stack([xyz[:, :2], np.ones(len(xyz))])
    return np.linalg.lstsq(design, xyz[:, 2], rcond=None)[0]


def list_undersides(
    solid: Solid, underside: Underside, cap: Cap, area: shapely.Geometry, corners: np.ndarray
) -> list[Lid]:
    """Return the lids below a solid on one level: its ground and ceilings, within an `area`.

    Walls' feet bend at `corners` (n, 2) of other lids rather than beside them.
    """
    cells = cut_cells(area, underside.passages)
    outer = [ring for part in shapely.get_parts(area) for ring in list_rings(part)]
    others = {*place_knots(outer, underside), *itertools.chain(*outer)}
    plans = node_rings(
        [list_rings(cell.polygon) for cell in cells], others, corners, BESIDE_EDGE_UNITS
    )
    places = itertools.chain(*itertools.chain(*plans))
    ground = measure_ground(places, solid, underside, cap)
    lids: list[Lid] = []
    for cell, rings in zip(cells, plans, strict=True):
        if cell.ceiling is None:
            lids += draw_lids(rings, ground)
            continue
        highest = max(ground[place] for ring in rings for place in ring)
        refuse_unusable(solid, cell.polygon, cell.ceiling, highest)
        lids.append(
            Lid([[(*place, cell.ceiling) for place in ring[::-1]] for ring in rings], CEILING)
        )
    return lids


def draw_ground(solid: Solid) -> shapely.Polygon:
    """Return the ground of a solid on one level in plan, on the grid."""
    return draw_plan(list_lids(solid, GROUND)[0])


def place_knots(rings: list[list[Place]], underside: Underside) -> set[Place]:
    """Return the places at which the feet of walls along rings bend."""
    if not underside.terrain:
        return set()
    profile = Profile(underside.terrain)
    bends: set[Place] = set()
    for start, end in (edge for ring in rings for edge in list_edges(ring)):
        knots = profile.place_knots(*(np.array([start, end]) * GRID_M))
        bends |= {(x, y) for x, y in np.rint(knots / GRID_M).astype(int).tolist()}
    return bends


def node_rings(
    plans: list[list[list[Place]]], others: set[Place], corners: np.ndarray, reach: float
) -> list[list[list[Place]]]:
    """Return the rings of areas with all of their and of `others` places on their edges.

    These lie within `reach` of an edge. Places beside one of the `corners` (n, 2) are that corner.
    """
    pool = np.array(sorted(others.union(*itertools.chain(*plans))))

    def node_ring(ring: list[Place]) -> list[Place]:
        noded: list[Sequence[int]] = []
        for start, end in list_edges(ring):
            between = list_between(start, end, pool, reach)
            noded += [start, *pool[between].tolist()]
        places = np.array(noded)
        gaps = np.hypot(*(places[:, None] - corners).T)
        is_beside = gaps.min(axis=0)[:, None] <= SAME_PLACE_UNITS
        places = np.where(is_beside, corners[gaps.argmin(axis=0)], places)
        is_first = (places != np.roll(places, 1, axis=0)).any(axis=1)
        return [(x, y) for x, y in places[is_first].tolist()]

    return [[node_ring(ring) for ring in rings] for rings in plans]


def measure_ground(
    places: Iterable[Place], solid: Solid, underside: Underside, cap: Cap
) -> dict[Place, int]:
    """Return the height of the ground at places."""
    distinct = sorted(set(places))
    if not underside.terrain:
        z_base = list_lids(solid, GROUND)[0].rings[0][0][2]
        return dict.fromkeys(distinct, z_base)
    xy = np.array(distinct, float)
    z = np.minimum(Profile(underside.terrain).height_at(xy * GRID_M) / GRID_M, cap(xy))
    return dict(zip(distinct, np.floor(z).astype(int).tolist(), strict=True))


def refuse_unusable(solid: Solid, area: shapely.Polygon, ceiling: int, ground: int) -> None:
    """Raise CompositionError for a passage that is too low, or too high for the roof."""
    if (ceiling - ground) * GRID_M < LEAST_ROOM_M:
        raise CompositionError(
            f"expected a passage at least {LEAST_ROOM_M:g} m high, got one of "
            f"{(ceiling - ground) * GRID_M:.2f} m over the ground; raise its ceiling"
        )
    lowest = min(find_lowest_roof(solid, face, area) for face in solid.select_faces(ROOF))
    if lowest - ceiling * GRID_M < LEAST_ROOM_M:
        raise CompositionError(
            f"expected a passage at least {LEAST_ROOM_M:g} m below the roof, got one "
            f"{lowest - ceiling * GRID_M:.2f} m below it; lower its ceiling"
        )


def draw_lids(rings: list[list[Place]], ground: dict[Place, int]) -> Iterable[Lid]:
    """Yield the lids of the ground: one where it is level, else triangles."""
    corners = [[(*place, ground[place]) for place in ring[::-1]] for ring in rings]
    if len({z for ring in corners for *_, z in ring}) == 1:
        yield Lid(corners, GROUND)
        return
    outer, *holes = rings
    triangles = shapely.constrained_delaunay_triangles(shapely.Polygon(outer, holes))
    for triangle in shapely.orient_polygons(shapely.get_parts(triangles), exterior_cw=True):
        places = shapely.get_coordinates(triangle)[:3].astype(int).tolist()
        yield Lid([[(x, y, ground[x, y]) for x, y in places]], GROUND)


def cut_cells(area: shapely.Polygon, passages: Iterable[Passage]) -> list[GroundCell]:
    """Cut the ground into cells (grid units), the first passage first, slivers with theirs."""
    cells: list[GroundCell] = []
    rest: shapely.Geometry = area
    for passage in passages:
        outline = snap_corners(to_grid(passage.outline), shapely.boundary(area), SNAP_UNITS)
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


def snap_corners(area: shapely.Geometry, lines: shapely.Geometry, reach: float) -> shapely.Geometry:
    """Return an area, its corners within the `reach` of `lines` moved onto them or their ends."""
    corners = shapely.multipoints(shapely.get_coordinates(lines))

    def snap(xy: np.ndarray) -> np.ndarray:
        result = xy.copy()
        for number, point in enumerate(shapely.points(xy)):
            for target in (corners, lines):
                if shapely.distance(point, target) <= reach:
                    nearest = shapely.shortest_line(point, target)
                    result[number] = np.rint(shapely.get_coordinates(nearest)[-1])
                    break
        return result

    return shapely.make_valid(shapely.transform(area, snap))


def find_lowest_roof(solid: Solid, face: Face, polygon: shapely.Polygon) -> float:
    """Return the lowest height of a roof face over a polygon on the grid."""
    roof = shapely.transform(solid.project_face(face), lambda xy: xy / GRID_M)
    shared = with_area(shapely.intersection(roof, polygon))
    if shared.area < SNAP_UNITS:
        return np.inf
    a, b, c = fit_plane(solid, face)
    return float((shapely.get_coordinates(shared) * GRID_M @ [a, b] + c).min())


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
