"""Compiled inner loops on points and cells.

They serve PointGrid, thinning and the sorting of a city's points.
"""

from __future__ import annotations

import numpy as np

from ..compiled import compiled


@compiled
def cell_keys(xy, cell_m, first_column, first_row, columns):
    """Return the number (n,) of each point's cell, row by row.

    `first_column`, `first_row` are the first cell's in the world's grid.
    """
    keys = np.empty(len(xy), np.int64)
    for i in range(len(xy)):
        column = np.int64(np.floor(xy[i, 0] / cell_m) - first_column)
        row = np.int64(np.floor(xy[i, 1] / cell_m) - first_row)
        keys[i] = row * columns + column
    return keys


@compiled
def mask_at(mask, xy, index, x_low, y_low):
    """Return the mask's bytes (k,) at the whole-metre cells of `xy[index]`.

    Outside the mask they are 0. The mask's corner is (x_low, y_low).
    """
    result = np.zeros(len(index), np.uint8)
    for k in range(len(index)):
        column = np.int64(np.floor(xy[index[k], 0] - x_low))
        row = np.int64(np.floor(xy[index[k], 1] - y_low))
        if 0 <= column < mask.shape[0] and 0 <= row < mask.shape[1]:
            result[k] = mask[column, row]
    return result


@compiled
def is_first(xyz, hashes):
    """Return whether each of the points (n, 3) is the first at its coordinates.

    The search is open addressing on the points' hashes (n,).
    """
    size = 16
    while size < 2 * len(xyz):
        size *= 2
    slots = np.full(size, -1, np.int64)
    first = np.ones(len(xyz), np.bool_)
    for i in range(len(xyz)):
        slot = np.int64(hashes[i] & np.uint64(size - 1))
        while slots[slot] >= 0:
            j = slots[slot]
            same = hashes[i] == hashes[j] and xyz[i, 0] == xyz[j, 0]
            if same and xyz[i, 1] == xyz[j, 1] and xyz[i, 2] == xyz[j, 2]:
                first[i] = False
                break
            slot = (slot + 1) & (size - 1)
        if first[i]:
            slots[slot] = i
    return first
