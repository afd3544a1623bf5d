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
from .cells import MEDIAN_VARIANCE, CellComparison
from .clusters import ChangedCells
from .judge import OVER_GROUND_M, ChangeVerdict, find_heights
from .lineage import show_parts

ALIKE_SHARE, ALIKE_M = 0.2, (0.1, 0.25)
"""Cells moved together whose differences are within this share of their median, and within bounds
(m): two standard deviations of a cell, and what a chimney or an edge does to its median."""

TOGETHER = 0.75
"""Share of the cells that have to move alike: chimneys and edges do not."""

CROSSING, HALF = 0.2, 0.5
"""Shares of a roof's cells that contradict it where its type, or its slope, is another: the more
alike two roofs are, the more cells both have in common."""

LARGER = 0.1
"""Share of a roof's cells from which on a part of it has to take part in a change of the whole."""

AS_ONE_SHARE = 0.65
"""Share of a part's cells, or of a building's, from which on it changed as one."""

SAME_PART = 0.6
"""Intersection over union from which on two parts take the same place."""

SMALL_M2, THIN_LAYER_M = 12.0, 0.25
"""Area (m2) below which an addition is a dormer or the like, and the height (m) below which it is a
layer on the roof, such as solar panels."""

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
    difference_m: float
    sigma_m: float
    area_m2: float
    place: shapely.Geometry
    parts: tuple[int, int] = (-1, -1)


@dataclass(frozen=True)
class BeforeAfter:
    """A building before and after, with the part that shows at each cell.

    Both roofs are in one frame.

    `after` is None where no new roof was found that explains the new points. `on_ground` (k,) are
    the cells where the new points lie on the ground, `sigma_m` is the standard deviation of the
    common vertical shift.
    """

    cells: CellComparison
    before: Roof
    after: Roof | None
    part_before: np.ndarray
    part_after: np.ndarray
    on_ground: np.ndarray
    sigma_m: float


def name_differences(
    verdict: ChangeVerdict, before: Roof, after: Roof | None, sigma_m: float
) -> list[Difference]:
    """Name what changed of a building, the largest place first.

    `after` is the new roof in the frame of the one `before`, None where no new roof explains the
    points.
    """
    c = verdict.comparison
    with np.errstate(invalid="ignore"):
        height = find_heights(before, c) + c.new - verdict.ground.height_at(c.centres)
        on_ground = height < OVER_GROUND_M
    shown = show_parts(before, c.centres)
    shown_after = np.full(len(shown), -1) if after is None else show_parts(after, c.centres)
    sides = BeforeAfter(c, before, after, shown, shown_after, on_ground, sigma_m)
    inside = np.zeros(len(c.cells), bool)
    for cluster in verdict.clusters:
        inside[cluster.members] = True
    whole = name_whole(verdict, inside, sides)
    if whole is not None:
        return [whole]
    result = [name_cluster(cluster, sides) for cluster in verdict.clusters]
    return sorted(result, key=lambda item: -item.area_m2)


def name_doubts(verdict: ChangeVerdict) -> list[Difference]:
    """Return the places that make a building uncertain."""
    c = verdict.comparison
    return [
        Difference(
            ChangeKind.UNCLEAR,
            cluster.difference_m,
            cluster.sigma_m,
            cluster.area_m2,
            draw_cells(c.cells[cluster.members], c.cell_m),
        )
        for cluster in verdict.clusters
    ]


def name_whole(verdict: ChangeVerdict, inside: np.ndarray, sides: BeforeAfter) -> Difference | None:
    """Name the change of a roof as a whole, None where only places of it changed.

    `inside` (k,) are the cells of all clusters. A roof of another type or slope crosses the earlier
    one, so fewer cells contradict it.
    """
    c = sides.cells
    members = np.flatnonzero(c.is_compared)
    share = inside.sum() / len(members)
    moved = find_moved(inside, c)
    pair = find_main(sides.part_before[members]), find_main(sides.part_after[members])
    kind, d = None, c.difference[members]
    if not verdict.clusters or (
        moved[members].mean() >= AS_ONE_SHARE and moves_together(d) and has_all(moved, sides)
    ):
        kind = ChangeKind.ROOF_RAISED if np.median(d) > 0 else ChangeKind.ROOF_LOWERED
    elif (
        is_same_place(pair, sides)
        and not sides.on_ground[inside].any()
        and not moves_together(c.difference[inside])
    ):
        if share >= CROSSING and is_other_type(pair, sides):
            kind = ChangeKind.TYPE_CHANGED
        elif share >= HALF and not is_other_type(pair, sides):
            kind = ChangeKind.SLOPE_CHANGED
    if kind is None:
        return None
    return describe_place(kind, np.isin(np.arange(len(c.cells)), members), pair, sides)


def find_moved(inside: np.ndarray, comparison: CellComparison) -> np.ndarray:
    """Return whether (k,) each cell moved like most of those `inside` (k,) all clusters.

    The differences of many cells are too small to count by themselves.
    """
    d = comparison.difference
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(d - np.median(d[inside])) < np.abs(d)) if inside.any() else inside


def has_all(inside: np.ndarray, sides: BeforeAfter) -> bool:
    """Return whether half of the cells of each larger part before are `inside` (k,)."""
    compared = sides.cells.is_compared
    parts, counts = np.unique(sides.part_before[compared], return_counts=True)
    shares = [
        share_of_part(sides.part_before == part, inside, compared)
        for part in parts[counts >= LARGER * compared.sum()]
    ]
    return min(shares, default=1.0) >= HALF


def name_cluster(cluster: ChangedCells, sides: BeforeAfter) -> Difference:
    """Name the change of a place of a roof."""
    c = sides.cells
    inside = np.zeros(len(c.cells), bool)
    inside[cluster.members] = True
    pair = find_main(sides.part_before[inside]), find_main(sides.part_after[inside])
    of_before, of_after = sides.part_before == pair[0], sides.part_after == pair[1]
    share_before = share_of_part(of_before, inside, c.is_compared)
    share_after = share_of_part(of_after, inside, c.is_compared)
    is_part = share_before >= AS_ONE_SHARE and len(sides.before.parts) > 1
    if sides.on_ground[inside].mean() > HALF:
        kind = ChangeKind.PART_REMOVED
    elif is_part and is_same_place(pair, sides) and not moves_together(c.difference[inside]):
        other = is_other_type(pair, sides)
        kind = ChangeKind.TYPE_CHANGED if other else ChangeKind.SLOPE_CHANGED
    elif cluster.area_m2 < SMALL_M2 or abs(cluster.difference_m) < THIN_LAYER_M:
        kind = ChangeKind.SMALL_OBJECT
    elif cluster.difference_m > 0:
        kind = ChangeKind.PART_RAISED if is_part else ChangeKind.PART_ADDED
    else:
        is_own = share_after >= AS_ONE_SHARE
        kind = ChangeKind.PART_LOWERED if is_own else ChangeKind.PART_REMOVED
    place = describe_place(kind, inside, pair, sides)
    return dataclasses.replace(place, area_m2=cluster.area_m2)


def describe_place(
    kind: ChangeKind, inside: np.ndarray, pair: tuple[int, int], sides: BeforeAfter
) -> Difference:
    """Return the place of a change over the cells `inside` (k,)."""
    c = sides.cells
    d, s = c.difference[inside], c.sigma[inside]
    sigma = math.hypot(sides.sigma_m, math.sqrt(MEDIAN_VARIANCE * np.mean(s**2) / len(d)))
    area = len(d) * c.cell_m2
    place = draw_cells(c.cells[inside], c.cell_m)
    return Difference(kind, float(np.median(d)), sigma, area, place, pair)


def moves_together(differences: np.ndarray) -> bool:
    """Return whether most `differences` (n,) are the same."""
    middle = np.median(differences)
    alike = np.clip(ALIKE_SHARE * abs(middle), *ALIKE_M)
    return bool(np.mean(np.abs(differences - middle) < alike) >= TOGETHER)


def is_same_place(pair: tuple[int, int], sides: BeforeAfter) -> bool:
    """Return whether a part before and one after take the same place."""
    if min(pair) < 0:
        return False
    first, second = sides.part_before == pair[0], sides.part_after == pair[1]
    union = (first | second) & sides.cells.is_compared
    common = first & second & sides.cells.is_compared
    return float(common.sum() / max(union.sum(), 1)) >= SAME_PART


def find_main(parts: np.ndarray) -> int:
    """Return the part that shows at most of the cells, -1 where there is none."""
    known = parts[parts >= 0]
    return int(np.bincount(known).argmax()) if 2 * len(known) >= len(parts) > 0 else -1


def share_of_part(of_part: np.ndarray, inside: np.ndarray, compared: np.ndarray) -> float:
    """Return the share of a part's compared cells that lie inside a cluster."""
    return float((of_part & inside).sum() / max((of_part & compared).sum(), 1))


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
