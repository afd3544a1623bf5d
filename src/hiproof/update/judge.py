"""The class of a building by a test of "the same roof" against "another roof".

The chance that an unchanged building shows what is seen has to be below the significance. That
holds for the largest of its clusters and for the roof as a whole. What lies above the roof without
taking its place, such as leaves or a crane, makes a building uncertain at most.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..geometry.grid import AROUND_KEYS, KEY_OF_CELL
from ..model import Roof
from ..status import Change
from .cells import CELL_SIDES_M, CellComparison, compare_points, predict_occupancy, summarise_cells
from .clusters import (
    FARTHEST_SIGMAS,
    KEPT_SHARE,
    ChangedCells,
    compute_chance,
    describe_cluster,
    find_clusters,
    group_cells,
    is_known_around,
    measure_area,
    measure_roof,
)
from .ground import Ground
from .register import SurveyShift

COVERED = 0.5
"""Share of a building that the new survey has to cover, for the building to be judged."""

FEWEST_COMPARED = 4
"""Cells that have to be compared, below which chance decides."""

GONE_SHARE, LEAST_ROOF = 0.7, 0.2
"""Shares of the cells that were roof, and of all compared ones, that have to lie on bare ground for
a building to be gone. Of glass few cells were roof before."""

OVER_GROUND_M = 1.0
"""Points less high above the ground (m) lie on it, and roofs higher."""

WHOLE_SHARE = 0.7
"""Share of the cells that have to move with the roof as a whole."""

PASSED_SHARE, FEWEST_LEFT = 0.03, 3
"""Share, and number, of the new points over bare ground that still lie on the earlier roof, from
which on pulses pass it, as glass lets most of them. Under a roof that is gone hardly one does."""

SMALLEST_M2, SMALLEST_BARE_M2 = 2.0, 1.0
"""Area (m2) below which a cluster is a chimney, an aerial or the edge of something. Nothing else
looks like bare ground, and half of a small place lies along walls, where cells do not count."""

FEWEST_BARE = 3
"""Points on the ground from which on they make a building uncertain though they fill no cells. One
or two are echoes that came on a detour."""

SMALL_M2 = 12.0
"""Area (m2) below which an addition is a dormer or the like, and what is left of a building is
none."""

DOUBTFUL_M2 = 4.0
"""Area (m2) from which on points that lie on no surface make a building uncertain."""

SMALL_CELL_M = CELL_SIDES_M[1]
"""Side (m) of cells in which sparse surveys are compared once more. Dormers fill hardly any of the
usual ones, and too few points lie in these to be sure."""


@dataclass(frozen=True)
class ChangeVerdict:
    """The class of a building, and what it rests on.

    These are the `comparison` of both surveys and the earlier `ground`. `chance` bounds the
    probability that an unchanged building looks like this. `clusters` are those that count.
    """

    change: Change
    comparison: CellComparison
    ground: Ground
    chance: float = 1.0
    clusters: tuple[ChangedCells, ...] = ()


def judge_building(
    roof: Roof,
    old: np.ndarray | None,
    new: np.ndarray,
    ground: Ground,
    shift: SurveyShift,
    significance: float,
    unexplained_m2: float = 0.0,
) -> ChangeVerdict:
    """Judge a building by its `old` and `new` points (n, 3), in its roof's frame.

    Ground points inside the outline are among them, `ground` is the earlier one, and `shift` that
    of the new points, which is taken off. Without old points clusters count as far as they are
    larger than the area that the earlier model left unexplained.
    """
    comparison = compare_points(roof, old, new, shift.noise)
    if is_not_covered(comparison, roof):
        return ChangeVerdict(Change.NOT_COVERED, comparison, ground)
    was_roof, on_ground = find_bare(comparison, roof, ground)
    is_passed = passes_pulses(comparison, was_roof, on_ground, np.arange(len(comparison.cells)))
    is_bare = is_gone(comparison, was_roof, on_ground) and not is_passed
    if is_bare and measure_standing(comparison, roof, ground) < SMALL_M2:
        return ChangeVerdict(Change.GONE, comparison, ground, 0.0)
    likely = [
        c
        for c in find_clusters(comparison, shift.noise.stray)
        if c.chance < significance and is_large(c, comparison, ground)
    ]
    beyond = unexplained_m2 if old is None else 0.0
    clear = tuple(
        c
        for c in likely
        if (c.is_surface or lies_bare(c, comparison, ground))
        and c.area_m2 > beyond
        and not passes_pulses(comparison, was_roof, on_ground, c.members)
    )
    whole_chance = 1.0 if is_passed else compute_whole_chance(comparison, shift)
    chance = min([whole_chance, *(c.chance for c in clear)])
    if clear or chance < significance:
        return ChangeVerdict(Change.CHANGED, comparison, ground, chance, clear)
    doubtful = tuple(c for c in likely if c.area_m2 >= DOUBTFUL_M2) or tuple(
        c
        for c in find_bare_points(comparison, roof, ground, shift.noise.stray)
        if c.chance < significance
        and c.area_m2 > max(beyond, SMALLEST_BARE_M2)
        and not passes_pulses(comparison, was_roof, on_ground, c.members)
    )
    if not doubtful:
        if comparison.cell_m > SMALL_CELL_M:
            comparison = compare_points(roof, old, new, shift.noise, SMALL_CELL_M)
        doubtful = tuple(
            c
            for c in find_clusters(comparison, shift.noise.stray, has_blocks=True)
            if c.chance < significance and c.area_m2 >= max(DOUBTFUL_M2, beyond)
        )
    if doubtful:
        return ChangeVerdict(Change.UNCERTAIN, comparison, ground, doubtful[0].chance, doubtful)
    return ChangeVerdict(Change.UNCHANGED, comparison, ground)


def is_not_covered(comparison: CellComparison, roof: Roof) -> bool:
    """Return whether too little of the earlier roof has new points.

    Cells that hold none because the survey is sparse are covered.
    """
    c = comparison
    compared, earlier = int(c.is_compared.sum()), int((c.n_old > 0).sum())
    if compared < FEWEST_COMPARED:
        return True
    without_old = not len(c.number_old)
    share = compared * c.cell_m**2 / roof.outline.area if without_old else compared / earlier
    share /= predict_occupancy(c.n_new)
    return bool(share < (COVERED / 2 if without_old else COVERED))


def find_bare(
    comparison: CellComparison, roof: Roof, ground: Ground
) -> tuple[np.ndarray, np.ndarray]:
    """Return whether (k,) cells were roof, and whether they lie on the ground now."""
    c = comparison
    heights = find_heights(roof, c) - ground.height_at(c.centres)
    was_roof = c.is_compared & (heights + c.old > 2 * OVER_GROUND_M)
    return was_roof, c.is_compared & (heights + c.new < OVER_GROUND_M)


def is_gone(comparison: CellComparison, was_roof: np.ndarray, on_ground: np.ndarray) -> bool:
    """Return whether bare ground lies where the roof was, in cells (k,).

    It does not where either survey has points on the other's surface.
    """
    is_other = np.maximum(comparison.kept, comparison.known) <= KEPT_SHARE
    bare, roof, all_cells = (
        int(cells.sum())
        for cells in (was_roof & on_ground & is_other, was_roof, comparison.is_compared)
    )
    return bare >= max(FEWEST_COMPARED, GONE_SHARE * roof, LEAST_ROOF * all_cells)


def measure_standing(comparison: CellComparison, roof: Roof, ground: Ground) -> float:
    """Return the largest area (m2) of a roof in the new points, of the earlier building or another.

    Crowns form no roof, and heaps are lower than one.
    """
    c = comparison
    heights = find_heights(roof, c) + c.new - ground.height_at(c.centres)
    is_high = c.is_compared & (heights > 2 * OVER_GROUND_M)
    return max((measure_roof(c, members) for members in group_cells(c, is_high)), default=0.0)


def passes_pulses(
    comparison: CellComparison, was_roof: np.ndarray, on_ground: np.ndarray, members: np.ndarray
) -> bool:
    """Return whether pulses pass the earlier roof to the ground in and around cells `members` (m,).

    Some points lie on it still, in cells that have the ground all around: what is left of a roof
    that was pulled down lies together.
    """
    c, keys = comparison, comparison.cells.astype(np.int64) @ KEY_OF_CELL
    selection = np.flatnonzero(
        was_roof & on_ground & np.isin(keys, keys[members, None] + AROUND_KEYS)
    )
    standing = keys[c.is_compared & ~on_ground]
    inner = selection[~np.isin(keys[selection, None] + AROUND_KEYS, standing).any(axis=1)]
    kept = float(c.kept[inner] @ c.n_new[inner])
    return kept >= max(FEWEST_LEFT, PASSED_SHARE * float(c.n_new[inner].sum()))


def find_bare_points(
    comparison: CellComparison, roof: Roof, ground: Ground, stray: float
) -> Iterator[ChangedCells]:
    """Yield places with new points on the ground where the earlier survey shows roof alone.

    They count where they share cells with points of a roof, too, or with no earlier ones.
    """
    c = comparison
    heights = c.points[:, 2] - ground.height_at(c.points)
    low = np.flatnonzero((heights < OVER_GROUND_M) & (heights - c.over > 2 * OVER_GROUND_M))
    number, over = c.number[low], c.over[low]
    if len(low) < FEWEST_BARE:
        return
    new, _, n_low = summarise_cells(number, over, len(c.cells), 0.0)
    sigma = np.minimum(c.sigma, c.sigma[c.is_compared].max())
    bare = dataclasses.replace(c, old=np.nan_to_num(c.old), new=new, sigma=sigma)
    is_other = n_low > 0
    is_other[is_other] = ~is_known_around(bare, np.flatnonzero(is_other))
    for members in group_cells(c, is_other, AROUND_KEYS):
        inside = number[np.isin(number, members)]
        chance = compute_chance(len(inside), FARTHEST_SIGMAS, len(c.points), stray)
        if len(inside) >= FEWEST_BARE:
            place = describe_cluster(bare, members, len(members))
            yield dataclasses.replace(place, area_m2=measure_area(c, inside), chance=chance)


def is_large(cluster: ChangedCells, comparison: CellComparison, ground: Ground) -> bool:
    """Return whether a cluster is larger than a chimney, or bare ground."""
    is_bare = cluster.area_m2 >= SMALLEST_BARE_M2 and lies_bare(cluster, comparison, ground)
    return is_bare or cluster.area_m2 >= SMALLEST_M2


def lies_bare(cluster: ChangedCells, comparison: CellComparison, ground: Ground) -> bool:
    """Return whether most of a cluster's new points lie on the ground."""
    points = comparison.points[np.isin(comparison.number, cluster.members)]
    return float(np.median(points[:, 2] - ground.height_at(points))) < OVER_GROUND_M


def find_heights(roof: Roof, comparison: CellComparison) -> np.ndarray:
    """Return the roof's height (k,) at the middles of the cells.

    Beside the roof it is that of its lowest known place.
    """
    heights = roof.height_at(comparison.centres)
    lowest = np.nanmin(heights) if np.isfinite(heights).any() else 0.0
    return np.where(np.isfinite(heights), heights, lowest)


def compute_whole_chance(comparison: CellComparison, shift: SurveyShift) -> float:
    """Return the chance that the whole roof lies higher or lower by so much.

    It is 1 where not most cells take part in that.
    """
    d, s = (v[comparison.is_compared] for v in (comparison.difference, comparison.sigma))
    middle = float(np.median(d))
    sampling = 1.57 * float(np.mean(s**2)) / len(d)
    sigma = math.sqrt(shift.noise.roof**2 + shift.sigma[2] ** 2 + sampling)
    together = np.mean(np.abs(d - middle) < np.abs(d))
    return 1.0 if together < WHOLE_SHARE else math.erfc(abs(middle) / sigma / math.sqrt(2))
