"""The ground around the buildings of a work tile, from one grid of whole-metre cells.

A cell's height depends on the points in it alone, and a building asks only the cells of its own
whole-metre box. So the answer is the same whatever tile the cells were gathered for, and costs a
few table look-ups instead of a triangulation.

A terrain model may be of another height system or another date, and a raster may hold codes for "no
data" that its file does not declare. The cloud's own ground points fit the cloud's roofs, so they
count where the two contradict each other.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ...geometry.thin import rank_in_cells, thin_to_grid, without_repeats
from ...read.terrain import Terrain
from ...status import Doubt
from ..plan.work_plan import VOID_REACH_M

# cells looked at around a position, the next where fewer than three are known; within the reach
RINGS = (2, 5, 9)
# side (m) of squares of a terrain model, of which the last ring reaches so far
FAR_STEP_M = int(VOID_REACH_M) // RINGS[-1]
FEWEST_TOGETHER, FEWEST_TO_TELL, LONE_M = 3, 6, 2.0
"""Cells that are no chance together, cells around from which on fewer are left out where they lie
so much (m) below all others: returns that came by way of a wall, in the class of the ground."""

SOFT_M2 = 0.25  # cells nearer than half a metre weigh about the same
LEVELLING = 0.1  # m2: holds the slope back where cells lie on one side only


class Cells:
    """Known cells in world metres: a table `xyz` (rows, columns, 3), NaN without a point."""

    def __init__(self, xyz: np.ndarray):
        """Make the table of `xyz` (n, 3), at most one point a cell."""
        cell = np.floor(xyz[:, :2]).astype(np.int64)
        self.low = cell.min(axis=0) if len(cell) else np.zeros(2, np.int64)
        column, row = (cell - self.low).T
        self.xyz = np.full((row.max(initial=-1) + 1, column.max(initial=-1) + 1, 3), np.nan)
        self.xyz[row, column] = xyz

    def inside(self, box: np.ndarray) -> np.ndarray:
        """Return the points (m, 3) of known cells inside a whole-metre box.

        `box` is (xmin, ymin, xmax, ymax).
        """
        left, lower, right, upper = (
            max(int(side) - first, 0)
            for side, first in zip(box, self.low.tolist() * 2, strict=True)
        )
        xyz = self.xyz[lower:upper, left:right]
        return xyz[np.isfinite(xyz[:, :, 2])]

    def select_around(self, xy: np.ndarray, reach: int, box: np.ndarray) -> np.ndarray:
        """Return cells (n, k, 3) of a box within `reach` of `xy` (n, 2), NaN where no point is."""
        row, column = np.indices(2 * (2 * reach + 1,)).reshape(2, -1) - reach
        cell = np.floor(xy).astype(np.int64)[:, None] + np.column_stack([column, row]) - self.low
        lower = np.maximum(box[:2].astype(np.int64) - self.low, 0)
        upper = np.minimum(box[2:].astype(np.int64) - self.low, self.xyz.shape[1::-1])
        is_in = ((cell >= lower) & (cell < upper)).all(axis=2)
        around = np.full(cell.shape[:2] + (3,), np.nan)
        around[is_in] = self.xyz[cell[is_in, 1], cell[is_in, 0]]
        return around


@dataclass
class GroundAround:
    """Terrain for one building: a plane through the known cells around.

    Near cells weigh most.

    Moving least squares (Lancaster and Salkauskas 1981) with weights 1 / (distance^2 + SOFT_M2).
    """

    cells: Cells
    box: np.ndarray
    source = "ground points"

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return heights (n,) at `xy_world` (n, 2), NaN where the last ring holds no cell."""
        xy = np.asarray(xy_world, float)[:, :2]
        heights, missing = np.full(len(xy), np.nan), np.arange(len(xy))
        for reach in RINGS:
            around = leave_out_lone(self.cells.select_around(xy[missing], reach, self.box))
            known = np.isfinite(around[:, :, 2]).sum(axis=1)
            is_enough = known >= (3 if reach < RINGS[-1] else 1)
            heights[missing[is_enough]] = fit_planes(xy[missing[is_enough]], around[is_enough])
            missing = missing[~is_enough]
        return heights


@dataclass
class ModelAround:
    """Terrain for one building where its terrain model has a void, as around houses.

    It is that of `GroundAround` through the model's heights at the middles of squares of `step_m`,
    which reach as many squares as cells of ground points do.
    """

    model: Terrain
    box: np.ndarray
    step_m: int = 1
    is_guess: bool = False

    @property
    def source(self) -> str:
        return f"nearest heights of the {self.model.source}"

    @functools.cached_property
    def around(self) -> GroundAround:
        """Found when first asked for, in units of `step_m`."""
        lower = np.floor(self.box[:2] / self.step_m) - RINGS[-1]
        upper = np.ceil(self.box[2:] / self.step_m) + RINGS[-1]
        middles = (np.arange(*sides) + 0.5 for sides in zip(lower, upper, strict=True))
        squares = np.stack(np.meshgrid(*middles), axis=-1).reshape(-1, 2)
        heights = self.model.height_at(squares * self.step_m)
        known = np.column_stack([squares, heights])[np.isfinite(heights)]
        return GroundAround(Cells(known), np.concatenate([lower, upper]))

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return the height (n,) at `xy_world` (n, 2), NaN far from all of the model's."""
        return self.around.height_at(np.asarray(xy_world, float)[:, :2] / self.step_m)


@dataclass
class BareAround:
    """Terrain for one building where no class marks the ground: its lowest cells."""

    find_cells: Callable[[], Cells]
    box: np.ndarray
    source = "ground found by its shape"

    @functools.cached_property
    def bare(self) -> GroundAround:
        """Found from the cells inside the box alone."""
        # with scipy.ndimage: not where the clouds have a ground class
        from ...classify.ground import bare_points

        lowest = self.find_cells().inside(self.box)
        return GroundAround(Cells(bare_points(lowest) if len(lowest) else lowest), self.box)

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return heights (n,) at `xy_world` (n, 2), NaN where the last ring holds no ground."""
        return self.bare.height_at(xy_world)


@dataclass
class LowestAround:
    """The last resort for one building: the lowest known cell around.

    The class of its points does not matter.

    Where ten cells or more are known the second lowest is taken: one low point is noise, two are
    ground.
    """

    find_cells: Callable[[], Cells]
    box: np.ndarray
    source, is_guess = "lowest points around the building", True

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return the height (n,) at `xy_world` (n, 2), NaN where no cell is known."""
        xy = np.asarray(xy_world, float)[:, :2]
        around = self.find_cells().select_around(xy, RINGS[-1], self.box)
        heights = np.sort(around[:, :, 2], axis=1)
        is_many = np.isfinite(heights[:, 9])
        return np.where(is_many, heights[:, 1], heights[:, 0])


def leave_out_lone(cells: np.ndarray) -> np.ndarray:
    """Return cells (n, k, 3) in which those that lie alone, far below all others, are NaN."""
    ascending = np.sort(cells[:, :, 2], axis=1)
    least = ascending[:, FEWEST_TOGETHER - 1] - LONE_M
    is_lone = (cells[:, :, 2] < least[:, None]) & np.isfinite(ascending[:, [FEWEST_TO_TELL - 1]])
    return np.where(is_lone[:, :, None], np.nan, cells)


def fit_planes(position: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the heights (n,) at each `position` (n, 2) of planes through cells (n, k, 3).

    Unknown cells are NaN; LEVELLING holds the slope back.
    """
    is_known = np.isfinite(cells[:, :, 2])
    off = np.where(is_known[:, :, None], cells, 0.0)
    off[:, :, :2] -= position[:, None]
    weight = is_known / ((off[:, :, :2] ** 2).sum(axis=2) + SOFT_M2)
    weight /= weight.sum(axis=1, keepdims=True)
    mean = np.einsum("nk,nkc->nc", weight, off)
    off -= mean[:, None]
    plan, weighted = off[:, :, :2], off[:, :, :2] * weight[:, :, None]
    normal = plan.swapaxes(1, 2) @ weighted + LEVELLING * np.eye(2)
    slope = np.linalg.solve(normal, weighted.swapaxes(1, 2) @ off[:, :, 2:])[:, :, 0]
    return mean[:, 2] - (slope * mean[:, :2]).sum(axis=1)


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


FAR_GROUND_M = 2.0
"""Difference (m) between a terrain model and ground points from which on it is remarked: two dates,
or two systems.
"""

ASIDE_M = np.array([4.0, 6.0, 8.0])
"""Distances (m) beside the corners of an outline at which a terrain model is looked at: a raster of
2 m mixes no cell of the outline there."""

INSIDE_M, LEAST_STEP_M, LEAST_ERROR_M, STEP_SIGMAS = 1.5, 1.0, 0.5, 5.0
"""Distance (m) inside the corners at which all of a step shows, its least height (m), that of what
shows of it at the corners, where a raster is interpolated, and least number of standard deviations
of what lies beside it. Houses stand on terraces up to a metre high."""

OTHER_GROUND_M = 5.0
"""Difference (m) from which on the model's height is not used: height systems differ by 10 to 100
m, codes for "no data" by more, while a model and ground points of one place agree within 2 m also
on slopes.
"""


class TerrainModel(Terrain, Protocol):
    """A terrain that also knows where its raster holds a code for "no data"."""

    def is_coded_at(self, xy_world: np.ndarray) -> np.ndarray: ...


class WhereLikeGround:
    """A terrain model, unknown where it lies far from the `ground` points.

    Where these are unknown it counts.
    """

    def __init__(self, model: Terrain, ground: Terrain):
        self.model, self.ground, self.source = model, ground, model.source

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return the model's heights (n,), NaN where it has none or contradicts ground points."""
        heights = self.model.height_at(xy_world)
        gap = np.abs(heights - self.ground.height_at(xy_world))
        return np.where(gap > OTHER_GROUND_M, np.nan, heights)


def check_terrain(model: TerrainModel, ground: Terrain, xy: np.ndarray) -> str:
    """Return a remark where the terrain model has no true height, else an empty one.

    It has none at some of the corners `xy` (n, 2) of an outline, or lies far above or below the
    ground points there, or rises from them at the outline alone. Without ground points its own
    heights beside the outline count.
    """
    coded = model.is_coded_at(xy)
    if coded.any():
        text = "" if coded.all() else "part of "
        mask = np.isfinite(ground.height_at(xy[coded])).all()
        use = "the ground points are used there" if mask else "it is not used there"
        return (
            f"the {model.source} {Doubt.TERRAIN_WITHOUT_HEIGHTS.value} under {text}the building; "
            f"{use}"
        )

    def compare(xy: np.ndarray) -> np.ndarray:
        return np.asarray(model.height_at(xy) - ground.height_at(xy))

    gap, doubt = compare(xy), Doubt.TERRAIN_UNLIKE_GROUND_POINTS
    is_other, is_known = np.abs(gap) > OTHER_GROUND_M, np.isfinite(gap)
    if not is_known.any():
        doubt, above = Doubt.TERRAIN_UNLIKE_AROUND, measure_step(model.height_at, xy)
    else:
        above = float(np.median(gap[is_other if is_other.any() else is_known]))
        above = above if abs(above) > FAR_GROUND_M else measure_step(compare, xy)
    if not above:
        return ""
    way = "above" if above > 0 else "below"
    use = ", which are used instead" if is_other.any() else ""
    return f"the {model.source} lies {abs(above):.1f} m {way} {doubt.value}{use}"


def measure_step(find_heights: Callable[[np.ndarray], np.ndarray], xy: np.ndarray) -> float:
    """Return by how much (m) heights rise or fall at the corners `xy` (n, 2) of an outline.

    The step is 0 where a plane beside the corners explains it.
    """
    away = xy - xy.mean(axis=0)
    away /= np.maximum(np.hypot(*away.T), 1.0)[:, None]
    rings = [xy + distance * away for distance in (0.0, -INSIDE_M, *ASIDE_M)]
    heights = find_heights(np.concatenate(rings)).reshape(len(rings), -1)
    design = np.dstack([rings, np.ones(heights.shape)]) - [*xy.mean(axis=0), 0.0]
    known = np.isfinite(heights)
    if not known[:2].any(axis=1).all() or known[2:].sum() < FEWEST_TO_TELL:
        return 0.0
    plane = np.linalg.lstsq(design[2:][known[2:]], heights[2:][known[2:]], rcond=None)[0]
    off = heights - design @ plane
    error, step = np.nanmedian(off[:2], axis=1).tolist()
    least_m = max(LEAST_STEP_M, STEP_SIGMAS * float(np.nanstd(off[2:])))
    return error if abs(step) > least_m and abs(error) > LEAST_ERROR_M else 0.0
