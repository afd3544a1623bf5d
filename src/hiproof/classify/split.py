"""Buildings of a cloud without footprints: connected roof points, touching houses apart."""

from __future__ import annotations

import dataclasses
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy
import shapely

from ..errors import ErrorReport, InputError, InputWarning, report_error
from ..frames import Box
from ..geometry.components import label_components
from ..geometry.grid import number_cells
from ..log import count_things
from ..model import PointCloud
from ..settings import ReadSettings, Settings
from .buildings import RoofSearch, find_squares, list_squares, select_roof_candidates
from .cells import plan_density
from .cut_out import is_cut_out
from .houses import separate_houses

# steps, so that neighbouring tiles of one survey choose the same gap
GAPS_M = (1.0, 1.5, 2.0, 3.0, 4.5, 6.0)
# a gap is no gap between houses where points lie sparser than this many to it
SPACINGS_PER_GAP = 2.5
# m, points and share of one connected group: what may be one roof cut out beforehand, the paper's
# case
SINGLE_EXTENT_M, SINGLE_POINTS, SINGLE_SHARE = 60.0, 200_000, 0.9
BLOCK_EXTENT_M = 250.0  # of a block of houses cut out beforehand; a plane lies under it
NEVER_CLASSIFIED = (0, 1)  # of ASPRS: created, unclassified
NOISE = (7, 18)  # of ASPRS: low and high noise
MIN_AREA_M2 = 4.0  # m2; smaller is a shed or a car's roof, and too little to model
SPACINGS_BEYOND = 0.35  # a roof ends about so far beyond its outermost points


Progress = Callable[[str, int, int], None]


def ignore(stage: str, finished: int, total: int) -> None:
    """Take no notice of how far the work is."""


@dataclass(frozen=True)
class FoundBuilding:
    """A group of points taken for one building: ascending `index` (n,) into the cloud.

    `area` is the union of the cells that hold the group's points, in world metres, less what lies
    beyond a wall between touching houses: all of them lie in it, and none of another group. The
    roof's outline is the fit's business. `is_cut_out`: the cloud holds roofs alone, cut out
    beforehand, so that all its points but noise count. `error`: an unexpected error while its
    points were split into houses, or while roofs were looked for among them.
    """

    index: np.ndarray
    area: shapely.Geometry
    error: ErrorReport | None = None
    is_cut_out: bool = False
    id: str = ""


def split_buildings(
    cloud: PointCloud,
    settings: Settings | None = None,
    box: Box | None = None,
    progress: Progress = ignore,
) -> list[FoundBuilding]:
    """Split `cloud` into buildings by its building class, or by roofs found by shape.

    A small file that holds one roof alone is one building; one of several roofs cut out beforehand
    is as if their class were known. Houses that touch are told apart where their roofs say so
    (`settings.read.split_houses`), else they stay together. Groups with fewer than
    `settings.read.split_min_points` points or less than 4 m2 are left out with an InputWarning. Ids
    name the metre that holds the group's middle, not its number, so that they do not depend on what
    else was read. Raises InputError where no point may be a building's. An unexpected error stays
    with the group, or the square of the cloud, where it happens.

    With a `box` (xmin, ymin, xmax, ymax, world metres) the buildings that meet it come as without
    one; of the others those that touch them come too. `progress` is called with a stage ("ground",
    "split"), how much of it is done, and how much there is.
    """
    read = (settings or Settings()).read
    roof, is_cut_out, failed = select_roof_points(cloud, read, box, progress)
    houses = divide_roof_points(roof, cloud.xyz, read, is_cut_out, box, progress)
    return name_places([*houses, *failed], cloud.xyz, is_cut_out)


def divide_roof_points(
    roof: np.ndarray,
    xyz: np.ndarray,
    read: ReadSettings,
    is_cut_out: bool,
    box: Box | None,
    progress: Progress,
) -> list[FoundBuilding]:
    """Divide the `roof` points (indices) among buildings, those that may meet a `box`."""
    if not len(roof):
        return []
    xy = xyz[roof, :2]
    if is_cut_out and is_single(xy):
        return houses_or_error(roof, xyz, adapted_gap(xy), split_houses=False)
    gap_m = read.split_gap_m or adapted_gap(xy)
    candidates = [roof[group] for group in connected_groups(xy, gap_m)]
    if box is not None:
        candidates = [group for group in candidates if meets_box(xyz[group], box, gap_m)]
    groups, houses = select_large_groups(candidates, xyz, read), []
    for number, group in enumerate(groups):
        progress("split", number, len(groups))
        houses += houses_or_error(group, xyz, gap_m, read.split_houses)
    return houses


def meets_box(xyz: np.ndarray, box: Box, gap_m: float) -> bool:
    """Return whether cells of points (n, 3), half a gap beyond them, may meet the box."""
    lower, upper = np.array(box[:2]) - gap_m / 2, np.array(box[2:]) + gap_m / 2
    return bool(((xyz[:, :2] >= lower) & (xyz[:, :2] <= upper)).all(axis=1).any())


def find_roofs_around(
    search: RoofSearch, xyz: np.ndarray, read: ReadSettings, box: Box, progress: Progress
) -> np.ndarray:
    """Return the roof points (indices) of squares around the box.

    The squares hold every group of roof points that meets the box. A group that reaches the border
    of the squares searched so far may go on beyond it: then the next squares are searched too,
    until no such group does.
    """
    squares = list_squares(box, GAPS_M[-1])
    while True:
        roofs = search.find(partial(progress, "ground"), squares)
        if not len(roofs):
            return roofs
        gap_m = read.split_gap_m or adapted_gap(xyz[roofs, :2])
        groups = [xyz[roofs[group]] for group in connected_groups(xyz[roofs, :2], gap_m)]
        around = [find_squares(group, gap_m) for group in groups if meets_box(group, box, gap_m)]
        grown = squares.union(*around)
        if grown == squares:
            return roofs
        squares = grown


def select_large_groups(
    groups: list[np.ndarray], xyz: np.ndarray, read: ReadSettings
) -> list[np.ndarray]:
    """Select the groups large enough for a building; an InputWarning counts the others."""
    large = [
        group
        for group in groups
        if len(group) >= read.split_min_points and hull_area(xyz[group, :2]) >= MIN_AREA_M2
    ]
    left_out = len(groups) - len(large)
    if left_out:
        warnings.warn(
            f"{count_things(left_out, 'group')} of building points left out as too small (fewer "
            f"than {read.split_min_points} points or {MIN_AREA_M2:g} m2); [read] split_min_points "
            "sets the limit",
            InputWarning,
        )
    return large


def select_roof_points(
    cloud: PointCloud, read: ReadSettings, box: Box | None, progress: Progress
) -> tuple[np.ndarray, bool, list[FoundBuilding]]:
    """Return ascending indices of the points that may be roofs.

    With them come whether they are roofs alone, cut out beforehand, and the places where the search
    for them failed.
    """
    if read.roofs == "alone":
        return select_roof_candidates(cloud, read.ground_classes), True, []
    index = np.flatnonzero(np.isin(cloud.classes, read.building_classes))
    if read.roofs != "shape" and cloud.classification is not None and len(index):
        return index, False, []
    unclassified = select_unclassified(cloud)
    is_chosen = read.building_classes != ReadSettings().building_classes
    if read.roofs == "class" or (read.roofs == "auto" and is_chosen):
        if unclassified is None or not is_single(cloud.xyz[unclassified, :2]):
            raise InputError(without_building_class(cloud, read.building_classes))
        return unclassified, True, []
    if unclassified is not None and is_roofs_only(cloud.xyz[unclassified]):
        return unclassified, True, []
    search = RoofSearch(cloud, read.ground_classes)
    if box is None:
        roofs = search.find(partial(progress, "ground"))
    else:
        roofs = find_roofs_around(search, cloud.xyz, read, box, progress)
    if read.roofs == "auto":
        warnings.warn(
            f"the cloud has no building class ({classes_text(read.building_classes)}): its roofs "
            "were found by shape",
            InputWarning,
        )
    return roofs, False, [make_failed_place(index, cloud.xyz, e) for index, e in search.failed]


def classes_text(classes: tuple[int, ...]) -> str:
    return " or ".join(map(str, classes))


def select_unclassified(cloud: PointCloud) -> np.ndarray | None:
    """Return ascending indices of all points but noise, None where any has a class."""
    index = np.flatnonzero(~np.isin(cloud.classes, NOISE))
    return index if len(index) and np.isin(cloud.classes, NEVER_CLASSIFIED + NOISE).all() else None


def is_single(xy: np.ndarray) -> bool:
    """Return whether points (n, 2) are few and close enough for one building.

    This is the paper's case. They are at most 60 m wide and 200,000, a drone's of a large house,
    nine tenths of them connected.
    """
    if len(xy) > SINGLE_POINTS or np.ptp(xy, axis=0).max() > SINGLE_EXTENT_M:
        return False
    return max(map(len, group_roughly(xy))) >= SINGLE_SHARE * len(xy)


def is_roofs_only(xyz: np.ndarray) -> bool:
    """Return whether the points (n, 3) are roofs that were cut out beforehand.

    They may be one roof or several, each a group by itself. Of several most are known for roofs,
    and hardly any is none; what has nothing high on it may be either.
    """
    if is_single(xyz[:, :2]):
        return is_cut_out(xyz) is not False
    roofs = others = 0
    for group in group_roughly(xyz[:, :2]):
        wide = np.ptp(xyz[group, :2], axis=0).max() > BLOCK_EXTENT_M
        result = False if wide else is_cut_out(xyz[group])
        roofs += len(group) if result else 0
        others += len(group) if result is False else 0
        if others > (1.0 - SINGLE_SHARE) * len(xyz):
            return False
    return roofs > 0.5 * len(xyz)


def without_building_class(cloud: PointCloud, targets: tuple[int, ...]) -> str:
    if cloud.classification is None:
        got = (
            f"{count_things(len(cloud), 'point')} without classes, too many or too scattered for a "
            "single building"
        )
    else:
        counts = sorted(Counter(cloud.classification.tolist()).items())
        got = "classes " + ", ".join(
            f"{number} ({count_things(count, 'point')})" for number, count in counts
        )
    return (
        f"expected points of class {classes_text(targets)} (building), got {got}; name the class "
        "that holds the roofs with "
        "--building-class, give --footprints, or classify the cloud first"
    )


def adapted_gap(xy: np.ndarray) -> float:
    """Return the gap (m) between buildings: 1 m, more where `xy` (n, 2) are sparse."""
    required = SPACINGS_PER_GAP / np.sqrt(plan_density(xy))
    return next((gap for gap in GAPS_M if gap >= required), GAPS_M[-1])


def group_roughly(xy: np.ndarray) -> list[np.ndarray]:
    """Return groups of `xy` (n, 2) across twice the gap, since a roof may have holes."""
    return connected_groups(xy, 2 * adapted_gap(xy))


def connected_groups(xy: np.ndarray, gap_m: float) -> list[np.ndarray]:
    """Return groups of `xy` (n, 2), connected across gaps up to about `gap_m`.

    Groups are ascending indices. Occupied cells of half the gap, on the world's own grid, are
    connected where their centres are at most the gap apart; groups come in the order of their first
    cell, by rows.
    """
    cells, cell_of = number_cells(np.floor(xy[:, ::-1] / (gap_m / 2)))
    links = scipy.spatial.KDTree(cells).query_pairs(2.0, output_type="ndarray")
    group_of = label_components(len(cells), links.T)[cell_of]
    order = np.argsort(group_of, kind="stable")
    return np.split(order, np.cumsum(np.bincount(group_of))[:-1])


def name_places(
    places: list[FoundBuilding], xyz: np.ndarray, is_cut_out: bool
) -> list[FoundBuilding]:
    """Give each place the id B_<x>_<y> of the metre that holds the middle of its box."""
    in_use: Counter[str] = Counter()
    result = []
    for place in places:
        xy = xyz[place.index, :2]
        x, y = np.floor((xy.min(axis=0) + xy.max(axis=0)) / 2).astype(int)
        id = f"B_{x}_{y}"
        in_use[id] += 1
        id = id if in_use[id] == 1 else f"{id}_{in_use[id]}"
        result.append(dataclasses.replace(place, id=id, is_cut_out=is_cut_out))
    return result


def houses_or_error(
    group: np.ndarray, xyz: np.ndarray, gap_m: float, split_houses: bool
) -> list[FoundBuilding]:
    """Divide a group of points into houses, or keep it whole with the error."""
    try:
        return [
            FoundBuilding(index, shapely.make_valid(area))
            for index, area in find_houses(group, xyz, gap_m, split_houses)
        ]
    except Exception as error:
        return [make_failed_place(group, xyz, report_error(error))]


def make_failed_place(index: np.ndarray, xyz: np.ndarray, error: ErrorReport) -> FoundBuilding:
    """Make the box of the points `index` with the error that happened there."""
    xy = xyz[index, :2]
    return FoundBuilding(index, shapely.box(*xy.min(axis=0), *xy.max(axis=0)), error)


def find_houses(
    group: np.ndarray, xyz: np.ndarray, gap_m: float, split_houses: bool
) -> list[tuple[np.ndarray, shapely.Geometry]]:
    """Return points (indices) and area of each house of a group, or of the whole group."""
    area = cell_area(xyz[group, :2], gap_m / 2)
    if not split_houses:
        return [(group, area)]
    houses, remainder = [], group
    for house in separate_houses(xyz[group], area, gap_m):
        inside = shapely.intersects_xy(house, *xyz[remainder, :2].T)
        if inside.any():
            houses.append((remainder[inside], house))
        remainder = remainder[~inside]
    return houses


def hull_area(xy: np.ndarray) -> float:
    """Return the area of the points' convex hull, widened as a roof reaches beyond them."""
    return (
        shapely.multipoints(xy).convex_hull.buffer(SPACINGS_BEYOND / np.sqrt(plan_density(xy))).area
    )


def cell_area(xy: np.ndarray, cell_m: float) -> shapely.Geometry:
    """Return the union of the world's grid cells that hold points `xy` (n, 2)."""
    distinct = np.unique(np.floor(xy / cell_m), axis=0)
    return shapely.coverage_union_all(
        shapely.box(*(distinct * cell_m).T, *((distinct + 1) * cell_m).T)
    )
