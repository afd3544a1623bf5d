"""The points of buildings: smooth, large surfaces above the ground, and a cloud's roofs."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import scipy

from ..errors import ErrorReport, InputError, report_error
from ..frames import Box
from ..geometry.point_grid import PointGrid
from ..log import count_things
from ..model import PointCloud
from .cells import SquareCells, plan_density
from .ground import ground_grid
from .surfaces import Surfaces, find_surfaces

UNKNOWN, GROUND_CLASS, BUILDING = 1, 2, 6  # classes of ASPRS

# a cloud is worked through in squares, with what lies so far around each
WORK_M, SQUARE_BORDER_M = 250.0, 40.0
# of a point above or below the ground; on slopes more, by what half a cell rises
GROUND_HEIGHT_M = 0.25
HIGH_OBJECT_M = 1.5  # what is lower is no roof
OPEN_M = 0.5  # what is lower is taken for ground when it is counted around a point
WALL_FOOT_M = 0.3  # walls are a building's from here on
CELLS_M = (0.5, 1.0, 2.0)  # sides of the cells in which buildings are put together, by density
NEIGHBOURHOOD_M = 4.5  # side of the window in which ground is looked for around a point

# Log odds of roof or wall against leaves, chosen on simulated towns and on one half of a real one.
LOG_ROUGHNESS, LOG_LARGEST, LOG_EXTENT, GROUND_SHARE, CONSTANT = -0.93, 0.82, 0.46, -7.0, -1.65
SMOOTHING_ROUNDS = 4  # of taking the mean over neighbours

CORE_M2 = 5.0  # a building has cells with a surface of that size ...
FEWEST_M2 = 16.0  # ... on that much of its plan,
NARROWEST_M = 2.0  # nowhere narrower than this,
UNLIKELY = -3.0  # log odds of what is no building even below a roof
SQUARE = np.ones((3, 3))  # a cell and the eight around it
REACH_M = 1.0  # and nothing farther from them is part of it


def classify(xyz: np.ndarray) -> np.ndarray:
    """Return the class (n,) uint8 of each point (n, 3) in world metres.

    Classes are BUILDING, GROUND and UNKNOWN.
    """
    search = SquareSearch(xyz)
    search.classify(search.squares)
    return search.classes


Square = tuple[int, int]  # column and row of a square of WORK_M on the world's grid


class SquareSearch:
    """The search for ground and buildings in a cloud, square by square.

    Points within 40 m of a square decide, and so the answer for a place is much the same whatever
    else the cloud holds. `classes` (n,) are UNKNOWN in squares that were not searched.
    """

    def __init__(self, xyz: np.ndarray):
        self.xyz, self.classes = xyz, np.full(len(xyz), UNKNOWN, np.uint8)
        self.squares, self.searched = find_squares(xyz), set[Square]()
        if len(xyz):
            density = plan_density(xyz)
            # the smallest cells that most often hold a point where there are any
            cells = (cell for cell in CELLS_M if density * cell**2 >= 1.0)
            self.grid, self.cell_m = PointGrid(xyz, 10.0), next(cells, CELLS_M[-1])

    def classify(
        self, squares: set[Square], progress: Callable[[int, int], None] = lambda *_: None
    ) -> None:
        """Find the classes of the points in those `squares` that are not searched yet."""
        remainder = sorted((squares & self.squares) - self.searched)
        for number, square in enumerate(remainder):
            progress(number, len(remainder))
            self.classify_square(square)
        self.searched.update(remainder)

    def classify_square(self, square: Square) -> None:
        lower = WORK_M * np.array(square)
        border = (*(lower - SQUARE_BORDER_M), *(lower + WORK_M + SQUARE_BORDER_M))
        nearby = self.grid.candidates(border)
        mask = (np.floor(self.xyz[nearby, :2] / WORK_M) == square).all(axis=1)
        try:
            self.classes[nearby[mask]] = classify_points(self.xyz[nearby], self.cell_m)[mask]
        except Exception as error:
            self.skip(nearby[mask], error)

    def skip(self, inside: np.ndarray, error: Exception) -> None:
        """Leave the points `inside` (indices) UNKNOWN, whose square fails: here it may not."""
        raise error


def find_squares(xyz: np.ndarray, reach_m: float = 0.0) -> set[Square]:
    """Return the squares within `reach_m`, less than WORK_M, of points (n, 2 or more)."""
    corners = [(x, y) for x in {-reach_m, reach_m} for y in {-reach_m, reach_m}]
    places = [np.floor((xyz[:, :2] + corner) / WORK_M) for corner in corners]
    return set(map(tuple, np.unique(np.concatenate(places), axis=0).astype(int).tolist()))


def list_squares(box: Box, reach_m: float) -> set[Square]:
    """Return the squares within `reach_m` of a box."""
    lower = np.floor((np.array(box[:2]) - reach_m) / WORK_M).astype(int)
    upper = np.floor((np.array(box[2:]) + reach_m) / WORK_M).astype(int) + 1
    return set(itertools.product(range(lower[0], upper[0]), range(lower[1], upper[1])))


def classify_points(xyz: np.ndarray, cell_m: float) -> np.ndarray:
    """Return the class (n,) of all points of a small cloud (n, 3), n > 0."""
    ground = ground_grid(xyz)
    rise = 0.5 * ground.cell_m * ground.slope_at(xyz)
    # the ground's cells lie as low as their lowest point
    height = xyz[:, 2] - ground.height_at(xyz) - rise
    is_ground = np.abs(height) <= GROUND_HEIGHT_M + rise
    is_building = building_points(xyz, height, cell_m)
    return np.select([is_building, is_ground], [BUILDING, GROUND_CLASS], UNKNOWN).astype(np.uint8)


def roof_points(xyz: np.ndarray, more_odds: float = 0.0) -> np.ndarray:
    """Return which (n,) of points (n, 3) lie on a surface, not among leaves.

    The points are those within one building's outline. `more_odds` are the log odds of a roof there
    by what is known besides.
    """
    if len(xyz) < 4:
        return np.ones(len(xyz), bool)
    return smooth_odds(find_surfaces(xyz), more_odds) > 0


def smooth_odds(surfaces: Surfaces, more_odds: float | np.ndarray) -> np.ndarray:
    """Return each point's log odds (n,) of belonging to a roof or wall.

    They are those of its voxel by its surface, with `more_odds` (v,), none surer than 6, and those
    of neighbours taken together.
    """
    extent = np.log(surfaces.extent_m2)
    odds = (
        LOG_ROUGHNESS * np.log(surfaces.roughness_m + 0.02)
        + LOG_LARGEST * extent[surfaces.neighbours].max(axis=1)
        + LOG_EXTENT * surfaces.around(extent)
        + CONSTANT
    )
    odds = np.clip(odds + more_odds, -6.0, 6.0)
    for _ in range(SMOOTHING_ROUNDS):
        odds = surfaces.around(odds)
    return odds[surfaces.voxel]


def building_points(xyz: np.ndarray, height: np.ndarray, cell_m: float) -> np.ndarray:
    """Return which (n,) of the points (n, 3) are a building's; `height` (n,) is above ground."""
    cells, mask = SquareCells(xyz, cell_m), height > HIGH_OBJECT_M
    odds, is_large = np.zeros(len(xyz)), np.zeros(len(xyz), bool)
    if mask.sum() < 4:
        return is_large
    surfaces = find_surfaces(xyz[mask])
    open_share = cells.compute_local_share(height < OPEN_M, NEIGHBOURHOOD_M)
    more_odds = GROUND_SHARE * open_share[cells.of(surfaces.xyz)]
    odds[mask] = smooth_odds(surfaces, more_odds)
    is_large[mask] = surfaces.extent_m2[surfaces.voxel] >= CORE_M2
    plan = building_cells(
        cells.count(odds > 0), cells.count(mask), cells.count(is_large & (odds > 0)) > 0, cell_m
    )
    inside = plan.ravel()[cells.index]
    nearby = scipy.ndimage.binary_dilation(plan, SQUARE).ravel()[cells.index]
    below_roof = (height < cells.highest(height, odds > 0).ravel()[cells.index]) & (odds > UNLIKELY)
    return (inside & ~mask & (height > WALL_FOOT_M)) | (nearby & mask & ((odds > 0) | below_roof))


def building_cells(
    solid: np.ndarray, upper: np.ndarray, core: np.ndarray, cell_m: float
) -> np.ndarray:
    """Return which cells (c, r) are buildings'.

    The counts are of high points in each cell, and of solid ones among them. `core` tells whether
    the cell holds a large surface.
    """
    likely = close_gaps((solid > 0) & (2 * solid >= upper))
    core = close_gaps(core & likely)
    narrowest = max(1, round(NARROWEST_M / cell_m))
    core = scipy.ndimage.binary_opening(core, np.ones((narrowest, narrowest)))
    label, count = scipy.ndimage.label(core, SQUARE)
    area = scipy.ndimage.sum_labels(core, label, np.arange(count + 1)) * cell_m**2
    core = core & (area >= FEWEST_M2)[label]
    reach = round(REACH_M / cell_m)
    near = scipy.ndimage.binary_dilation(core, SQUARE, iterations=reach) if reach else core
    plan = core | (likely & near)
    gaps = (
        scipy.ndimage.binary_fill_holes(plan)
        & (upper > 0)
        & (scipy.ndimage.uniform_filter(plan.astype(float), 7) > 0.6)
    )
    return plan | gaps


def close_gaps(cells: np.ndarray) -> np.ndarray:
    """Return `cells` (c, r) with the narrow gaps that they surround."""
    return cells | scipy.ndimage.binary_closing(np.pad(cells, 2), SQUARE)[2:-2, 2:-2]


NO_ROOFS = {3: "low vegetation", 7: "noise", 9: "water", 17: "bridges", 18: "noise"}  # by class


class RoofSearch(SquareSearch):
    """The search for roofs by squares; `failed` has points and error of squares that failed."""

    def __init__(self, cloud: PointCloud, ground_classes: tuple[int, ...]):
        self.cloud = cloud
        self.failed: list[tuple[np.ndarray, ErrorReport]] = []
        self.indices = np.flatnonzero(~np.isin(cloud.classes, tuple(NO_ROOFS)))
        self.may_be_roof = ~np.isin(cloud.classes[self.indices], ground_classes)
        super().__init__(cloud.xyz[self.indices])

    def skip(self, inside: np.ndarray, error: Exception) -> None:
        self.failed.append((self.indices[inside], report_error(error)))

    def find(
        self, progress: Callable[[int, int], None], squares: set[Square] | None = None
    ) -> np.ndarray:
        """Return ascending indices of points of roofs in `squares`, or in all: else InputError."""
        self.classify(self.squares if squares is None else squares, progress)
        roofs = self.indices[(self.classes == BUILDING) & self.may_be_roof]
        if self.failed or squares is not None:
            return roofs
        return require_roofs(
            roofs, self.cloud, "none of which lies on a smooth surface above the ground"
        )


def select_roof_candidates(cloud: PointCloud, ground_classes: tuple[int, ...]) -> np.ndarray:
    """Return ascending indices of all points whose class may hold roofs; none is an InputError."""
    indices = np.flatnonzero(~np.isin(cloud.classes, (*NO_ROOFS, *ground_classes)))
    return require_roofs(
        indices, cloud, "all of them ground, water, noise, low vegetation or bridges"
    )


def require_roofs(roofs: np.ndarray, cloud: PointCloud, why_not: str) -> np.ndarray:
    """Return the `roofs`, or raise InputError where there are none."""
    if len(roofs):
        return roofs
    where = ", ".join(cloud.sources) or "the cloud"
    raise InputError(
        f"expected buildings in {where}, got {count_things(len(cloud), 'point')} {why_not}; give "
        "--footprints, or name the class that holds roofs with --building-class"
    )
