"""What nearly meets in a roof's plan: sides beside a place, planes with a low step between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from .drawn_plan import DrawnPlan
from .plan import Plan
from .scene import Scene
from .sides import Side
from .volumes import DIRECTION, SIDES

REACH_M = 1.0  # m that a side may be moved by to end in a corner, or to lie where its planes meet
LOW_STEP_M, NO_STEP_M = 0.4, 2e-3  # m; a step so low may be a fold line, and one below is none
LEAST_BREAK = 0.1  # rise over run; planes less apart have no fold line, but may be one
MOST_LEAN = 0.5  # of a line that a side may take
ON_M = 0.004  # m; a place so near a line lies on it: crossings are set aside by a millimetre


@dataclass(frozen=True)
class Repair:
    """What is to be moved and by how much (m): sides, as {(volume, edge): line}, or planes.

    An equation is a place (2,) in local coordinates and pairs of weights and owners of planes: the
    sum of their heights there, so weighted, is zero.
    """

    size: float
    sides: dict[tuple[int, int], Side] = field(default_factory=dict)
    equations: tuple[tuple[np.ndarray, tuple[tuple[float, tuple[int, int]], ...]], ...] = ()

    @property
    def key(self) -> tuple:
        """What tells a repair from others that were tried."""
        lines = [(*which, round(side.at, 2), round(side.lean, 2)) for which, side in self.sides.items()]
        places = [(*np.round(place, 1).tolist(), *terms) for place, terms in self.equations]
        return tuple(sorted(lines)), tuple(sorted(places))


def find_repairs(
    drawn: DrawnPlan,
    volumes: np.ndarray,
    sides: list[list[Side]],
    plan: Plan,
    scene: Scene,
) -> list[Repair]:
    """Find everything in `drawn` that might be made to meet, the nearest first."""
    gaps = drawn.gaps
    found = list(low_steps(drawn, gaps))
    owners = np.where(drawn.beside >= 0, drawn.owner[drawn.beside, 0], -1)
    for k in range(1, len(volumes)):
        own = (owners == k).any(axis=1)
        free = [edge for edge in range(SIDES) if not sides[k][edge].anchored] if own.any() else []
        if not free:
            continue
        places = in_own_axes(drawn.places, int(volumes[k, DIRECTION]), plan, scene)
        for edge in free:
            found += moves_of_side(drawn, gaps, places, own, (k, edge), sides[k][edge])
    return sorted(found, key=lambda repair: repair.size)


def in_own_axes(xy: np.ndarray, direction: int, plan: Plan, scene: Scene) -> np.ndarray:
    """Local places (n, 2) in the axes of a direction."""
    c, s = scene.turn[direction]
    return (xy - plan.frame.origin[:2]) @ plan.frame.rotation.T @ np.array([[c, -s], [s, c]])


def moves_of_side(
    drawn: DrawnPlan,
    gaps: np.ndarray,
    places: np.ndarray,
    own: np.ndarray,
    which: tuple[int, int],
    side: Side,
) -> Iterator[Repair]:
    """Yield moves of one side, that of (volume, edge), where it shows on edges of its `own` (e,).

    It may move parallel to a place nearby, to one at each end, or to the line where its planes
    meet.
    """
    edge = which[1]
    x, y = places[:, edge // 2], places[:, 1 - edge // 2]
    off = x - side.at - side.lean * y
    along = np.abs(off) < ON_M
    on_side = along[drawn.edges].all(axis=1) & own
    if not on_side.any():
        return
    ends = np.unique(drawn.edges[on_side])
    near = np.flatnonzero((np.abs(off) < REACH_M) & ~along)
    apart = np.hypot(x[near, None] - x[ends], y[near, None] - y[ends])
    for j, size in zip(near, apart.min(axis=1), strict=True):
        if size < REACH_M:
            moved = Side(float(side.at + off[j]), side.lean, False, side.sigma)
            yield Repair(float(size), {which: moved})
    if len(near):
        first, last = ends[[y[ends].argmin(), y[ends].argmax()]]
        away = [np.hypot(x[near] - x[end], y[near] - y[end]) for end in (first, last)]
        i, j = (near[one.argmin()] for one in away)
        size = max(one.min() for one in away)
        if size < REACH_M and abs(x[j] - x[i]) < MOST_LEAN * abs(y[j] - y[i]):
            lean = float((x[j] - x[i]) / (y[j] - y[i]))
            moved = Side(float(x[i] - lean * y[i]), lean, False, side.sigma)
            yield Repair(float(size), {which: moved})
    for e in np.flatnonzero(on_side & is_low(gaps)):
        line = fold_line(drawn, places, int(e), edge)
        if line is not None:
            moved = Side(line[0], line[1], False, side.sigma)
            shift = np.abs(moved.at - side.at + (moved.lean - side.lean) * y[drawn.edges[e]]).max()
            if shift < REACH_M:
                yield Repair(float(shift), {which: moved})


def fold_line(drawn: DrawnPlan, places: np.ndarray, e: int, edge: int) -> tuple[float, float] | None:
    """The line on which the planes beside edge `e` of the plan meet, in a volume's axes.

    It is x = at + lean y with x across the volume's side `edge`; None where there is none to speak
    of.
    """
    left, right = drawn.planes[drawn.beside[e]]
    at = np.column_stack([drawn.places, np.ones(len(places))])
    apart = at @ (left - right)  # linear in the places: read off it in the volume's axes
    own = np.column_stack([places, np.ones(len(places))])
    (a, b, c), *_ = np.linalg.lstsq(own, apart, rcond=None)
    fall, across = (a, b) if edge < 2 else (b, a)
    if not abs(fall) > LEAST_BREAK or not abs(across / fall) < MOST_LEAN:
        return None
    return float(-c / fall), float(-across / fall)


def low_steps(drawn: DrawnPlan, gaps: np.ndarray) -> Iterator[Repair]:
    """Yield, for two planes with a low step between, that they meet along it or are one."""
    highest = gaps.max(axis=1)
    low = np.flatnonzero(is_low(gaps))
    pairs = np.sort(drawn.beside[low], axis=1)
    for pair in np.unique(pairs, axis=0):
        own = low[(pairs == pair).all(axis=1)]
        places = drawn.places[np.unique(drawn.edges[own])]
        spread = np.linalg.norm(places[:, None] - places, axis=2)
        i, j = np.unravel_index(spread.argmax(), spread.shape)
        terms = equal(drawn, *pair)
        size = float(highest[own].max())
        yield Repair(size, equations=((places[i], terms), (places[j], terms)))
        apart = np.hypot(*(drawn.planes[pair[0]] - drawn.planes[pair[1]])[:2])
        if apart < LEAST_BREAK:
            aside = places[i] + np.array([[0.0, -1.0], [1.0, 0.0]]) @ (places[j] - places[i])
            equations = tuple((place, terms) for place in (places[i], places[j], aside))
            yield Repair(size, equations=equations)


def is_low(gaps: np.ndarray) -> np.ndarray:
    """Which edges (e,) are low steps, by how far apart their planes are at their ends (e, 2)."""
    return (gaps.max(axis=1) > NO_STEP_M) & (gaps.max(axis=1) < LOW_STEP_M)


def equal(drawn: DrawnPlan, one: int, other: int) -> tuple[tuple[float, tuple[int, int]], ...]:
    """The terms of an equation: two planes have the same height."""
    owners = drawn.owner[[one, other]].tolist()
    return (1.0, (owners[0][0], owners[0][1])), (-1.0, (owners[1][0], owners[1][1]))
