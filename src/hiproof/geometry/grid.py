"""Cells of a grid in plan, told apart by one whole number each."""

from __future__ import annotations

import math

import numpy as np

# With which a column and a row make one number: as many rows as no grid of a world has.
KEY_OF_CELL = np.array([2**32, 1])
AROUND_KEYS = np.array([(u, v) for u in (-1, 0, 1) for v in (-1, 0, 1)]) @ KEY_OF_CELL


def number_cells(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Number the distinct cells among `cells` (n, 2), by column, then by row.

    Cells are pairs of whole numbers. Returns the distinct cells (k, 2), int64, and the number (n,)
    of each of the `cells`. It is `np.unique(cells, axis=0)`, which compares rows and takes ten
    times as long.

    >>> number_cells(np.array([[2, 5], [-1, 7], [2, 5], [2, 4]]))
    (array([[-1,  7],
           [ 2,  4],
           [ 2,  5]]), array([2, 0, 2, 1]))
    """
    if not len(cells):
        return np.zeros((0, 2), np.int64), np.zeros(0, np.int64)
    cells = cells.astype(np.int64)
    low = cells.min(axis=0)
    column, row = (cells - low).T
    rows = int(row.max()) + 1
    occupied, number = np.unique(column * rows + row, return_inverse=True)
    return np.column_stack(np.divmod(occupied, rows)) + low, number


def count_cells(cells: np.ndarray) -> int:
    """Count the distinct cells among `cells` (n, 2) of whole numbers."""
    return len(number_cells(cells)[0])


def cell_range(xy: np.ndarray, cell_m: float) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return the first (column, row) of the grid's cells that hold `xy` (n, 2), and counts."""
    lower = [math.floor(xy[:, axis].min() / cell_m) for axis in (0, 1)]
    upper = [math.floor(xy[:, axis].max() / cell_m) for axis in (0, 1)]
    return (lower[0], lower[1]), (upper[0] - lower[0] + 1, upper[1] - lower[1] + 1)


def expand(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return for members with so many items each, `counts` (n,), the member and place of each item.

    >>> expand(np.array([2, 0, 1]))
    (array([0, 0, 2]), array([0, 1, 0]))
    """
    member = np.repeat(np.arange(len(counts)), counts)
    return member, np.arange(len(member)) - (np.cumsum(counts) - counts)[member]
