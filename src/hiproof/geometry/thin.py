"""Thinning to one point a cell of the world's grid, whatever the order of points and tiles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .grid import number_cells

# sums and comparisons run on whole tenths of a millimetre: integers do not mind their order
UNITS_PER_M = 10_000


def thin_to_grid(xyz: np.ndarray, cell_m: float) -> np.ndarray:
    """Return one point (m, 3) a cell of points (n, 3).

    It has the mean position in plan and the lower median height of the cell's points.

    >>> thin_to_grid(np.array([[0.2, 0.2, 1.0], [0.4, 0.6, 3.0], [0.6, 0.4, 2.0], [1.5, 0.5,
    ...     7.0]]), 1.0).tolist()
    [[0.4, 0.4, 2.0], [1.5, 0.5, 7.0]]
    """
    return rank_in_cells(xyz, cell_m, lambda counts: (counts - 1) // 2)


def thin_to_count(xyz: np.ndarray, limit: int) -> np.ndarray:
    """Keep at most `limit` of the points (n, 3), in their order.

    They are those whose coordinates have the lowest hashes. A hash is as good as a draw, so density
    falls evenly, but it depends on the point alone: the same set of points leaves the same ones,
    however it was cut and whatever order it came in.
    """
    if len(xyz) <= limit:
        return xyz
    return xyz[np.sort(np.argsort(hashes(xyz), kind="stable")[:limit])]


def without_repeats(xyz: np.ndarray) -> np.ndarray:
    """Return the points (n, 3) each once, in the order they came in.

    A point that stands in two overlapping files counts once. Points are told by their hashes, which
    takes a fifth of the time that comparing their coordinates takes.

    >>> len(without_repeats(np.array([[0.2, 0.2, 1.0], [0.4, 0.6, 3.0], [0.2, 0.2, 1.0]])))
    2
    """
    return xyz[np.sort(np.unique(hashes(xyz), return_index=True)[1])]


def hashes(xyz: np.ndarray) -> np.ndarray:
    """Return points' hashes (n,) of 64 bits, mixed as by splitmix64 (Steele et al. 2014)."""
    bits = np.ascontiguousarray(np.asarray(xyz, float)[:, :3]).view(np.uint64)
    mixed = np.zeros(len(bits), np.uint64)
    for column in bits.T:
        mixed ^= column
        mixed += np.uint64(0x9E3779B97F4A7C15)
        for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
            mixed ^= mixed >> np.uint64(shift)
            mixed *= np.uint64(factor)
        mixed ^= mixed >> np.uint64(31)
    return mixed


def rank_in_cells(
    xyz: np.ndarray, cell_m: float, rank: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """Return one point a cell, of the height `rank(counts)` among its ascending heights."""
    if not len(xyz):
        return np.empty((0, 3))
    xyz, cell_m = np.ascontiguousarray(xyz, float), float(cell_m)
    occupied, cell_of = number_cells(np.floor(xyz[:, 1::-1] / cell_m))  # row by row
    counts, corner = np.bincount(cell_of), occupied[:, ::-1] * cell_m
    units = [np.rint((xyz[:, axis] - corner[cell_of, axis]) * UNITS_PER_M) for axis in (0, 1)]
    mean = np.column_stack([np.bincount(cell_of, values) for values in units]) / counts[:, None]
    heights = np.rint(xyz[:, 2] * UNITS_PER_M).astype(np.int64)
    lowest, span = heights.min(), int(np.ptp(heights)) + 1
    ascending = np.sort(cell_of * span + (heights - lowest)) % span + lowest
    selection = np.cumsum(counts) - counts + np.minimum(rank(counts), counts - 1)
    return np.column_stack([corner + mean / UNITS_PER_M, ascending[selection] / UNITS_PER_M])
