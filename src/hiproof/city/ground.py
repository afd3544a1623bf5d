"""The ground around the buildings of a work tile, from one grid of whole-metre cells for all of them.

A cell's height depends on the points in it alone, and a building asks only the cells of its own whole-metre box. So the
answer is the same whatever tile the cells were gathered for, and costs a few table look-ups instead of a triangulation.
"""

from __future__ import annotations

import numpy as np

from ..read.terrain import LowestPointsTerrain, TinTerrain
from ..read.thin import rank_in_cells, thin_to_grid, without_repeats

GROUND_REACH_M = 10.0
RINGS = (2, 5, 9)  # cells looked at around a position, the next where fewer than three are known; within the reach
SOFT_M2 = 0.25  # cells nearer than half a metre weigh about the same
LEVELLING = 0.1  # m2: holds the slope back where cells lie on one side only


class Cells:
    """Known cells as dense tables `x`, `y`, `z` (rows, columns) in world metres, NaN where no point is."""

    def __init__(self, xyz: np.ndarray):
        """`xyz` (n, 3): at most one point a cell."""
        self.low = np.floor(xyz[:, :2].min(axis=0)).astype(np.int64) if len(xyz) else np.zeros(2, np.int64)
        cell = np.floor(xyz[:, :2]).astype(np.int64) - self.low
        size = cell.max(axis=0) + 1 if len(xyz) else (0, 0)
        tables = np.full((3, size[1], size[0]), np.nan)
        tables[:, cell[:, 1], cell[:, 0]] = xyz.T
        self.x, self.y, self.z = tables

    def around(self, xy: np.ndarray, reach: int, box: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Offsets dx, dy and heights z (n, k) of the cells at most `reach` cells from `xy` (n, 2) and inside `box`."""
        steps = np.arange(-reach, reach + 1)
        cell = np.floor(xy).astype(np.int64)
        column = (cell[:, 0, None, None] + steps[None, None, :] + 0 * steps[None, :, None]).reshape(len(xy), -1)
        row = (cell[:, 1, None, None] + steps[None, :, None] + 0 * steps[None, None, :]).reshape(len(xy), -1)
        low = np.maximum(self.low, box[:2]).astype(np.int64)
        high = np.minimum(self.low + self.z.shape[::-1], box[2:]).astype(np.int64)
        inside = (column >= low[0]) & (column < high[0]) & (row >= low[1]) & (row < high[1])
        place = np.where(inside, row - self.low[1], 0), np.where(inside, column - self.low[0], 0)
        z = np.where(inside, self.z[place], np.nan) if self.z.size else np.full(inside.shape, np.nan)
        if not self.z.size:
            return z, z, z
        return self.x[place] - xy[:, :1], self.y[place] - xy[:, 1:], z


class GroundAround:
    """Terrain for one building: a plane through the known cells around each position, the near ones weighing most.

    Moving least squares (Lancaster and Salkauskas 1981) with weights 1 / (distance^2 + SOFT_M2).
    """

    source = TinTerrain.source

    def __init__(self, cells: Cells, box: np.ndarray):
        self.cells, self.box = cells, box

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Height (n,) at `xy_world` (n, 2); NaN where no cell within the last ring is known."""
        xy = np.asarray(xy_world, float)[:, :2]
        heights, unknown = np.full(len(xy), np.nan), np.arange(len(xy))
        for reach in RINGS:
            dx, dy, z = self.cells.around(xy[unknown], reach, self.box)
            enough = np.isfinite(z).sum(axis=1) >= (3 if reach < RINGS[-1] else 1)
            heights[unknown[enough]] = plane_heights(dx[enough], dy[enough], z[enough])
            unknown = unknown[~enough]
            if not len(unknown):
                break
        return heights


def plane_heights(dx: np.ndarray, dy: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Heights (n,) at the origin of the weighted planes through (dx, dy, z) (n, k), NaN standing for no point."""
    known = np.isfinite(z)
    dx, dy, z = (np.where(known, values, 0.0) for values in (dx, dy, z))
    weight = np.where(known, 1.0 / (dx * dx + dy * dy + SOFT_M2), 0.0)
    weight /= weight.sum(axis=1, keepdims=True)
    mean_x, mean_y, mean_z = ((weight * values).sum(axis=1) for values in (dx, dy, z))
    x, y, rise = dx - mean_x[:, None], dy - mean_y[:, None], z - mean_z[:, None]
    xx, yy = (weight * x * x).sum(axis=1) + LEVELLING, (weight * y * y).sum(axis=1) + LEVELLING
    xy, xz, yz = ((weight * a * b).sum(axis=1) for a, b in ((x, y), (x, rise), (y, rise)))
    det = xx * yy - xy * xy
    return mean_z - ((yy * xz - xy * yz) * mean_x + (xx * yz - xy * xz) * mean_y) / det


class LowestAround:
    """The last resort for one building: the lowest known cell around each position, whatever its points' class.

    Where ten cells or more are known the second lowest is taken: one low point is noise, two are ground.
    """

    source = LowestPointsTerrain.source

    def __init__(self, cells: Cells, box: np.ndarray):
        self.cells, self.box = cells, box

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Height (n,) at `xy_world` (n, 2), NaN where no cell is known."""
        _, _, z = self.cells.around(np.asarray(xy_world, float)[:, :2], RINGS[-1], self.box)
        ascending = np.sort(z, axis=1)  # NaN last
        return np.where(np.isfinite(z).sum(axis=1) >= 10, ascending[:, 1], ascending[:, 0])


def ground_cells(xyz: np.ndarray) -> Cells:
    """Cells of ground points (n, 3) from any number of files: mean position and lower median height a cell."""
    return Cells(thin_to_grid(without_repeats(xyz), 1.0))


def lowest_in_cells(xyz: np.ndarray) -> np.ndarray:
    """The lowest height of each whole-metre cell, at the cell's centre: the lowest of lowest is the same however cut."""
    lowest = rank_in_cells(xyz, 1.0, np.zeros_like)
    return np.column_stack([np.floor(lowest[:, :2]) + 0.5, lowest[:, 2]])
