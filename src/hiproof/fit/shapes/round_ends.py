"""Find round roofs and half cones over round stretches of an outline.

Such a stretch is a run of short sides that turn alike. It gives the middle and the radius of the
shape: of an apse from half a circle, and of a turret from more. Points give the heights.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
import shapely
from shapely import affinity

from ...geometry.rings import OVERLAY_GRID_M, counterclockwise
from ...model import Part
from ...primitives.catalogue import CATALOGUE
from ...primitives.contract import CX, CY, HALF_LENGTH, KAPPA, Q0, Q1, Primitive
from ...primitives.facets import find_apothem
from ..regular import REGULAR, fit_regular, list_heights
from .custom import cut_part
from .judged import JudgedRoof
from .regions import list_polygons
from .round_tops import FOLLOW_M, is_top_seen, make_part
from .spires import SIDES_OF_SPIRES

# Turns (degrees) between sides that follow a circle, or a polygon of six sides or more.
LEAST_TURN_DEG, MOST_TURN_DEG = 3.0, 65.0
FEWEST_ROUND_SIDES = 11  # A circle has as many sides or more.
FEWEST_CORNERS = 4  # Fewer lie on some circle by chance.
SHORTEST_ARC_DEG = 120.0  # Shorter arcs are round corners of a roof, not shapes of their own.
APSE_DEG = (140.0, 220.0)  # Arcs of half discs.
WHOLE_DISCS = ("cone", "dome", "onion")  # Types over a whole disc.
MOVABLE = ("cone", "dome")  # Types whose top may lie beside the middle of the arc.
TURRET_DEG = 150.0  # Shortest arc of a whole disc.
ON_CIRCLE = 0.03  # Farthest that a corner lies off its circle, in shares of the radius.
WHOLE_CIRCLE_DEG = 359.0  # Longer arcs are whole circles.
SECTOR_REACH = 2.0  # A sector of so many radii holds all of a shape beyond its arc.
LARGEST_RADIUS_M = 30.0  # Larger circles are bent facades.
SLOPES_TRIED = 24  # Slopes, in equal ratios, from which the likeliest start is taken.
BULGES_TRIED, BENDS_TRIED = 10, 7  # The same of the two slopes of an onion.
LOOSE_REACH = 3.0  # So much further from a start may points lie that follow it.
FOLLOW_ROUNDS = 3  # Rounds in which a shape is fitted to the points that follow it.
FEWEST_HEIGHTS = 6  # A slope and a height, and as many points again to check them.


@dataclass(frozen=True)
class RoundEnd:
    """An arc of an outline: the `centre` (2,) and `radius` (m) of its circle.

    `kappa` (rad) leads from the centre to the middle of the arc, and `facing` to that of a side.
    `span_deg` is the arc's length, and the polygon `area` lies between it and its chord. `sides`
    are those of a whole circle of its kind.
    """

    area: shapely.Polygon
    centre: np.ndarray
    radius: float
    kappa: float
    facing: float
    span_deg: float
    sides: int

    @property
    def is_round(self) -> bool:
        """Whether the arc stands for a circle rather than for a polygon."""
        return self.sides >= FEWEST_ROUND_SIDES

    @property
    def is_half_disc(self) -> bool:
        """Whether it may be an apse, by the length of its arc."""
        return self.is_round and APSE_DEG[0] <= self.span_deg <= APSE_DEG[1]

    @property
    def way(self) -> np.ndarray:
        """The unit vector (2,) of `kappa`."""
        return np.array([math.cos(self.kappa), math.sin(self.kappa)])


def find_round_ends(outline: shapely.Polygon) -> list[RoundEnd]:
    """Find the arcs of an outline that are long enough for a roof of their own."""
    ring = counterclockwise(outline.exterior)
    x, y = (ring[1:] - ring[:-1]).T
    angles = np.arctan2(y, x)
    before = np.concatenate([angles[-1:], angles[:-1]])
    turns = np.degrees((angles - before + math.pi) % (2.0 * math.pi) - math.pi)
    is_bend = (turns >= LEAST_TURN_DEG) & (turns <= MOST_TURN_DEG)
    if np.count_nonzero(is_bend) < FEWEST_CORNERS:
        return []
    ends = (fit_round_end(ring[:-1][run]) for run in list_runs(is_bend))
    return [end for end in ends if end is not None]


def list_runs(mask: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the places of each run of true values around a ring.

    There is one more at each end.
    """
    if mask.all():
        yield np.arange(len(mask) + 1) % len(mask)
        return
    start = int(np.argmin(mask))
    order = (start + np.arange(len(mask))) % len(mask)
    breaks = np.flatnonzero(~mask[order])
    for first, last in zip(breaks, [*breaks[1:], len(mask)], strict=True):
        if last - first - 1 >= FEWEST_CORNERS:
            yield order[np.arange(first, last + 1) % len(mask)]


def fit_round_end(corners: np.ndarray) -> RoundEnd | None:
    """Return the arc of a run of corners (n, 2), None if they lie on none.

    Its first and last corner may lie off the circle.
    """
    inner = corners[1:-1]
    design = np.column_stack([2.0 * inner, np.ones(len(inner))])
    origin = inner.mean(axis=0)
    design[:, :2] -= 2.0 * origin
    x, y, rest = np.linalg.lstsq(design, ((inner - origin) ** 2).sum(axis=1), rcond=None)[0]
    radius = math.sqrt(max(rest + x * x + y * y, 0.0))
    centre = origin + (x, y)
    distances = np.abs(np.hypot(*(corners - centre).T) - radius)
    if radius > LARGEST_RADIUS_M or distances[1:-1].max() > ON_CIRCLE * radius:
        return None
    arc = corners[distances <= ON_CIRCLE * radius]
    way = np.unwrap(np.arctan2(*(arc - centre).T[::-1]))
    span = math.degrees(way[-1] - way[0])
    if span < SHORTEST_ARC_DEG:
        return None
    step = math.radians(span / (len(arc) - 1))
    radius *= math.sqrt(math.sin(step) / step)  # of the circle with the same area
    area = shapely.make_valid(shapely.Polygon(arc))
    sides = round(2.0 * math.pi / step)
    middle, facing = (float(0.5 * (way[0] + way[k])) for k in (-1, 1))
    return RoundEnd(area, centre, radius, middle, facing, span, sides)


def list_end_shapes(roof: JudgedRoof, end: RoundEnd, names: list[str]) -> Iterator[Part]:
    """Yield shapes of the types `names` over a round end, fitted to the points there.

    A half cone has its apex at the middle of the circle.
    """
    for name in names:
        if name in WHOLE_DISCS and end.is_round and end.span_deg >= TURRET_DEG:
            yield from fit_over_circle(roof, end, name, end.radius)
        elif end.sides == SIDES_OF_SPIRES.get(name) and end.span_deg >= TURRET_DEG:
            yield from fit_over_circle(roof, end, name, end.radius * find_apothem(end.sides))
        elif name == "half_cone" and end.is_half_disc:
            yield from fit_over_circle(roof, end, name, end.radius)


def fit_over_circle(roof: JudgedRoof, end: RoundEnd, name: str, radius: float) -> Iterator[Part]:
    """Yield a shape of the type `name` over the circle of a round end, or half of it.

    Its plan in theta has the `radius`.
    """
    from ..likelihood import fit_heights  # compiled code that most roofs never need

    shape = CATALOGUE[name]
    theta = np.array([*end.centre, end.facing, radius, radius, 0.0, 0.0, 0.0, 0.0])
    if name == "half_cone":
        theta[KAPPA] = end.kappa
        theta[HALF_LENGTH] *= 0.5
        theta[:KAPPA] += 0.5 * radius * end.way
    plan = shape.part(theta).pieces[0].outline
    points = roof.points[shapely.contains_xy(plan, *roof.points[:, :2].T)]
    if len(points) < FEWEST_HEIGHTS:
        return
    theta, follows = find_start(points, shape, theta)
    cloud = np.column_stack([points, np.ones(len(points))])
    for _ in range(FOLLOW_ROUNDS):
        if np.count_nonzero(follows) < FEWEST_HEIGHTS:
            return
        theta, _ = fit_heights(cloud[follows], shape, theta)
        reach = FOLLOW_M * math.hypot(1.0, theta[Q1 : Q1 + len(shape.bounds)].sum())
        follows = np.abs(points[:, 2] - shape.height_at(theta, points[:, :2])) <= reach
    heights = list_heights(shape)
    if name in REGULAR:
        theta = fit_regular(points, shape, theta, heights)
    yield from make_end_part(points, shape, theta, heights, end, roof)
    if name in MOVABLE:
        theta = fit_regular(points, shape, theta, (CX, CY, *heights))
        yield from make_end_part(points, shape, theta, (CX, CY, *heights), end, roof)


def make_end_part(
    points: np.ndarray,
    shape: Primitive,
    theta: np.ndarray,
    free: tuple[int, ...],
    end: RoundEnd,
    roof: JudgedRoof,
) -> Iterator[Part]:
    """Yield the part of theta (9,) up to the arc, if points (n, 3) show its top."""
    part = make_part(points, shape, theta, free)
    if is_top_seen(part, points):
        yield from cut_to_outline(part, end, roof.outline)


def find_start(
    points: np.ndarray, shape: Primitive, theta: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return theta (9,) with the height and slopes that most points follow.

    They are those of a shape with the plan of `theta`. With it comes which of the points (n, 3)
    these are (n,).
    """
    best, most, followers = theta, 0, np.zeros(len(points), bool)
    for slopes in list_slopes(shape):
        trial = theta.copy()
        trial[Q1 : Q1 + len(slopes)] = slopes
        above = points[:, 2] - shape.height_at(trial, points[:, :2])
        lowest = np.sort(above)
        reach = FOLLOW_M * math.hypot(1.0, sum(slopes))
        counts = np.searchsorted(lowest, lowest + 2.0 * reach, side="right") - np.arange(len(above))
        first = int(np.argmax(counts))
        if counts[first] > most:
            most, best = int(counts[first]), trial
            best[Q0] = float(lowest[first : first + most].mean())
            followers = np.abs(above - best[Q0]) <= LOOSE_REACH * reach
    return best, followers


def list_slopes(shape: Primitive) -> list[tuple[float, ...]]:
    """Return slopes between the bounds of a shape.

    A shape with two has fewer values of each.
    """
    (lowest, highest), *others = shape.bounds
    if not others:
        return [(slope,) for slope in np.geomspace(lowest, highest, SLOPES_TRIED).tolist()]
    first = np.geomspace(lowest, highest, BULGES_TRIED).tolist()
    second = np.linspace(*others[0], BENDS_TRIED).tolist()
    return list(product(first, second))


def cut_to_outline(shape: Part, end: RoundEnd, outline: shapely.Polygon) -> Iterator[Part]:
    """Yield the shape over its plan and up to the arc, as far as the outline reaches."""
    plan = follow_arc(shape.pieces[0].outline, end)
    polygons = list_polygons(shapely.intersection(plan, outline, grid_size=OVERLAY_GRID_M))
    if polygons:
        yield cut_part(shape, max(polygons, key=lambda polygon: polygon.area))


def follow_arc(plan: shapely.Polygon, end: RoundEnd) -> shapely.Geometry:
    """Return a plan over the circle of a round end with the corners of its arc."""
    if end.span_deg >= WHOLE_CIRCLE_DEG or not isinstance(end.area, shapely.Polygon):
        return shapely.union(plan, end.area, grid_size=OVERLAY_GRID_M)
    arc = shapely.get_coordinates(end.area.exterior)[:-1]
    sector = shapely.make_valid(shapely.Polygon([end.centre, *arc]))
    beyond = affinity.scale(sector, SECTOR_REACH, SECTOR_REACH, origin=tuple(end.centre))
    rest = shapely.difference(plan, beyond, grid_size=OVERLAY_GRID_M)
    return shapely.union(rest, sector, grid_size=OVERLAY_GRID_M)
