"""Sorting and copying for compiled code.

Numba compiles its own sorting anew for each kind of array, and with its own assignment of one array
to a part of another a check of their shapes: several seconds, in each process that compiles.
"""

from __future__ import annotations

import numpy as np

from ..compiled import compiled


@compiled
def sort_order(values):
    """Return the order (n,) in which `values` (n,), float64, ascend.

    Equal ones keep their order. No value may be NaN.

    >>> sort_order(np.array([2.0, 3.0, 1.0, 2.0]))
    array([2, 0, 3, 1])
    """
    n, width = len(values), 1
    order, merged = np.arange(n), np.empty(n, np.int64)
    while width < n:
        for start in range(0, n, 2 * width):
            middle, stop = min(start + width, n), min(start + 2 * width, n)
            i, j = start, middle
            for k in range(start, stop):
                if i < middle and (j >= stop or values[order[i]] <= values[order[j]]):
                    merged[k] = order[i]
                    i += 1
                else:
                    merged[k] = order[j]
                    j += 1
        order, merged = merged, order
        width *= 2
    return order


@compiled
def sort_values(values):
    """Return `values` (n,), float64, in ascending order."""
    return values[sort_order(values)]


@compiled
def find_place(ascending, value):
    """Return how many of `ascending` values (n,), float64, are below `value`.

    >>> find_place(np.array([1.0, 2.0, 2.0, 5.0]), 2.0)
    1
    """
    start, stop = 0, len(ascending)
    while start < stop:
        middle = (start + stop) // 2
        if ascending[middle] < value:
            start = middle + 1
        else:
            stop = middle
    return start


@compiled
def measure_range(values):
    """Return the lowest and the highest of `values` (n,), float64.

    They are infinite without any.

    >>> measure_range(np.array([2.0, 1.0, 3.0]))
    (1.0, 3.0)
    """
    lowest, highest = np.inf, -np.inf
    for value in values:
        lowest, highest = min(lowest, value), max(highest, value)
    return lowest, highest


@compiled
def compute_median(values):
    """Return the median of `values` (n,), n > 0, sorted no further than it takes (Hoare)."""
    x, half, low, high = values.copy(), len(values) // 2, 0, len(values) - 1
    while low < high:
        pivot, i, j = x[half], low, high
        while i <= j:
            while x[i] < pivot:
                i += 1
            while pivot < x[j]:
                j -= 1
            if i <= j:
                x[i], x[j] = x[j], x[i]
                i, j = i + 1, j - 1
        if j < half:
            low = i
        if half < i:
            high = j
    return x[half] if len(x) % 2 == 1 else 0.5 * (measure_range(x[:half])[1] + x[half])


@compiled
def list_distinct(values):
    """Return the distinct ones of `values` (n,), float64, in ascending order."""
    ordered, count = sort_values(values), 0
    for i in range(len(ordered)):
        if i == 0 or ordered[i] != ordered[i - 1]:
            ordered[count] = ordered[i]
            count += 1
    return ordered[:count]


@compiled
def copy_row(target, row):
    """Copy `row` (n,) into the first n elements of `target`."""
    for k in range(len(row)):
        target[k] = row[k]


@compiled
def copy_rows(target, rows):
    """Copy `rows` (n, m) into the first n rows of `target`."""
    for k in range(len(rows)):
        copy_row(target[k], rows[k])
