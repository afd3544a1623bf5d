"""Houses that touch, separated where their roofs differ all along a straight line.

A bond joins two neighbouring points in plan; it holds where one surface goes on from one to the
other. A line is crossed by bonds in runs; it may cut the block in those runs across which hardly
any holds, from border to border, where that leaves roof enough for a house on either side. The best
cut is made, then both sides are looked at again. A row of equal houses stays one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely

from ..fit.direction import measure_support, quarter_gap
from ..geometry.grid import expand
from ..geometry.rings import intersect, subtract, unite
from .surfaces import Surfaces, find_surfaces

BOND_REACH_M, REACH_SPACINGS = 1.25, 2.2  # length of a bond, at most
CUT_STEP_M = 0.2  # surfaces that miss each other by less go on
ROUGH_STEP_M = 0.5  # so much higher or lower than what is no surface
UPRIGHT = 0.25  # cosine of the slope from which a surface is a wall
HOLD = 3.0  # what a bond that holds counts against one that does not
AWAY_M = 0.5  # of a line: nearer to it is its own border
SHORT_M = 0.3  # bonds count by their shortness down to this
# m between the lines that cuts are looked for on, at first and when refined; m of a line judged as
# one stretch
LINE_M, FINE_LINE_M, STRETCH_M = 0.25, 0.1, 0.5
NEXT_M = 2.0  # what lies so far from a line tells what is on its sides
# degrees that a cut is turned by, and m that it is moved by at most, when it is refined
FINE_TURNS_DEG, FINE_SHIFT_M = (-4.0, -2.0, 0.0, 2.0, 4.0), 0.6
LEAST_APART, LEAST_GAIN, LEAST_LENGTH_M = (
    0.7,
    0.35,
    3.0,
)  # of a run: share of stretches that nothing holds; gain a metre
COARSE_CUT_M = 0.5  # of these two for lines that are not yet in their place
LEAST_HOUSE_M2, LEAST_DEPTH_M = 25.0, 4.0  # of roof on either side, and by the metre of the cut
NECK_M = 1.5  # what is narrower joins no houses
MAX_CUTS_TRIED = 20  # cuts tried of an area, the best first
LIKE_DEG, LIKE_M = 12.0, 1.0  # degrees and m within which two cuts are one
# degrees within which edges and slopes support a direction, and between two directions; how many at
# most; least share of all support
DIRECTION_DEG, APART_DEG, MOST_DIRECTIONS, LEAST_SUPPORT = 3.0, 8.0, 6, 0.05
STRAIGHT_M = 0.7  # corners of the block's border that are none


class Bonds(NamedTuple):
    """Pairs of neighbouring points (b, 2), by their numbers.

    `ends` (b, 2, 2) are their places in plan and `middle` (b, 2) lies between these. `state` (b,)
    is HELD, LOOSE, or UNKNOWN between leaves, and by `weight` (b,) short ones count more.
    """

    points: np.ndarray
    ends: np.ndarray
    middle: np.ndarray
    state: np.ndarray
    weight: np.ndarray

    def among(self, selection: np.ndarray) -> Bonds:
        """Select bonds by `selection` (b,)."""
        number = np.flatnonzero(selection)
        return Bonds(*(values[number] for values in self))

    def inside(self, area: shapely.Geometry) -> Bonds:
        return self.among(shapely.intersects_xy(area, self.middle))

    def across(self, cut: Cut) -> np.ndarray:
        """Return how far (b, 2) the ends lie before the line of a cut."""
        return (self.ends.reshape(-1, 2) @ cut.normal - cut.offset).reshape(-1, 2)


HELD_BOND, LOOSE, UNKNOWN_BOND = 0, 1, 2  # states of a bond between neighbouring points


@dataclass(frozen=True)
class Cut:
    """The line at `offset` (m) along `normal` (2,), which bonds cross in runs.

    `runs` (r, 4) are low and high (m along it), whether it may be cut there, and the evidence for
    that (m).
    """

    normal: np.ndarray
    offset: float
    runs: np.ndarray

    @cached_property
    def along(self) -> np.ndarray:
        return np.array([-self.normal[1], self.normal[0]])

    @property
    def gain(self) -> float:
        return float(self.runs[self.runs[:, 2] > 0, 3].sum())

    @cached_property
    def longest(self) -> np.ndarray:
        """The longest run (4,) in which it may be cut."""
        runs = self.runs[self.runs[:, 2] > 0]
        return runs[(runs[:, 1] - runs[:, 0]).argmax()]

    @property
    def length(self) -> float:
        return float(self.longest[1] - self.longest[0])

    @cached_property
    def middle(self) -> np.ndarray:
        return self.at(self.longest[:2].mean())

    def at(self, u: float, v: float = 0.0) -> np.ndarray:
        """Return the place (2,) `u` along the line and `v` before it."""
        return (self.offset + v) * self.normal + u * self.along

    def is_like(self, other: Cut) -> bool:
        """Return whether both run nearly the same way in nearly the same place."""
        turn = abs(self.normal @ other.normal)
        distance = abs(self.middle @ other.normal - other.offset)
        lower, upper = other.longest[:2]
        mask = lower < self.middle @ other.along < upper
        return bool(mask and distance < LIKE_M and turn > math.cos(math.radians(LIKE_DEG)))


def separate_houses(
    xyz: np.ndarray, area: shapely.Geometry, gap_m: float
) -> list[shapely.Geometry]:
    """Return the areas of the single houses among roof points (n, 3) in `area`, world metres.

    Together the houses are the area. Parts of the area within `gap_m` of each other are one block.

    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0.2, 16, 0.4), np.arange(0.2, 9,
    ...     0.4)))
    >>> pair = np.column_stack([x, y, np.where(x < 8, 6.0, 7.0) - 0.6 * abs(y - 4.5)])
    >>> [bool(abs(house.area - 72) < 1.5) for house in separate_houses(pair, shapely.box(0, 0, 16,
    ...     9),
    ...     1.0)]
    [True, True]
    """
    origin = np.floor(xyz.min(axis=0))
    surfaces = find_surfaces(xyz - origin)
    roof = is_roof(surfaces)
    normal = surfaces.normal[roof]
    roofs = Roofs(surfaces.xyz[roof, :2], surfaces.own_m2[roof] * np.abs(normal[:, 2]), normal)
    bonds = find_bonds(surfaces)
    houses = [
        intersect(house, block)
        for block in without_necks(
            shapely.transform(area, lambda xy: xy - origin[:2]), gap_m, roofs
        )
        for house in houses_in(shapely.buffer(block, gap_m, join_style="mitre"), roofs, bonds)
    ]
    if len(houses) == 1:
        return [area]
    return [shapely.transform(house, lambda xy: xy + origin[:2]) for house in houses]


def without_necks(area: shapely.Geometry, gap_m: float, roofs: Roofs) -> list[shapely.Geometry]:
    """Split `area` at necks of hardly any roof, where a gutter or a tree joins its parts."""
    wide = shapely.buffer(
        shapely.buffer(area, 0.5 * gap_m, join_style="mitre"),
        -0.5 * (gap_m + NECK_M),
        join_style="mitre",
    )
    sides, remainder = [], area
    for part in shapely.get_parts(wide):
        side = shapely.buffer(part, 0.5 * NECK_M, join_style="mitre")
        sides.append(intersect(remainder, side))
        remainder = subtract(remainder, side)
    return with_crumbs([*sides, *shapely.get_parts(remainder)], roofs)


def houses_in(area: shapely.Geometry, roofs: Roofs, bonds: Bonds) -> list[shapely.Geometry]:
    """Cut `area` at the best cut that leaves a house on either side, repeatedly."""
    if roof_m2(area, roofs) < 2 * LEAST_HOUSE_M2:
        return [area]
    bonds = bonds.inside(area)
    for rough in best_cuts(bonds, find_directions(area, roofs)):
        cut = refine_cut(rough, bonds)
        if cut is None:
            continue
        sides = with_crumbs(cut_area(area, cut), roofs)
        if len(sides) > 1 and all(depth_m(side, cut, roofs) > LEAST_DEPTH_M for side in sides):
            return [house for side in sides for house in houses_in(side, roofs, bonds)]
    return [area]


def is_roof(surfaces: Surfaces) -> np.ndarray:
    return surfaces.is_smooth & (np.abs(surfaces.normal[:, 2]) > UPRIGHT)


class Roofs(NamedTuple):
    """Voxels on smooth surfaces, no walls: places (r, 2), `m2` (r,) in plan, normals (r, 3)."""

    xy: np.ndarray
    m2: np.ndarray
    normal: np.ndarray


def roof_m2(area: shapely.Geometry, roofs: Roofs) -> float:
    """Return how much of `area` (m2) lies under roofs, in plan."""
    shapely.prepare(area)
    return float(roofs.m2[shapely.intersects_xy(area, roofs.xy)].sum())


def depth_m(side: shapely.Geometry, cut: Cut, roofs: Roofs) -> float:
    """Return twice how far (m) half of the roof on a `side` of the cut lies away from it."""
    inside = shapely.intersects_xy(side, roofs.xy)
    return 2.0 * float(np.median(np.abs(roofs.xy[inside] @ cut.normal - cut.offset)))


def find_bonds(surfaces: Surfaces) -> Bonds:
    """Find all pairs of neighbours in plan, without walls.

    A surface holds both where the plane of one goes through the other, or where their planes meet
    between them (a ridge, a valley).
    """
    from scipy.spatial import cKDTree

    mask = is_roof(surfaces) | ~surfaces.is_smooth
    xyz, normal, smooth = (
        values[mask] for values in (surfaces.xyz, surfaces.normal, surfaces.is_smooth)
    )
    points = np.empty((0, 2), np.int64)
    if len(xyz) > 1:
        tree = cKDTree(xyz[:, :2])
        reach = REACH_SPACINGS * np.median(tree.query(xyz[:, :2], k=2)[0][:, 1])
        points = tree.query_pairs(max(BOND_REACH_M, reach), output_type="ndarray")
    item, other = points.T
    slope = -normal[:, :2] / np.where(np.abs(normal[:, 2]) < UPRIGHT, 1.0, normal[:, 2])[:, None]
    between = xyz[other] - xyz[item]
    above = between[:, 2] - (slope[item] * between[:, :2]).sum(axis=1)
    below = -between[:, 2] + (slope[other] * between[:, :2]).sum(axis=1)
    goes_on = (np.minimum(np.abs(above), np.abs(below)) < CUT_STEP_M) | (above * below > 0)
    rough = np.where(np.abs(between[:, 2]) > ROUGH_STEP_M, LOOSE, UNKNOWN_BOND)
    state = np.where(smooth[item] & smooth[other], np.where(goes_on, HELD_BOND, LOOSE), rough)
    ends, length = xyz[points, :2], np.hypot(between[:, 0], between[:, 1])
    return Bonds(points, ends, ends.mean(axis=1), state, 1.0 / np.maximum(length, SHORT_M))


def find_directions(area: shapely.Geometry, roofs: Roofs) -> np.ndarray:
    """Return the azimuths (d,) of cuts: along and across slopes and the block's border."""
    shapely.prepare(area)
    normal = roofs.normal[shapely.intersects_xy(area, roofs.xy)]
    rings = [
        np.diff(shapely.get_coordinates(p.exterior), axis=0)
        for p in shapely.get_parts(area.simplify(STRAIGHT_M))
        if not p.is_empty
    ]
    x, y = np.concatenate([normal[:, :2], *rings]).T
    steep, long = np.split(np.hypot(x, y), [len(normal)])
    weight = np.r_[steep / max(steep.sum(), 1e-9), long / long.sum()]
    candidates = np.radians(np.arange(0.0, 90.0, 1.0))
    support = measure_support(candidates, np.arctan2(y, x), weight, math.radians(DIRECTION_DEG))
    result: list[float] = []
    for k in np.argsort(-support):
        gaps = [abs(quarter_gap(candidates[k] - other)) for other in result]
        is_new = min(gaps, default=math.pi) > math.radians(APART_DEG)
        if is_new and support[k] > LEAST_SUPPORT * weight.sum() and len(result) < MOST_DIRECTIONS:
            result.append(candidates[k])
    return np.array([turned for angle in result for turned in (angle, angle + 0.5 * math.pi)])


def best_cuts(bonds: Bonds, directions: np.ndarray) -> list[Cut]:
    """Return the cuts in all `directions`, the best first, none near a better one."""
    cuts = [cut for angle in directions for cut in cuts_along(angle, bonds, LINE_M, COARSE_CUT_M)]
    best: list[Cut] = []
    for cut in sorted(cuts, key=lambda cut: -cut.gain):
        if len(best) < MAX_CUTS_TRIED and not any(cut.is_like(other) for other in best):
            best.append(cut)
    return best


def refine_cut(cut: Cut, bonds: Bonds) -> Cut | None:
    """Return the best line near `cut`, turned a little, at a tenth of a metre, or None."""
    x, y = bonds.middle.T
    away2 = (x - cut.middle[0]) ** 2 + (y - cut.middle[1]) ** 2
    nearby = bonds.among(away2 < (0.5 * cut.length + 2.0) ** 2)
    angle = math.atan2(cut.normal[1], cut.normal[0])
    candidates = [
        other
        for turn in np.radians(FINE_TURNS_DEG)
        for other in cuts_along(angle + turn, nearby, FINE_LINE_M)
        if abs(other.normal @ cut.middle - other.offset) < FINE_SHIFT_M
        and other.length > 0.7 * cut.length
    ]
    if not candidates:
        return None
    best = max(candidates, key=lambda other: other.gain)
    item, other = bonds.across(best).T
    crossing = bonds.among((np.minimum(item, other) < NEXT_M) & (np.maximum(item, other) > -NEXT_M))
    whole = cuts_along(math.atan2(best.normal[1], best.normal[0]), crossing, FINE_LINE_M)
    return next(
        (other for other in whole if abs(other.offset - best.offset) < 0.5 * FINE_LINE_M), None
    )


def cuts_along(angle: float, bonds: Bonds, lines_m: float, strictness: float = 1.0) -> list[Cut]:
    """Return cuts along lines, `lines_m` apart, whose normal has the azimuth `angle`."""
    if not len(bonds.state):
        return []
    normal = np.array([math.cos(angle), math.sin(angle)])
    crossed, first, start = crossings(bonds, normal, lines_m)
    crossed *= is_between(bonds, normal, lines_m, first, start, crossed.shape[1:])
    line, runs = find_runs(crossed, start, strictness * LEAST_APART)
    length = runs[:, 1] - runs[:, 0]
    is_long = (
        (runs[:, 2] > 0)
        & (runs[:, 3] > strictness * LEAST_GAIN * length)
        & (length >= LEAST_LENGTH_M)
    )
    return [Cut(normal, (first + k) * lines_m, runs[line == k]) for k in np.unique(line[is_long])]


def crossings(bonds: Bonds, normal: np.ndarray, lines_m: float) -> tuple[np.ndarray, int, float]:
    """Count the bonds of each state that cross each stretch of each line.

    Returns counts (3, lines, stretches) by the bonds' weight, the first line's number, and where
    the first stretch begins along it.
    """
    x, y = bonds.ends[:, :, 0], bonds.ends[:, :, 1]
    c, s = normal / lines_m
    v, u = c * x + s * y, (c * y - s * x) * (lines_m / STRETCH_M)
    first, start = math.floor(v.min()), math.floor(u.min())
    order = np.argsort(v, axis=1)
    (v_low, v_high), (u_low, u_high) = (np.take_along_axis(w, order, axis=1).T for w in (v, u))
    slope = (u_high - u_low) / np.maximum(v_high - v_low, 1e-9)
    begin = np.ceil(v_low).astype(np.int64)
    bond, step = expand(np.maximum(np.floor(v_high).astype(np.int64) - begin + 1, 0))
    line = begin[bond] + step
    stretch = (u_low[bond] + (line - v_low[bond]) * slope[bond] - start).astype(np.int64)
    size = math.floor(v.max()) - first + 1, math.floor(u.max()) - start + 1
    crossed = np.zeros((3, *size))
    np.add.at(crossed, (bonds.state[bond], line - first, stretch), bonds.weight[bond])
    return crossed, first, start * STRETCH_M


def is_between(
    bonds: Bonds, normal: np.ndarray, lines_m: float, first: int, start: float, shape: Sequence[int]
) -> np.ndarray:
    """Return whether points lie on both sides of lines at stretches; borders are not cut."""
    x, y = bonds.ends.reshape(-1, 2)[np.unique(bonds.points, return_index=True)[1]].T
    v = x * normal[0] + y * normal[1]
    stretch = ((y * normal[0] - x * normal[1] - start) / STRETCH_M).astype(np.int64)
    near_line = np.zeros((2, *shape), bool)
    for side, lower in enumerate((v + AWAY_M, v - AWAY_M - BOND_REACH_M)):
        begin = np.maximum(np.ceil(lower / lines_m).astype(np.int64) - first, 0)
        end = np.floor((lower + BOND_REACH_M) / lines_m).astype(np.int64) - first + 1
        point, step = expand(np.maximum(np.minimum(end, shape[0]) - begin, 0))
        near_line[side, begin[point] + step, stretch[point]] = True
    return near_line[0] & near_line[1]


def find_runs(
    crossed: np.ndarray, start: float, least_apart: float
) -> tuple[np.ndarray, np.ndarray]:
    """Find the runs of stretches that bonds cross.

    Returns for each its line (m,), and low, high, whether hardly any bond holds, and gain (m, 4). A
    run goes on beyond a single stretch that none crosses.
    """
    line, stretch = np.nonzero(crossed.sum(axis=0) > 0.0)
    held, loose, unknown = crossed[:, line, stretch]
    is_first = np.append(True, (np.diff(line) > 0) | (np.diff(stretch) > 2))[: len(line)]
    begins = np.flatnonzero(is_first)
    run = np.cumsum(is_first) - 1
    count, gaps = np.bincount(run), np.bincount(run, loose > HOLD * held)
    gain = np.bincount(run, STRETCH_M * (loose - HOLD * held) / (held + loose + unknown))
    last = stretch[np.append(is_first[1:], True)[: len(line)]]
    low, high = start + stretch[begins] * STRETCH_M, start + (last + 1) * STRETCH_M
    return line[begins], np.column_stack([low, high, gaps >= least_apart * count, gain])


def cut_area(area: shapely.Geometry, cut: Cut) -> list[shapely.Geometry]:
    """Return the parts of `area` after a cut, together where they join beyond its ends."""
    distant = 2.0 * math.hypot(*np.ptp(np.array(area.bounds).reshape(2, 2), axis=0)) + 10.0
    lower, upper = cut.middle @ cut.along - distant, cut.middle @ cut.along + distant
    line, parts = [cut.at(lower), cut.at(upper)], []
    for away in (-distant, distant):
        half = shapely.Polygon([*line, cut.at(upper, away), cut.at(lower, away)])
        parts += [part for part in shapely.get_parts(intersect(area, half)) if part.area > 0.0]
    group, fixed = list(range(len(parts))), cut.runs[cut.runs[:, 2] == 0]
    for segment in shapely.get_parts(shapely.intersection(area, shapely.LineString(line))):
        u = shapely.get_coordinates(segment) @ cut.along
        if not segment.length or not ((fixed[:, 0] < u.max()) & (fixed[:, 1] > u.min())).any():
            continue
        across = [shapely.Point(cut.at(u.mean(), side * 0.01)) for side in (-1, 1)]
        item, other = (group[int(np.argmin(shapely.distance(parts, point)))] for point in across)
        group = [item if number == other else number for number in group]
    return [
        join_areas([p for p, g in zip(parts, group, strict=True) if g == number])
        for number in sorted(set(group))
    ]


def with_crumbs(sides: list[shapely.Geometry], roofs: Roofs) -> list[shapely.Geometry]:
    """Return the sides as large as a house, with the smaller ones nearest to each."""
    large: list[shapely.Geometry] = []
    crumbs: list[shapely.Geometry] = []
    for side in sides:
        (large if roof_m2(side, roofs) >= LEAST_HOUSE_M2 else crumbs).append(side)
    if len(large) < 2:
        return [join_areas(sides)]
    houses = [[side] for side in large]
    for side in crumbs:
        houses[int(np.argmin(shapely.distance(side, large)))].append(side)
    return [join_areas(house) for house in houses]


def join_areas(areas: list[shapely.Geometry]) -> shapely.Geometry:
    """Return the union of polygons that share nothing but border."""
    return unite(areas) if len(areas) > 1 else areas[0]
