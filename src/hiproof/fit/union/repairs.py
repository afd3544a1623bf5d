"""Find what nearly meets in a roof's plan.

These are sides beside a place, and planes with a low step between them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import shapely

from .drawn_plan import DrawnPlan
from .members import is_inside_sides
from .plan import Plan
from .scene import Scene
from .sides import MOST_SIDE_LEAN, Side
from .volumes import DIRECTION, N_SIDES

# Distance (m) that a side may move to end in a corner, or to lie where its planes meet.
REPAIR_REACH_M = 1.0
LOW_STEP_M = 0.4  # A step so low (m) may be a fold line.
NO_STEP_M = 2e-3  # A lower step (m) is none.
# Planes whose gradients (rise over run) differ less have no clear fold line.
LEAST_BREAK = 0.1
ON_M = 0.004  # A place so near a line (m) lies on it: crossings are set aside by a millimetre.


@dataclass(frozen=True)
class Repair:
    """What is to be moved and by how much (m): sides or planes.

    Sides are {(volume, edge): line}. An equation is a place (2,) in local coordinates and pairs of
    weights and owners of planes: the sum of their heights there, so weighted, is zero. `length` is
    that (m) of the low step that goes.
    """

    size: float
    sides: dict[tuple[int, int], Side] = field(default_factory=dict)
    equations: tuple[tuple[np.ndarray, tuple[tuple[float, tuple[int, int]], ...]], ...] = ()
    length: float = 0.0

    @property
    def key(self) -> tuple:
        """The values that distinguish a repair from others that were tried."""
        lines = [
            (*which, round(side.offset, 2), round(side.lean, 2))
            for which, side in self.sides.items()
        ]
        places = [(*np.round(place, 1).tolist(), *terms) for place, terms in self.equations]
        return tuple(sorted(lines)), tuple(sorted(places))

    @property
    def owners(self) -> set[int]:
        """The volumes whose planes change."""
        return {k for _, terms in self.equations for _, (k, _) in terms}


def find_repairs(
    plan_drawn: DrawnPlan,
    volumes: np.ndarray,
    sides: list[list[Side]],
    plan: Plan,
    scene: Scene,
    numbers: Iterable[int],
    settled: Collection[tuple[int, int]] = (),
) -> list[Repair]:
    """Find what might be made to meet in the drawn plan, the nearest first.

    These are low steps, and moves of the sides of the volumes `numbers`. Sides (volume, edge) that
    are `settled` do not move alone.
    """
    repairs, is_low = list(list_low_steps(plan_drawn)), is_low_step(plan_drawn.gaps)
    turned: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    visible: dict[tuple[int, int], list[VisibleSide]] = {}
    for k in numbers:
        free = [edge for edge in range(N_SIDES) if not sides[k][edge].anchored]
        is_own = plan_drawn.find_edges_of(k)
        if not free or not is_own.any():
            continue
        direction = int(volumes[k, DIRECTION])
        if direction not in turned:
            turned[direction] = turn_plan(plan_drawn, plan, scene.turn[direction])
        places, planes = turned[direction]
        is_own &= is_inside_sides(places, sides[k], ON_M)[plan_drawn.edges].all(axis=1)
        if not is_own.any():
            continue
        around, near_places, near_edges = plan_drawn.select_around(is_own, REPAIR_REACH_M)
        places, is_own = places[near_places], is_own[near_edges]
        for edge in free:
            side = find_visible_side(around, places, is_own, (k, edge), sides[k][edge])
            if side is None:
                continue
            visible.setdefault((direction, edge // 2), []).append(side)
            if side.key not in settled:
                repairs += list_side_moves(around, planes, side, is_low[near_edges])
    for on_axis in visible.values():
        repairs += list_leaning_lines(on_axis)
    return sorted(repairs, key=lambda repair: repair.size)


def turn_plan(plan_drawn: DrawnPlan, plan: Plan, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a plan's places (m, 2) and planes (p, 3) in a direction's axes."""
    c, s = turn
    axes, origin = plan.frame.rotation.T @ np.array([[c, -s], [s, c]]), plan.frame.origin[:2]
    slopes, heights = plan_drawn.planes[:, :2], plan_drawn.planes[:, 2]
    planes = np.column_stack([slopes @ axes, slopes @ origin + heights])
    return (plan_drawn.places - origin) @ axes, planes


class VisibleSide(NamedTuple):
    """A side where it is visible on edges of its own.

    `key` is (volume, edge), and x and y (m,) are the plan's places across and along it. `offsets`
    (m,) are how far they lie off its line, `on_side` (e,) which edges lie on it, and `ends` their
    places, the first and the last along it at the ends.
    """

    key: tuple[int, int]
    line: Side
    x: np.ndarray
    y: np.ndarray
    offsets: np.ndarray
    on_side: np.ndarray
    ends: np.ndarray

    @property
    def reach(self) -> np.ndarray:
        """The two ends (2, 2), across and along."""
        ends = self.ends[[0, -1]]
        return np.column_stack([self.x[ends], self.y[ends]])


def find_visible_side(
    plan_drawn: DrawnPlan, places: np.ndarray, is_own: np.ndarray, key: tuple[int, int], line: Side
) -> VisibleSide | None:
    """Find where a side of a volume is visible, None if nowhere.

    The plan's `places` (m, 2) are in the volume's axes, and `is_own` (e,) are its edges.
    """
    axis = key[1] // 2
    x, y = places[:, axis], places[:, 1 - axis]
    offsets = x - line.offset - line.lean * y
    on_side = (np.abs(offsets) < ON_M)[plan_drawn.edges].all(axis=1) & is_own
    if not on_side.any():
        return None
    ends = plan_drawn.list_ends(on_side)
    return VisibleSide(key, line, x, y, offsets, on_side, ends[np.argsort(y[ends])])


def list_side_moves(
    plan_drawn: DrawnPlan, planes: np.ndarray, visible: VisibleSide, is_low: np.ndarray
) -> Iterator[Repair]:
    """Yield moves of one side.

    The plan's `planes` (p, 3) are in its axes, and the steps at its edges are low where `is_low`
    (e,). It may move parallel to a place nearby, to one at each end, to the line of a side that
    carries it on, or to the line where its planes meet.
    """
    key, side, x, y, offsets, on_side, ends = visible
    off = np.abs(offsets)
    near_places, edge = np.flatnonzero((off < REPAIR_REACH_M) & (off >= ON_M)), key[1]
    distances = np.hypot(x[near_places, None] - x[ends], y[near_places, None] - y[ends])
    sizes = distances.min(axis=1)
    for n in np.flatnonzero(sizes < REPAIR_REACH_M).tolist():
        offset = float(side.offset + offsets[near_places[n]])
        yield Repair(float(sizes[n]), {key: Side(offset, side.lean, False, side.sigma)})
    if len(near_places):
        end_distances = distances[:, [0, -1]]
        i, j = near_places[end_distances.argmin(axis=0)]
        size = end_distances.min(axis=0).max()
        if size < REPAIR_REACH_M and abs(x[j] - x[i]) < MOST_SIDE_LEAN * abs(y[j] - y[i]):
            lean = float((x[j] - x[i]) / (y[j] - y[i]))
            moved = Side(float(x[i] - lean * y[i]), lean, False, side.sigma)
            yield Repair(float(size), {key: moved})
    yield from list_line_moves(plan_drawn, visible)
    for e in np.flatnonzero(on_side & is_low):
        left, right = planes[plan_drawn.beside[e]]
        line = find_fold_line(left, right, edge)
        if line is not None:
            moved = Side(line[0], line[1], False, side.sigma)
            shift = np.abs(
                moved.offset - side.offset + (moved.lean - side.lean) * y[plan_drawn.edges[e]]
            ).max()
            if shift < REPAIR_REACH_M:
                yield Repair(float(shift), {key: moved})


def list_line_moves(plan_drawn: DrawnPlan, visible: VisibleSide) -> Iterator[Repair]:
    """Yield moves of a side onto the lines of edges that carry it on.

    One wall has one line. Such an edge begins beside an end of the side.
    """
    key, side, x, y, _, on_side, ends = visible
    x_ends, y_ends = x[ends[[0, -1]]], y[ends[[0, -1]]]
    x_edges, y_edges = x[plan_drawn.edges], y[plan_drawn.edges]
    across, along = x_edges[:, 1] - x_edges[:, 0], y_edges[:, 1] - y_edges[:, 0]
    carries_on = ~on_side & (np.abs(across) < MOST_SIDE_LEAN * np.abs(along))
    numbers = np.flatnonzero(carries_on & (np.hypot(across, along) > REPAIR_REACH_M))
    gaps = np.hypot(x_edges[numbers, :, None] - x_ends, y_edges[numbers, :, None] - y_ends)
    for e in numbers[gaps.min(axis=(1, 2)) < REPAIR_REACH_M]:
        lean = across[e] / along[e]
        line = Side(float(x_edges[e, 0] - lean * y_edges[e, 0]), float(lean), False, side.sigma)
        shift = np.abs(line.offset + lean * y_ends - x_ends).max()
        if ON_M < shift < REPAIR_REACH_M:
            yield Repair(float(shift), {key: line})


def list_leaning_lines(sides: list[VisibleSide]) -> Iterator[Repair]:
    """Yield moves of two sides onto one line, of which one carries on the other.

    Where a step leans, the search draws it as stairs. The line runs through the middles of both.
    """
    if len(sides) < 2:
        return
    ends = np.array([side.reach for side in sides])
    points = shapely.points(ends.reshape(-1, 2))
    near = shapely.STRtree(points).query(points, "dwithin", 2.0 * REPAIR_REACH_M) // 2
    pairs = np.array(sorted({(i, j) for i, j in near.T.tolist() if i < j}), int).reshape(-1, 2)
    apart = ends[pairs[:, 0], :, None] - ends[pairs[:, 1], None]
    is_near = np.linalg.norm(apart, axis=-1).min(axis=(1, 2)) < REPAIR_REACH_M
    for i, j in pairs[is_near].tolist():
        middle, other_middle = ends[[i, j]].mean(axis=1)
        across, along = (other_middle - middle).tolist()
        if not abs(across) < MOST_SIDE_LEAN * abs(along):
            continue
        lean = across / along
        line = Side(float(middle[0] - lean * middle[1]), lean)
        x, y = ends[[i, j]].reshape(-1, 2).T
        shift = float(np.abs(x - line.offset - lean * y).max())
        if ON_M < shift < REPAIR_REACH_M:
            yield Repair(shift, {sides[i].key: line, sides[j].key: line})


def find_fold_line(plane: np.ndarray, other: np.ndarray, edge: int) -> tuple[float, float] | None:
    """Find the line on which two planes (3,) in a volume's axes meet.

    It is x = at + lean y, with x across the volume's side `edge`. Returns None without a clear
    line.
    """
    a, b, c = (plane - other).tolist()
    fall, across = (a, b) if edge < 2 else (b, a)
    if not abs(fall) > LEAST_BREAK or not abs(across / fall) < MOST_SIDE_LEAN:
        return None
    return -c / fall, -across / fall


def list_low_steps(plan_drawn: DrawnPlan) -> Iterator[Repair]:
    """Yield repairs of low steps: two planes meet along the step."""
    highest, lengths = plan_drawn.gaps.max(axis=1), plan_drawn.lengths
    low_edges = np.flatnonzero(is_low_step(plan_drawn.gaps))
    pairs = np.sort(plan_drawn.beside[low_edges], axis=1)
    for pair in sorted(set(map(tuple, pairs.tolist()))):
        edges = low_edges[(pairs == pair).all(axis=1)]
        places = plan_drawn.places[plan_drawn.list_ends(edges)]
        spread = np.linalg.norm(places[:, None] - places, axis=2)
        i, j = np.unravel_index(spread.argmax(), spread.shape)
        terms = equate_heights(plan_drawn, *pair)
        size, length = float(highest[edges].max()), float(lengths[edges].sum())
        yield Repair(size, equations=((places[i], terms), (places[j], terms)), length=length)


def is_low_step(gaps: np.ndarray) -> np.ndarray:
    """Return which edges (e,) are low steps.

    `gaps` (e, 2) are how far apart their planes are at their ends.
    """
    highest = gaps.max(axis=1)
    return (highest > NO_STEP_M) & (highest < LOW_STEP_M)


def measure_low_steps(plan_drawn: DrawnPlan) -> float:
    """Return the length (m) of all low steps of the drawn plan."""
    return float(plan_drawn.lengths[is_low_step(plan_drawn.gaps)].sum())


def equate_heights(
    plan_drawn: DrawnPlan, plane: int, other: int
) -> tuple[tuple[float, tuple[int, int]], ...]:
    """Return the terms of an equation by which two planes have the same height."""
    owners = plan_drawn.owner[[plane, other]].tolist()
    return (1.0, (owners[0][0], owners[0][1])), (-1.0, (owners[1][0], owners[1][1]))
