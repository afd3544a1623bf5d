"""Points counted by square cells of the world's own grid, and how dense they lie."""

from __future__ import annotations

import numpy as np
import scipy

from ..geometry.grid import cell_range, number_cells


class SquareCells:
    """The cells of side `cell_m` of points (n, 3): tables (columns, rows), flat `index` (n,)."""

    def __init__(self, xyz: np.ndarray, cell_m: float):
        self.cell_m = cell_m
        self.first, self.shape = cell_range(xyz, cell_m)
        self.index = self.of(xyz)

    def of(self, xyz: np.ndarray) -> np.ndarray:
        """Return the flat index (k,) of the cells of `xyz` (k, 3), which are among the points."""
        column, row = (np.floor(xyz[:, :2] / self.cell_m).astype(np.int64) - self.first).T
        return column * self.shape[1] + row

    def count(self, selection: np.ndarray) -> np.ndarray:
        """Return a table of the number of points `selection` (n,) in each cell."""
        return np.bincount(self.index[selection], minlength=self.shape[0] * self.shape[1]).reshape(
            self.shape
        )

    def top(self, values: np.ndarray) -> np.ndarray:
        """Return a table of the largest of the `values` (n,) in each cell, minus infinity else."""
        table = np.full(self.shape[0] * self.shape[1], -np.inf)
        np.maximum.at(table, self.index, values)
        return table.reshape(self.shape)

    def bottom(self, values: np.ndarray) -> np.ndarray:
        """Return a table of the smallest of the `values` (n,) in each cell, NaN else."""
        table = -self.top(-values)
        return np.where(np.isfinite(table), table, np.nan)

    def highest(self, values: np.ndarray, selection: np.ndarray) -> np.ndarray:
        """Return a table of the largest value in each cell and those around it.

        `values` (n,) are those of the points `selection` (n,).
        """
        return scipy.ndimage.maximum_filter(self.top(np.where(selection, values, -np.inf)), 3)

    def compute_local_share(self, selection: np.ndarray, width_m: float) -> np.ndarray:
        """Return the share of `selection` (n,) among points within `width_m` of each flat cell."""
        size = 2 * round((width_m / self.cell_m - 1) / 2) + 1
        mean = [
            scipy.ndimage.uniform_filter(self.count(c).astype(float), size)
            for c in (selection, np.ones(len(selection), bool))
        ]
        return (mean[0] / np.maximum(mean[1], 1e-9)).ravel()


def plan_density(xy: np.ndarray) -> float:
    """Return the points a square metre, the median over occupied cells large enough for four."""
    xy = np.asarray(xy, float)[:, :2]
    for cell_m in (1.0, 2.0, 4.0, 8.0):
        counts = np.bincount(number_cells(np.floor(xy / cell_m))[1])
        if np.median(counts) >= 4:
            break
    return float(np.median(counts)) / cell_m**2
