"""Draw the plan of a roof under construction: places, edges, corners and planes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely

from ...compiled import compiled
from ...compose.arrangement import GRID_M, OUTSIDE
from ...compose.cells import arrange, equal_planes, plan_problem
from ...compose.levels import split_at_crossings, stack_levels
from ...compose.zones import WHOLE_PLAN, Zone, list_reaches
from ...errors import CompositionError
from ...frames import LocalFrame
from ...model import Part, Piece, Roof
from ...settings import ComposeSettings
from .finish import Planes
from .regions import PlanSite

STRAIGHT_CORNER_M = 0.02  # A corner nearer (m) to the line between its two neighbours is none.
# As in a solid's first attempt.
PLAN_REACHES = list_reaches([Zone(WHOLE_PLAN, 0)], ComposeSettings().snap_m)
EQUAL_PLANE = 1e-5  # Planes and slopes nearer to each other (m, rise over run) are one.


@dataclass(frozen=True)
class DrawnPlan:
    """A roof's plan in local coordinates.

    `places` (m, 2) are its vertices. `edges` (e, 2) are their numbers, and `beside` (e, 2) the
    numbers of the planes left and right of each, -1 outside. `planes` (p, 3) give heights of local
    x, y, 1. `owner` (p, 2) are the numbers of a plane's volume and of the plane in it. `corners` is
    the number of the roof's corners at all levels, without straight ones.
    """

    places: np.ndarray
    edges: np.ndarray
    beside: np.ndarray
    planes: np.ndarray
    owner: np.ndarray
    corners: int

    @cached_property
    def visible_planes(self) -> np.ndarray:
        """The numbers of the visible planes."""
        return np.unique(self.beside[self.beside >= 0])

    @cached_property
    def first_equal(self) -> np.ndarray:
        """The number of the first plane (p,) that equals each."""
        return equal_planes(self.planes, EQUAL_PLANE)

    @cached_property
    def first_beside(self) -> np.ndarray:
        """The numbers of the first planes that equal those beside each edge (e, 2)."""
        return np.append(self.first_equal, -1)[self.beside]  # -1 of -1, outside

    def find_edges_of(self, k: int) -> np.ndarray:
        """Return which edges (e,) lie beside a plane of volume k.

        One beside a plane equal to such a plane is among them.
        """
        is_own = np.zeros(len(self.first_equal) + 1, bool)  # the last is outside
        is_own[self.first_equal[self.owner[:, 0] == k]] = True
        return np.asarray(is_own[self.first_beside].any(axis=1))

    def list_ends(self, edges: np.ndarray) -> np.ndarray:
        """Return the numbers of the places where some `edges` end, each once, ascending."""
        return np.array(sorted(set(self.edges[edges].ravel().tolist())))

    @cached_property
    def lengths(self) -> np.ndarray:
        """The length (m) of each edge (e,)."""
        return np.linalg.norm(np.diff(self.places[self.edges], axis=1)[:, 0], axis=1)

    @cached_property
    def gaps(self) -> np.ndarray:
        """How far apart (m) the planes beside each edge are at its ends (e, 2).

        It is infinite at the outline.
        """
        left, right = self.planes[self.beside.T]
        at = np.ones((len(self.edges), 2, 3))
        at[..., :2] = self.places[self.edges]
        apart = np.abs(np.matmul(at, (left - right)[..., None])[..., 0])
        apart[(self.beside < 0).any(axis=1)] = np.inf
        return apart

    def select_around(
        self, is_centre: np.ndarray, reach_m: float
    ) -> tuple[DrawnPlan, np.ndarray, np.ndarray]:
        """Return the plan of the edges that end near central ones, and all numbers in it.

        `is_centre` (e,) are these edges. Near is within `reach_m` of the box around them. The
        numbers are those of places and of edges.
        """
        ends = self.places[self.edges[is_centre]]
        (low_x, low_y), (high_x, high_y) = ends.min(axis=(0, 1)), ends.max(axis=(0, 1))
        x, y = self.places.T
        is_near = (x > low_x - reach_m) & (x < high_x + reach_m)
        is_near &= (y > low_y - reach_m) & (y < high_y + reach_m)
        edges = np.flatnonzero(is_near[self.edges[:, 0]] | is_near[self.edges[:, 1]])
        is_end = np.zeros(len(self.places), bool)
        is_end[self.edges[edges]] = True
        around = replace(
            self,
            places=self.places[is_end],
            edges=(np.cumsum(is_end) - 1)[self.edges[edges]],
            beside=self.beside[edges],
        )
        return around, np.flatnonzero(is_end), edges


def make_part(
    regions: list[list[shapely.Polygon]],
    volumes: np.ndarray,
    planes: list[Planes],
    site: PlanSite,
) -> tuple[Part, list[tuple[int, int]]]:
    """Return all volumes over their `regions` as one part, and its planes' owners.

    An owner is a volume's number and a plane's.
    """
    pieces, owner = [], []
    for k, polygons in enumerate(regions):
        if polygons:
            rows, numbers = site.turn_planes(volumes[k], planes[k])
            pieces += [Piece(polygon, rows) for polygon in polygons]
            owner += [(k, p) for p in numbers] * len(polygons)
    return Part("free", tuple(pieces)), owner


def draw_plan(
    part: Part, owner: list[tuple[int, int]], outline: shapely.Polygon
) -> DrawnPlan | None:
    """Draw a part whose planes have these owners, None if its pieces make no plan."""
    roof = Roof((part,), outline, LocalFrame(np.zeros(3)))
    options = ComposeSettings()
    try:
        problem = plan_problem(roof)
        cells = arrange(problem, PLAN_REACHES, options.min_face_area_m2, options.min_face_width_m)
    except CompositionError:
        return None
    return make_drawn_plan(cells, problem.planes, np.array(owner))


def make_drawn_plan(cells, grid_planes: np.ndarray, owner: np.ndarray) -> DrawnPlan | None:
    """Make the plan of `cells`, in metres, None if no volume owns one of its planes."""
    split = split_at_crossings(cells.xy, cells.edges, cells.side, grid_planes, PLAN_REACHES)
    xy, edges, side, ties = split
    if not len(edges) or side.max() >= len(owner):
        return None
    floor = -1e9  # grid units; far below any roof
    _, _, follow, _, level, vertices = stack_levels(xy, edges, side, grid_planes, floor, ties)
    roofed = side.ravel() != OUTSIDE
    ends = np.column_stack([level, level[follow]])[roofed]
    planes = grid_planes * [1.0, 1.0, GRID_M]
    corners = int(count_corners(ends, vertices * GRID_M))
    return DrawnPlan(xy * GRID_M, edges, side, planes[: len(owner)], owner, corners)


@compiled
def count_corners(ends, vertices):
    """Count the vertices (n, 3) at the `ends` (m, 2) of edges that bend an edge."""
    near, count = np.full((len(vertices), 2), -1), np.zeros(len(vertices), np.int64)
    for k in range(len(ends)):
        for side in range(2):
            v, other = ends[k, side], ends[k, 1 - side]
            if other != v and other != near[v, 0] and other != near[v, 1]:
                near[v, min(count[v], 1)] = other
                count[v] += 1
    corners = 0
    for v in range(len(vertices)):
        is_straight = count[v] == 2 and is_between(vertices, near[v, 0], v, near[v, 1])
        corners += count[v] > 0 and not is_straight
    return corners


@compiled
def is_between(vertices, a, v, b):
    """Return whether vertex v lies on the line from vertex a to b, nearly."""
    square = along = across = 0.0
    for i in range(3):
        square += (vertices[b, i] - vertices[a, i]) ** 2
        along += (vertices[v, i] - vertices[a, i]) * (vertices[b, i] - vertices[a, i])
    share = along / max(square, 1e-12)
    for i in range(3):
        foot = vertices[a, i] + share * (vertices[b, i] - vertices[a, i])
        across += (vertices[v, i] - foot) ** 2
    return across < STRAIGHT_CORNER_M**2 and 0.0 < share < 1.0


def count_parameters(rows: np.ndarray, turns: np.ndarray) -> int:
    """Count planes (k, 3) that differ, and their slopes other than level.

    `turns` (k, 2) are cosine and sine of the direction in whose axes each is given.
    """
    c, s = turns.T
    a, b, z = rows.T
    common = np.column_stack([c * a - s * b, s * a + c * b, z])
    slopes = np.sort(np.hypot(rows[:, 0], rows[:, 1]))
    slopes = slopes[slopes > EQUAL_PLANE]
    distinct = int((equal_planes(common, EQUAL_PLANE) == np.arange(len(rows))).sum())
    return distinct + int((np.diff(slopes, prepend=0.0) > EQUAL_PLANE).sum())
