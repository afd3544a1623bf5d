"""A solid whose roof reaches beyond its walls (LoD2.3).

The roof is composed over its own outline first, down to the ground. Its plan is then cut along the
walls and, beyond them, along the roof faces. Within the walls the solid stays as it is. Beyond them
a slab of the roof is left: it ends at a ceiling, parallel to the roof face above.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import shapely

from ..errors import CompositionError
from ..geometry.rings import list_between
from ..model import CEILING, ROOF, WALL, Passage, Solid, Underside
from .arrangement import COLLINEAR_UNITS, GRID_M
from .building_parts import list_edges
from .shell import simple_loops
from .underside import Cap, Corner, GroundCell, Place, Shell, cut_cells, fit_plane, list_rings

SAME_PLACE_UNITS = 15.0  # 1.5 mm; composing a roof moves a corner of its outline by less
LEAST_CLEARANCE_M = 0.1  # between a slab and the ground; eaves of a shed may hang that low
SAME_HEIGHT_UNITS = 10  # 1 mm; heights over one place nearer than that are one
SLIVER_STRIP_UNITS = 20.0  # 2 mm; strips between walls and roof edge thinner than that are rounding


class Step(NamedTuple):
    """An upright face over `places` in plan from `low` to `high`, the higher roof on the left."""

    places: list[Place]
    low: list[int]
    high: list[int]


class OverhangingShell(Shell):
    """A solid while slabs, `thickness` in grid units, are made beyond the `walls`' outline."""

    on_edge_units = COLLINEAR_UNITS + 1.0  # walls of a composed solid bend by that without a corner

    def __init__(
        self, solid: Solid, underside: Underside, cap: Cap, walls: shapely.Geometry, thickness: int
    ) -> None:
        self.walls, self.thickness = walls, thickness
        self.slabs: dict[tuple[int, Place], int] = {}
        self.steps: dict[int, Step] = {}
        self.roofs_below: dict[tuple[Place, Place], tuple[int, int]] = {}
        self.lower_edges: dict[tuple[Corner, Corner], Step] = {}
        super().__init__(solid, underside, cap)

    def cut_ground(
        self, rings: list[list[Place]], passages: tuple[Passage, ...]
    ) -> list[GroundCell]:
        """Return the cells within the walls, then those of the slabs."""
        inside, outside = self.cut_plan(shapely.Polygon(rings[0], rings[1:]))
        feet = [ring for part in shapely.get_parts(inside) for ring in list_rings(part)]
        self.steps = dict(self.find_steps())
        self.bends = self.find_bends(feet) | self.find_crossings()
        cells = cut_cells(inside, passages)
        self.first_slab, self.over = len(cells), [face for _, face in outside]
        return [*cells, *(GroundCell(polygon, None) for polygon, _ in outside)]

    def cut_plan(
        self, area: shapely.Polygon
    ) -> tuple[shapely.Geometry, list[tuple[shapely.Polygon, int]]]:
        """Return the plan within the walls, and the slabs outside with their roof faces."""
        numbers = [n for n, face in enumerate(self.solid.faces) if face.kind == ROOF]
        roofs = np.array([to_grid(self.solid.project_face(self.solid.faces[n])) for n in numbers])
        walls = weld_walls(self.walls, [area, *roofs])
        polygons = [*shapely.get_parts(walls), area, *roofs]
        rings = [ring for polygon in polygons for ring in list_rings(polygon)]
        self.pool = np.unique(np.concatenate(rings).astype(int), axis=0)
        lines = shapely.union_all(
            [shapely.linearrings(self.node_ring(ring)) for ring in rings], grid_size=1.0
        )
        cells = shapely.get_parts(shapely.polygonize(shapely.get_parts(lines)))
        middles = shapely.point_on_surface(cells)
        cells, middles = (a[shapely.contains(area, middles)] for a in (cells, middles))
        is_inside = shapely.contains(walls, middles)
        is_inside |= find_slivers(cells, shapely.boundary(walls))
        inside = shapely.union_all(cells[is_inside], grid_size=1.0)
        owners = shapely.distance(middles[:, None], roofs[None]).argmin(axis=1)
        return inside, [
            (cell, numbers[owner])
            for cell, owner, within in zip(cells, owners, is_inside, strict=True)
            if not within
        ]

    def find_steps(self) -> list[tuple[int, Step]]:
        """Return the upright faces between roof faces, by their number."""
        return [
            (number, make_step([self.grid[vertex] for vertex in face.rings[0]]))
            for number, face in enumerate(self.solid.faces)
            if face.kind == WALL and self.on_ground.isdisjoint(face.rings[0])
        ]

    def find_crossings(self) -> set[Place]:
        """Return the places at which the slab above a step passes the roof below it."""
        crossings = set()
        for step in self.steps.values():
            gaps = np.subtract(step.high, step.low) - self.thickness
            if gaps[0] * gaps[-1] < 0 and np.abs(gaps).min() > SAME_HEIGHT_UNITS:
                start, end = np.array(step.places)
                x, y = np.rint(start + gaps[0] / (gaps[0] - gaps[-1]) * (end - start)).astype(int)
                crossings.add((int(x), int(y)))
        return crossings

    def measure_ground(self, cap: Cap) -> dict[Place, int]:
        """Return the height of the ground at every place, having measured steps and slabs."""
        for number, step in self.steps.items():
            self.steps[number] = step = self.divide_step(step)
            for k, (start, end) in enumerate(itertools.pairwise(step.places)):
                self.roofs_below[end, start] = step.low[k + 1], step.low[k]
            first, last = ((*step.places[k], step.low[k]) for k in (0, -1))
            self.lower_edges[last, first] = step
        self.measure_slabs()
        return super().measure_ground(cap)

    def divide_step(self, step: Step) -> Step:
        """Return a step with all places that lie on its edge."""
        start, end = step.places
        places = [start, *self.find_on_edge(start, end), end]
        share = [float(np.hypot(*np.subtract(p, start))) for p in places]
        low, high = (
            np.rint(np.interp(share, [0.0, share[-1]], z)).astype(int).tolist()
            for z in (step.low, step.high)
        )
        return Step(places, low, high)

    def measure_slabs(self) -> None:
        """Measure each slab's ceiling over its places; heights that all but meet are one."""
        fixed: dict[Place, set[int]] = {}
        for x, y, z in (c for v, c in enumerate(self.grid) if v not in self.on_ground):
            fixed.setdefault((x, y), set()).add(z)
        for step in self.steps.values():
            for place, *heights in zip(*step, strict=True):
                fixed.setdefault(place, set()).update(heights)
        for number, face in enumerate(self.over, self.first_slab):
            a, b, c = fit_plane(self.solid, self.solid.faces[face])
            for place in itertools.chain(*self.rings[number]):
                z = round(a * place[0] + b * place[1] + c / GRID_M) - self.thickness
                known = fixed.setdefault(place, set())
                nearest = min(known, key=lambda other: abs(other - z), default=z)
                z = nearest if abs(nearest - z) <= SAME_HEIGHT_UNITS else z
                known.add(z)
                self.slabs[number, place] = z

    def find_bottom(self, cell: int, place: Place) -> int:
        slab = self.slabs.get((cell, place))
        return super().find_bottom(cell, place) if slab is None else slab

    def refuse_unusable(self) -> None:
        """Raise CompositionError also where a slab all but lies on the ground."""
        super().refuse_unusable()
        room = min((z - self.ground[place] for (_, place), z in self.slabs.items()), default=10**9)
        if room * GRID_M < LEAST_CLEARANCE_M:
            raise CompositionError(
                f"expected overhangs at least {LEAST_CLEARANCE_M:g} m over the ground, got one "
                f"{room * GRID_M:.2f} m over it; leave them out"
            )

    def collect_levels(self) -> dict[Place, list[int]]:
        levels = super().collect_levels()
        for step in self.steps.values():
            for corner in self.list_step_foot(step):
                levels[corner[:2]] = sorted({*levels.get(corner[:2], []), corner[2]})
        return levels

    def list_step_foot(self, step: Step) -> list[Corner]:
        """Return the lower end of a step: the roof below it, or the slab above it."""
        corners: list[Corner] = []
        for k, (start, end) in enumerate(itertools.pairwise(step.places)):
            cell = self.cell_at.get((start, end))
            for place, low in ((start, step.low[k]), (end, step.low[k + 1])):
                slab = low if cell is None else self.slabs.get((cell, place), low)
                corners.append((*place, max(low, slab)))
        return corners

    def lower_wall(self, number: int) -> list[list[list[Corner]]]:
        step = self.steps.get(number)
        if step is None:
            rings = [ring for rings in super().lower_wall(number) for ring in rings]
        else:
            top = [(*step.places[k], step.high[k]) for k in (-1, 0)]
            rings = [self.pass_levels([*self.list_step_foot(step), *top])]
        loops = (loop for ring in rings for loop in simple_loops(ring))
        return [[loop] for loop in loops if len(loop) > 2]

    def keep_ring(self, ring: tuple[int, ...]) -> list[Corner]:
        """Return the ring of a roof face with the places on steps above it."""
        corners: list[Corner] = []
        for start, end in list_edges(super().keep_ring(ring)):
            corners.append(start)
            step = self.lower_edges.get((start, end))
            if step is not None:
                inner = zip(step.places, step.low, strict=True)
                corners += [(*place, low) for place, low in list(inner)[-2:0:-1]]
        return corners

    def find_upper_end(self, edge: tuple[Place, Place], other: int) -> tuple[int, int]:
        start, end = super().find_upper_end(edge, other)
        roof = self.roofs_below.get(edge, (start, end))
        return min(start, roof[0]), min(end, roof[1])

    def list_undersides(self, number: int) -> Iterable[tuple[list[list[Corner]], str]]:
        if number < self.first_slab:
            yield from super().list_undersides(number)
            return
        yield (
            [
                [(*place, self.slabs[number, place]) for place in ring][::-1]
                for ring in self.rings[number]
            ],
            CEILING,
        )


def to_grid(area: shapely.Geometry) -> shapely.Geometry:
    """Return an area in units of the grid."""
    return shapely.transform(area, lambda xy: np.rint(xy / GRID_M))


def find_slivers(cells: np.ndarray, walls: shapely.Geometry) -> np.ndarray:
    """Return whether cells (n,) are rounding along the walls' outline."""
    is_thin = shapely.is_empty(shapely.buffer(cells, -SLIVER_STRIP_UNITS / 2))
    shared = shapely.length(shapely.intersection(shapely.boundary(cells), walls))
    return is_thin & (shared > 0.0)


def weld_walls(walls: shapely.Geometry, roofs: list[shapely.Polygon]) -> shapely.Geometry:
    """Return the walls' areas with corners moved onto those and edges of `roofs`, and noded."""
    rings = [np.array(ring, float) for polygon in roofs for ring in list_rings(polygon)]
    corners = np.unique(np.concatenate(rings), axis=0)
    lines = np.concatenate([np.stack([r, np.roll(r, -1, axis=0)], axis=1) for r in rings])
    return shapely.multipolygons(
        [weld_wall(part, corners, lines) for part in shapely.get_parts(walls)]
    )


def weld_wall(area: shapely.Polygon, corners: np.ndarray, lines: np.ndarray) -> shapely.Polygon:
    """Return one area within walls, welded to corners (n, 2) and `lines` (m, 2, 2)."""
    welded = [
        weld_edges(np.array([weld_corner(place, corners, lines) for place in ring]), corners)
        for ring in list_rings(area)
    ]
    return shapely.Polygon(welded[0], welded[1:])


def weld_corner(place: Place, corners: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Return the corner (n, 2) or place on a line (m, 2, 2) at a place, else the place."""
    gaps = np.hypot(*(corners - place).T)
    if gaps.min() <= SAME_PLACE_UNITS:
        return corners[gaps.argmin()]
    along = lines[:, 1] - lines[:, 0]
    length2 = np.maximum((along**2).sum(axis=1), 1.0)
    share = ((place - lines[:, 0]) * along).sum(axis=1) / length2
    feet = lines[:, 0] + np.clip(share, 0.0, 1.0)[:, None] * along
    gaps = np.hypot(*(feet - place).T)
    return np.rint(feet[gaps.argmin()]) if gaps.min() <= SAME_PLACE_UNITS else np.array(place)


def weld_edges(ring: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return a ring (k, 2) that passes through the `corners` (n, 2) beside its edges."""
    result = []
    for start, end in itertools.pairwise([*ring, ring[0]]):
        if (start != end).any():
            inner = list_between(start, end, corners, SAME_PLACE_UNITS)
            result += [start, *corners[inner]]
    return np.array(result)


def make_step(ring: list[Corner]) -> Step:
    """Return the step of a wall's `ring`, which stands over one edge in plan."""
    turns = [(a, b) for a, b in list_edges(ring) if a[:2] != b[:2]]
    (a, b), (d, c) = sorted(turns, key=lambda turn: turn[0][2] + turn[1][2])
    return Step([a[:2], b[:2]], [a[2], b[2]], [c[2], d[2]])
