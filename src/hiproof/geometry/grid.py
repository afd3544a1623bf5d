"""Cells of a grid in plan, told apart by one whole number each."""

from __future__ import annotations

import numpy as np


def number_cells(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Number the distinct cells among `cells` (n, 2), by column, then by row.

    Cells are pairs of whole numbers.

    Returns the distinct cells (k, 2), int64, and the number (n,) of each of the `cells`. It is
    `np.unique(cells, axis=0)`, which compares rows and takes ten times as long.

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
    keys, number = np.unique(column * rows + row, return_inverse=True)
    return np.column_stack(np.divmod(keys, rows)) + low, number


def count_cells(cells: np.ndarray) -> int:
    """Count the distinct cells among `cells` (n, 2) of whole numbers."""
    return len(number_cells(cells)[0])
