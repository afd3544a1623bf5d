"""Draw the plan of a roof under construction: places, edges, corners and planes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely

from ...compose.arrangement import GRID_M, OUTSIDE
from ...compose.cells import arrange, equal_planes, plan_problem
from ...compose.levels import split_at_crossings, stack_levels
from ...compose.zones import WHOLE_PLAN, Zone, list_reaches
from ...errors import CompositionError
from ...frames import LocalFrame
from ...model import Part, Piece, Roof
from ...settings import ComposeSettings
from .finish import Planes
from .plan import Plan
from .scene import Scene
from .volumes import DIRECTION

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

    def find_edges_of(self, k: int) -> np.ndarray:
        """Return which edges (e,) lie beside a plane of volume k.

        One beside a plane equal to such a plane is among them.
        """
        first = np.append(self.first_equal, -1)  # -1 of -1, outside
        own = first[:-1][self.owner[:, 0] == k]
        is_own: np.ndarray = np.isin(first[self.beside], own)
        return np.asarray(is_own.any(axis=1))

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
        places, ends = np.unique(self.edges[edges], return_inverse=True)
        ends, beside = ends.reshape(-1, 2), self.beside[edges]
        around = replace(self, places=self.places[places], edges=ends, beside=beside)
        return around, places, edges


def make_part(
    regions: list[list[shapely.Polygon]],
    volumes: np.ndarray,
    planes: list[Planes],
    plan: Plan,
    scene: Scene,
) -> tuple[Part, list[tuple[int, int]]]:
    """Return all volumes over their `regions` as one part, and its planes' owners.

    An owner is a volume's number and a plane's.
    """
    pieces, owner = [], []
    for k, polygons in enumerate(regions):
        if polygons:
            numbers = np.flatnonzero(np.isfinite(planes[k].rows[:, 2]))
            turn = scene.turn[int(volumes[k, DIRECTION])]
            rows = transform_planes(planes[k].rows[numbers], turn, plan)
            pieces += [Piece(polygon, rows) for polygon in polygons]
            owner += [(k, p) for p in numbers.tolist()] * len(polygons)
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
    corners = count_corners(ends, vertices * GRID_M)
    return DrawnPlan(xy * GRID_M, edges, side, planes[: len(owner)], owner, corners)


def count_corners(ends: np.ndarray, vertices: np.ndarray) -> int:
    """Count the vertices (n, 3) at the `ends` (m, 2) of edges that bend an edge."""
    starts, other = ends[ends[:, 0] != ends[:, 1]].T
    size = len(vertices)
    pairs = np.unique(np.minimum(starts, other) * size + np.maximum(starts, other))
    starts, other = np.divmod(pairs, size)
    begins = np.concatenate([starts, other])
    neighbours = np.concatenate([other, starts])[np.argsort(begins, kind="stable")]
    count = np.bincount(begins, minlength=size)
    middle = np.flatnonzero(count == 2)
    first = (np.cumsum(count) - count)[middle]
    v, a, b = vertices[middle], vertices[neighbours[first]], vertices[neighbours[first + 1]]
    way = b - a
    share = ((v - a) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-12)
    offsets = np.linalg.norm(v - a - share[:, None] * way, axis=1)
    straight = (offsets < STRAIGHT_CORNER_M) & (share > 0.0) & (share < 1.0)
    return int(np.count_nonzero(count)) - int(straight.sum())


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


def transform_planes(rows: np.ndarray, turn: np.ndarray, plan: Plan) -> np.ndarray:
    """Return planes (k, 3) of local x, y, 1 from those in axes turned from the plan's.

    `turn` has cosine and sine of the angle.
    """
    c, s = turn
    gradients = rows[:, :2] @ np.array([[c, s], [-s, c]]) @ plan.frame.rotation
    return np.column_stack([gradients, rows[:, 2] - gradients @ plan.frame.origin[:2]])
