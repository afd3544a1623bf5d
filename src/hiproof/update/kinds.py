"""What changed of a building.

It follows from the earlier model, the new one and the cells between them.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import shapely

from ..model import Roof
from ..status import ChangeKind
from .cells import MEDIAN_VARIANCE, CellComparison, find_slopes
from .clusters import describe_cluster
from .judge import (
    FEWEST_COMPARED,
    OVER_GROUND_M,
    SMALL_M2,
    SMALLEST_M2,
    ChangeVerdict,
    find_heights,
)
from .lineage import show_parts

ALIKE_SHARE, ALIKE_M = 0.2, (0.1, 0.25)
"""Cells moved together whose differences are within this share of their median, and within bounds
(m): two standard deviations of a cell, and what a chimney or an edge does to its median."""

TOGETHER = 0.75
"""Share of the cells that have to move alike: chimneys and edges do not."""

CROSSING, HALF = 0.2, 0.5
"""Shares of a roof's cells that contradict it where its type, or its slope, is another: the more
alike two roofs are, the more cells both have in common."""

SAME_SLOPE = 0.06
"""Gradient by which a roof's slopes may differ between two models: 2.5 degrees at 40. A change of
0.5 m over half the width of a house is twice as much."""

LARGER = 0.1
"""Share of a roof's cells from which on a part of it has to take part in a change of the whole."""

AS_ONE_SHARE = 0.65
"""Share of a part's cells, or of a building's, from which on it changed as one."""

LEAST_BARE_M2 = 1.0
"""Area (m2) of cells that lie bare where a part was lost or a roof stands elsewhere: of one that is
turned, its corners. Cells along walls count for neither side."""

SAME_PART = 0.6
"""Intersection over union from which on two parts take the same place."""

THIN_LAYER_M = 0.25
"""Height (m) below which an addition is a layer on the roof, such as solar panels."""

FAMILIES = (
    ("gable", "asymmetric_gable"),
    ("hip", "half_hip", "side_hip", "pyramid"),
    ("mansard", "side_mansard", "half_mansard", "truncated_gable"),
    ("monopitch", "flat"),
)
"""Types that one roof may be called by, depending on its points."""


@dataclass(frozen=True)
class Difference:
    """A place where the roof changed.

    It has the kind of change, the height difference with its sigma, and the area.

    `place` is in the roof's frame, `parts` the numbers of the earlier and the new part that take it
    up, -1 for none.
    """

    kind: ChangeKind
    area_m2: float
    place: shapely.Geometry
    parts: tuple[int, int] = (-1, -1)
    difference_m: float = math.nan
    sigma_m: float = math.nan


@dataclass(frozen=True)
class BeforeAfter:
    """The compared cells (k,) of a building, with the part that shows there before and after.

    `members` (k,) are their numbers in the `comparison`, `difference` (k,) is how much higher they
    lie now, and `on_ground` (k,) whether they do on the ground. The `after` of the two roofs, both
    in one frame, is None where none was found that explains the new points. `sigma_m` is the
    standard deviation of the common vertical shift.
    """

    comparison: CellComparison
    members: np.ndarray
    before: Roof
    after: Roof | None
    parts: tuple[np.ndarray, np.ndarray]
    difference: np.ndarray
    on_ground: np.ndarray
    sigma_m: float

    def find_pair(self, inside: np.ndarray) -> tuple[int, int]:
        """Return the parts that show at most of the cells `inside` (k,), -1 where none does."""
        first, second = (find_main(shown[inside]) for shown in self.parts)
        return first, second


def name_differences(
    verdict: ChangeVerdict, before: Roof, after: Roof | None, sigma_m: float
) -> list[Difference]:
    """Name what changed of a building, the largest place first.

    `after` is the new roof in the frame of the one `before`, None where no new roof explains the
    points.
    """
    c = verdict.comparison
    members = np.flatnonzero(c.is_compared)
    xy = c.centres[members]
    height = (find_heights(before, c) + c.new)[members] - verdict.ground.height_at(xy)
    shown_after = np.full(len(members), -1) if after is None else show_parts(after, xy)
    parts, on_ground = (show_parts(before, xy), shown_after), height < OVER_GROUND_M
    d = c.difference[members]
    sides = BeforeAfter(c, members, before, after, parts, d, on_ground, sigma_m)
    places = [np.isin(members, cluster.members) for cluster in verdict.clusters]
    whole = name_whole(np.logical_or.reduce([np.zeros(len(members), bool), *places]), sides)
    if whole is not None:
        return [whole]
    named = [
        name_place(cluster.area_m2 * piece.sum() / inside.sum(), piece, sides)
        for cluster, inside in zip(verdict.clusters, places, strict=True)
        for piece in split_bare(inside, sides)
    ]
    return sorted(named, key=lambda item: -item.area_m2)


def split_bare(inside: np.ndarray, sides: BeforeAfter) -> list[np.ndarray]:
    """Split the cells `inside` (k,) a cluster that is partly bare ground and partly roof."""
    pieces = [inside & sides.on_ground, inside & ~sides.on_ground]
    fewest = max(FEWEST_COMPARED, SMALLEST_M2 / sides.comparison.cell_m2)
    return pieces if min(piece.sum() for piece in pieces) >= fewest else [inside]


def name_doubts(verdict: ChangeVerdict) -> list[Difference]:
    """Return the places that make a building uncertain, all of it where none stands out."""
    c = verdict.comparison
    everywhere = np.flatnonzero(c.is_compared)
    clusters = verdict.clusters or (describe_cluster(c, everywhere, len(everywhere)),)
    return [
        Difference(
            ChangeKind.UNCLEAR,
            cluster.area_m2,
            draw_cells(c.cells[cluster.members], c.cell_m),
            difference_m=cluster.difference_m,
            sigma_m=cluster.sigma_m,
        )
        for cluster in clusters
    ]


def name_whole(inside: np.ndarray, sides: BeforeAfter) -> Difference | None:
    """Name the change of a roof as a whole, None where only places of it changed.

    `inside` (k,) are the cells of all clusters. A roof of another type or slope crosses the earlier
    one, so fewer cells contradict it. One that stands partly elsewhere was built anew.
    """
    d, everywhere = sides.difference, np.ones(len(inside), bool)
    moved, pair = find_moved(inside, d), sides.find_pair(everywhere)
    bare, kind = inside & sides.on_ground, None
    if not inside.any() or (
        moved.mean() >= AS_ONE_SHARE and moves_together(d) and has_all(moved, sides.parts[0])
    ):
        kind = ChangeKind.ROOF_RAISED if np.median(d) > 0 else ChangeKind.ROOF_LOWERED
    elif bare.sum() * sides.comparison.cell_m2 >= LEAST_BARE_M2:
        is_other = share_of_part(~bare, inside) >= HALF and not moves_together(d[~bare])
        kind = ChangeKind.REBUILT if is_other else None
    elif is_same_place(pair, sides) and not bare.any() and not moves_together(d[inside]):
        is_other = is_other_type(pair, sides)
        if not is_other and keeps_slope(inside, sides):
            return name_raised_aside(inside, pair, sides)
        if inside.mean() >= CROSSING and (is_other or turns(inside, pair, sides)):
            kind = ChangeKind.TYPE_CHANGED if is_other else ChangeKind.SLOPE_CHANGED
    return kind and describe_place(kind, everywhere, pair, sides)


def keeps_slope(inside: np.ndarray, sides: BeforeAfter) -> bool:
    """Return whether cells `inside` (k,) all went up, or all down, and slope as before."""
    d = sides.difference[inside]
    return d.min() * d.max() >= 0 and measure_turn(inside, sides) < SAME_SLOPE


def turns(inside: np.ndarray, pair: tuple[int, int], sides: BeforeAfter) -> bool:
    """Return whether the new part of a `pair` shows in cells `inside` (k,), and slopes otherwise.

    What was added to a roof is another part.
    """
    is_main = np.mean(sides.parts[1][inside] == pair[1]) >= AS_ONE_SHARE
    return bool(is_main and SAME_SLOPE < measure_turn(inside, sides) < math.inf)


def measure_turn(inside: np.ndarray, sides: BeforeAfter) -> float:
    """Return by how much (gradient) the slopes of both roofs differ in cells `inside` (k,)."""
    if sides.after is None:
        return math.inf
    xy = sides.comparison.centres[sides.members[inside]]
    before, after = (find_slopes(roof, xy) for roof in (sides.before, sides.after))
    off = np.hypot(*(after - before).T)
    known = off[np.isfinite(off)]
    return float(np.median(known)) if len(known) else math.inf


def name_raised_aside(
    inside: np.ndarray, pair: tuple[int, int], sides: BeforeAfter
) -> Difference | None:
    """Name a roof that lies higher or lower and aside: one slope moved by more than the other."""
    if inside.mean() < HALF:
        return None
    slopes = find_slopes(sides.before, sides.comparison.centres[sides.members])
    known = inside & np.isfinite(slopes).all(axis=1)
    design = np.column_stack([np.ones(known.sum()), slopes[known]])
    rise = float(np.linalg.lstsq(design, sides.difference[known], rcond=None)[0][0])
    kind = ChangeKind.ROOF_RAISED if rise > 0 else ChangeKind.ROOF_LOWERED
    place = describe_place(kind, np.ones(len(inside), bool), pair, sides)
    return dataclasses.replace(place, difference_m=rise)


def find_moved(inside: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return whether (k,) each cell moved like most of those `inside` (k,) all clusters.

    Cells lie higher by `d` (k,). The differences of many are too small to count by themselves.
    """
    return np.asarray(np.abs(d - np.median(d[inside])) < np.abs(d)) if inside.any() else inside


def has_all(inside: np.ndarray, shown: np.ndarray) -> bool:
    """Return whether half of the cells of each larger part `shown` (k,) are `inside` (k,)."""
    parts, counts = np.unique(shown, return_counts=True)
    larger = parts[counts >= LARGER * len(shown)]
    return min((share_of_part(shown == part, inside) for part in larger), default=1.0) >= HALF


def name_place(area_m2: float, inside: np.ndarray, sides: BeforeAfter) -> Difference:
    """Name the change of a place of a roof, whose cells are `inside` (k,)."""
    pair, stands = sides.find_pair(inside), ~sides.on_ground
    share_before, share_after = (
        share_of_part((shown == part) & stands, inside)
        for shown, part in zip(sides.parts, pair, strict=True)
    )
    is_part = share_before >= AS_ONE_SHARE and (len(sides.before.parts) > 1 or not stands.all())
    difference_m = float(np.median(sides.difference[inside]))
    together = moves_together(sides.difference[inside])
    if sides.on_ground[inside].mean() > HALF:
        kind = ChangeKind.PART_REMOVED
    elif is_part and is_same_place(pair, sides) and not (together or keeps_slope(inside, sides)):
        other = is_other_type(pair, sides)
        kind = ChangeKind.TYPE_CHANGED if other else ChangeKind.SLOPE_CHANGED
    elif area_m2 < SMALL_M2 or abs(difference_m) < THIN_LAYER_M:
        kind = ChangeKind.SMALL_OBJECT
    elif difference_m > 0:
        kind = ChangeKind.PART_RAISED if is_part else ChangeKind.PART_ADDED
    else:
        is_own = is_part or share_after >= AS_ONE_SHARE
        kind = ChangeKind.PART_LOWERED if is_own else ChangeKind.PART_REMOVED
    return dataclasses.replace(describe_place(kind, inside, pair, sides), area_m2=area_m2)


def describe_place(
    kind: ChangeKind, inside: np.ndarray, pair: tuple[int, int], sides: BeforeAfter
) -> Difference:
    """Return the place of a change over the cells `inside` (k,)."""
    c, members = sides.comparison, sides.members[inside]
    variance = MEDIAN_VARIANCE * np.mean(c.sigma[members] ** 2) / len(members)
    sigma = math.hypot(sides.sigma_m, math.sqrt(variance))
    middle, area = float(np.median(sides.difference[inside])), len(members) * c.cell_m2
    return Difference(kind, area, draw_cells(c.cells[members], c.cell_m), pair, middle, sigma)


def moves_together(differences: np.ndarray) -> bool:
    """Return whether most `differences` (n,) are the same."""
    middle = np.median(differences)
    alike = np.clip(ALIKE_SHARE * abs(middle), *ALIKE_M)
    return bool(np.mean(np.abs(differences - middle) < alike) >= TOGETHER)


def is_same_place(pair: tuple[int, int], sides: BeforeAfter) -> bool:
    """Return whether a part before and one after take the same place."""
    first, second = (shown == part for shown, part in zip(sides.parts, pair, strict=True))
    share = (first & second).sum() / max((first | second).sum(), 1)
    return min(pair) >= 0 and bool(share >= SAME_PART)


def find_main(parts: np.ndarray) -> int:
    """Return the part that shows at most of the cells, -1 where there is none."""
    known = parts[parts >= 0]
    return int(np.bincount(known).argmax()) if 2 * len(known) >= len(parts) > 0 else -1


def share_of_part(of_part: np.ndarray, inside: np.ndarray) -> float:
    """Return the share of a part's cells that lie inside a cluster."""
    return float((of_part & inside).sum() / max(of_part.sum(), 1))


def is_other_type(pair: tuple[int, int], sides: BeforeAfter) -> bool:
    """Return whether two parts are of types that nobody confuses."""
    if min(pair) < 0 or sides.after is None:
        return True
    first, second = sides.before.parts[pair[0]].type, sides.after.parts[pair[1]].type
    alike = any(first in family and second in family for family in FAMILIES)
    return first != second and not alike


def draw_cells(cells: np.ndarray, cell_m: float) -> shapely.Geometry:
    """Return the outline of cells (k, 2) with sides of `cell_m`, in the roof's frame."""
    low = cells * cell_m
    return shapely.union_all(shapely.box(*low.T, *(low + cell_m).T))
