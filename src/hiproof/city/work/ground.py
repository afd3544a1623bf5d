"""The ground around the buildings of a work tile.

It comes from one grid of whole-metre cells for all of them.

A cell's height depends on the points in it alone, and a building asks only the cells of its own
whole-metre box. So the answer is the same whatever tile the cells were gathered for, and costs a
few table look-ups instead of a triangulation.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np

from ...compiled import compiled
from ...geometry.thin import rank_in_cells, thin_to_grid, without_repeats
from ...read.terrain import Terrain
from ..plan.work_plan import VOID_REACH_M

# cells looked at around a position, the next where fewer than three are known; within the reach
RINGS = (2, 5, 9)
# side (m) of squares of a terrain model, of which the last ring reaches so far
FAR_STEP_M = int(VOID_REACH_M) // RINGS[-1]
SOFT_M2 = 0.25  # cells nearer than half a metre weigh about the same
LEVELLING = 0.1  # m2: holds the slope back where cells lie on one side only


class Cells:
    """Known cells as dense tables `x`, `y`, `z` (rows, columns).

    They are world metres, NaN where no point is.
    """

    def __init__(self, xyz: np.ndarray):
        """Make tables of `xyz` (n, 3), at most one point a cell."""
        self.low = (
            np.floor(xyz[:, :2].min(axis=0)).astype(np.int64) if len(xyz) else np.zeros(2, np.int64)
        )
        cell = np.floor(xyz[:, :2]).astype(np.int64) - self.low
        size = cell.max(axis=0) + 1 if len(xyz) else (0, 0)
        tables = np.full((3, size[1], size[0]), np.nan)
        tables[:, cell[:, 1], cell[:, 0]] = xyz.T
        self.x, self.y, self.z = tables

    def inside(self, box: np.ndarray) -> np.ndarray:
        """Return the points (m, 3) of known cells inside a whole-metre box.

        `box` is (xmin, ymin, xmax, ymax).
        """
        left, lower, right, upper = (
            max(int(side) - first, 0)
            for side, first in zip(box, self.low.tolist() * 2, strict=True)
        )
        mask = np.isfinite(self.z[lower:upper, left:right])
        return np.column_stack(
            [table[lower:upper, left:right][mask] for table in (self.x, self.y, self.z)]
        )


class GroundAround:
    """Terrain for one building: a plane through the known cells around.

    Near cells weigh most.

    Moving least squares (Lancaster and Salkauskas 1981) with weights 1 / (distance^2 + SOFT_M2).
    """

    source = "ground points"

    def __init__(self, cells: Cells, box: np.ndarray):
        self.cells, self.box = cells, box

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return the height (n,) at `xy_world` (n, 2).

        It is NaN where no cell within the last ring is known.
        """
        xy, cells = np.ascontiguousarray(xy_world, float), self.cells
        return plane_heights(xy, cells.x, cells.y, cells.z, cells.low, self.box.astype(np.int64))


class ModelAround:
    """Terrain for one building where its terrain model has a void, as around houses.

    It is that of `GroundAround` through the model's heights at the middles of squares of `step_m`,
    which reach as many squares as cells of ground points do.
    """

    def __init__(self, model: Terrain, box: np.ndarray, step_m: int = 1, is_guess: bool = False):
        self.model, self.box, self.step_m, self.is_guess = model, box, step_m, is_guess
        self.source = f"nearest heights of the {model.source}"

    @functools.cached_property
    def around(self) -> GroundAround:
        """Found when first asked for, in units of `step_m`."""
        lower = np.floor(self.box[:2] / self.step_m) - RINGS[-1]
        upper = np.ceil(self.box[2:] / self.step_m) + RINGS[-1]
        x, y = np.meshgrid(*(np.arange(*sides) + 0.5 for sides in zip(lower, upper, strict=True)))
        squares = np.column_stack([x.ravel(), y.ravel()])
        heights = self.model.height_at(squares * self.step_m)
        known = np.column_stack([squares, heights])[np.isfinite(heights)]
        return GroundAround(Cells(known), np.concatenate([lower, upper]))

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return the height (n,) at `xy_world` (n, 2), NaN far from all of the model's."""
        return self.around.height_at(np.asarray(xy_world, float)[:, :2] / self.step_m)


class BareAround:
    """Terrain for one building where no class marks the ground.

    It is the lowest cells, without what stands on it.
    """

    source = "ground found by its shape"

    def __init__(self, cells: Cells, box: np.ndarray):
        self.cells, self.box = cells, box

    @functools.cached_property
    def bare(self) -> GroundAround:
        """Found when first asked for, from the cells inside the box alone."""
        # with scipy.ndimage: not where the clouds have a ground class
        from ...classify.ground import bare_points

        lowest = self.cells.inside(self.box)
        return GroundAround(Cells(bare_points(lowest) if len(lowest) else lowest), self.box)

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return the height (n,) at `xy_world` (n, 2).

        It is NaN where no ground is found within the last ring.
        """
        return self.bare.height_at(xy_world)


class LowestAround:
    """The last resort for one building: the lowest known cell around.

    The class of its points does not matter.

    Where ten cells or more are known the second lowest is taken: one low point is noise, two are
    ground.
    """

    source, is_guess = "lowest points around the building", True

    def __init__(self, cells: Cells, box: np.ndarray):
        self.cells, self.box = cells, box

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return the height (n,) at `xy_world` (n, 2), NaN where no cell is known."""
        xy = np.ascontiguousarray(xy_world, float)
        return lowest_heights(xy, self.cells.z, self.cells.low, self.box.astype(np.int64))


class WhereSeen:
    """A terrain that knows nothing unless `is_seen`.

    That is evaluated only where all better terrains do not know.
    """

    def __init__(self, terrain: Terrain, is_seen: Callable[[], bool]):
        self.terrain, self.is_seen, self.source = terrain, is_seen, terrain.source
        self.is_guess = getattr(terrain, "is_guess", False)

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return the terrain's height (n,) at `xy_world` (n, 2), NaN if unknown."""
        return (
            self.terrain.height_at(xy_world) if self.is_seen() else np.full(len(xy_world), np.nan)
        )


@compiled
def window(x, y, reach, lower, shape, box):
    """Return rows and columns, [first, end), of a window of a table.

    The table's corner is cell `lower`. The window reaches at most `reach` from (x, y), inside
    `box`.
    """
    column, row = np.int64(np.floor(x)), np.int64(np.floor(y))
    rows = (
        max(row - reach, box[1], lower[1]) - lower[1],
        min(row + reach + 1, box[3], lower[1] + shape[0]) - lower[1],
    )
    columns = (
        max(column - reach, box[0], lower[0]) - lower[0],
        min(column + reach + 1, box[2], lower[0] + shape[1]) - lower[0],
    )
    return rows[0], rows[1], columns[0], columns[1]


@compiled
def plane_heights(xy, x, y, z, lower, box):
    """Return the heights (n,) at `xy` (n, 2) of weighted planes.

    They go through the known cells of the tables x, y, z inside `box`.
    """
    heights = np.full(len(xy), np.nan)
    for i in range(len(xy)):
        for reach in RINGS:
            bounds = window(xy[i, 0], xy[i, 1], reach, lower, z.shape, box)
            known_count, total, mean_x, mean_y, mean_z = weighted_mean(xy[i], x, y, z, bounds)
            if known_count >= (3 if reach < RINGS[-1] else 1):
                slope_x, slope_y = weighted_slope(
                    xy[i], x, y, z, bounds, total, mean_x, mean_y, mean_z
                )
                heights[i] = mean_z - slope_x * mean_x - slope_y * mean_y
                break
    return heights


@compiled
def weighted_mean(position, x, y, z, bounds):
    """Return the known cells in `bounds`, their weight and their mean.

    The mean is their offset from `position` (2,) and height.
    """
    count, total, sum_x, sum_y, sum_z = 0, 0.0, 0.0, 0.0, 0.0
    for row in range(bounds[0], bounds[1]):
        for column in range(bounds[2], bounds[3]):
            if not np.isnan(z[row, column]):
                dx, dy = x[row, column] - position[0], y[row, column] - position[1]
                weight = 1.0 / (dx * dx + dy * dy + SOFT_M2)
                count, total = count + 1, total + weight
                sum_x, sum_y, sum_z = (
                    sum_x + weight * dx,
                    sum_y + weight * dy,
                    sum_z + weight * z[row, column],
                )
    if count == 0:
        return 0, 0.0, 0.0, 0.0, 0.0
    return count, total, sum_x / total, sum_y / total, sum_z / total


@compiled
def weighted_slope(position, x, y, z, bounds, total, mean_x, mean_y, mean_z):
    """Return the slope, along x and y, of the plane through known cells.

    Cells are within `bounds`; LEVELLING holds the slope back.
    """
    xx, yy, xy, xz, yz = LEVELLING, LEVELLING, 0.0, 0.0, 0.0
    for row in range(bounds[0], bounds[1]):
        for column in range(bounds[2], bounds[3]):
            if not np.isnan(z[row, column]):
                dx, dy = x[row, column] - position[0], y[row, column] - position[1]
                weight = 1.0 / (dx * dx + dy * dy + SOFT_M2) / total
                dx, dy, rise = dx - mean_x, dy - mean_y, z[row, column] - mean_z
                xx, yy, xy = xx + weight * dx * dx, yy + weight * dy * dy, xy + weight * dx * dy
                xz, yz = xz + weight * dx * rise, yz + weight * dy * rise
    determinant = xx * yy - xy * xy
    return (yy * xz - xy * yz) / determinant, (xx * yz - xy * xz) / determinant


@compiled
def lowest_heights(xy, z, lower, box):
    """Return the lowest known height (n,) around `xy` (n, 2) inside `box`.

    It is the second lowest of ten or more cells of the table z.
    """
    heights = np.full(len(xy), np.nan)
    for i in range(len(xy)):
        bounds = window(xy[i, 0], xy[i, 1], RINGS[-1], lower, z.shape, box)
        count, lowest, second = 0, np.inf, np.inf
        for row in range(bounds[0], bounds[1]):
            for column in range(bounds[2], bounds[3]):
                current = z[row, column]
                if not np.isnan(current):
                    count += 1
                    lowest, second = min(lowest, current), min(second, max(lowest, current))
        if count:
            heights[i] = second if count >= 10 else lowest
    return heights


def ground_cells(xyz: np.ndarray) -> Cells:
    """Return the cells of ground points (n, 3) from any number of files.

    A cell has their mean position and lower median height.
    """
    return Cells(thin_to_grid(without_repeats(xyz), 1.0))


def lowest_in_cells(xyz: np.ndarray) -> np.ndarray:
    """Return the lowest height of each whole-metre cell, at its centre.

    The lowest of lowest is the same however the points are cut.
    """
    lowest = rank_in_cells(xyz, 1.0, np.zeros_like)
    return np.column_stack([np.floor(lowest[:, :2]) + 0.5, lowest[:, 2]])
