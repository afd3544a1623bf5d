"""Compiled sampling and grouping: the parts of PointNet++ that choose points and carry no weights."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True)
def farthest_point_order(xyz, count):
    """Order in which farthest-point sampling visits `xyz` (n, 3): indices (min(count, n),), a prefix a coarser sample.

    The first point is the farthest from the centroid, so that the order depends neither on the points' order nor on
    the frame. Also returns the covering radius after each choice (metres): the largest distance of any point to its
    nearest chosen one.

    >>> order, radius = farthest_point_order(np.array([[0.0, 0, 0], [1, 0, 0], [5, 0, 0]]), 3)
    >>> order.tolist(), radius.tolist()
    ([2, 0, 1], [5.0, 1.0, 0.0])
    """
    n = len(xyz)
    count = min(count, n)
    order = np.empty(count, np.int64)
    radius = np.empty(count)
    centre_x, centre_y, centre_z = xyz[:, 0].mean(), xyz[:, 1].mean(), xyz[:, 2].mean()
    current, farthest = 0, -1.0
    for i in range(n):
        d = (xyz[i, 0] - centre_x) ** 2 + (xyz[i, 1] - centre_y) ** 2 + (xyz[i, 2] - centre_z) ** 2
        if d > farthest:
            current, farthest = i, d
    squared = np.full(n, np.inf)
    for k in range(count):
        order[k] = current
        x, y, z = xyz[current, 0], xyz[current, 1], xyz[current, 2]
        current, farthest = 0, -1.0
        for i in range(n):
            d = (xyz[i, 0] - x) ** 2 + (xyz[i, 1] - y) ** 2 + (xyz[i, 2] - z) ** 2
            if d < squared[i]:
                squared[i] = d
            if squared[i] > farthest:
                current, farthest = i, squared[i]
        radius[k] = np.sqrt(farthest)
    return order, radius


@numba.njit(cache=True)
def ball_neighbours(centres, sources, count, radius):
    """The nearest `count` of `sources` (m, 3) within `radius` of each of `centres` (s, 3): indices, distances (s, count).

    Missing neighbours repeat the nearest one, which a maximum over the group does not notice; the nearest source
    counts even if it lies outside the ball.

    >>> sources = np.array([[0.0, 0, 0], [1, 0, 0], [9, 0, 0]])
    >>> ball_neighbours(sources[:1], sources, 3, 2.0)[0].tolist()
    [[0, 1, 0]]
    """
    indices = np.empty((len(centres), count), np.int64)
    distances = np.empty((len(centres), count))
    squared = np.empty(count)
    for s in range(len(centres)):
        found = 0
        for m in range(len(sources)):
            d = 0.0
            for axis in range(3):
                d += (centres[s, axis] - sources[m, axis]) ** 2
            if found == count and d >= squared[count - 1]:
                continue
            place = min(found, count - 1)
            while place > 0 and squared[place - 1] > d:
                squared[place], indices[s, place] = squared[place - 1], indices[s, place - 1]
                place -= 1
            squared[place], indices[s, place] = d, m
            found = min(found + 1, count)
        for k in range(count):
            if k >= found or squared[k] > radius * radius:
                squared[k], indices[s, k] = squared[0], indices[s, 0]
            distances[s, k] = np.sqrt(squared[k])
    return indices, distances


def thin_to_grid(xyz, count, chunk=500_000):
    """Indices of one point a grid cell, the cell chosen so that about `count` or fewer of `xyz` (n, 3) remain.

    Works in pieces of `chunk` points, so that memory beyond the input is bounded. Clouds of `count` points or fewer
    are kept whole.
    """
    n = len(xyz)
    if n <= count:
        return np.arange(n)
    low = xyz.min(axis=0)
    extent = np.maximum(xyz.max(axis=0) - low, 1e-6)
    cell = max(np.sqrt(extent[0] * extent[1] / count), extent.max() / 1e6)
    while True:
        kept = first_of_each_cell(xyz, low, cell, chunk)
        if len(kept) <= count:
            return kept
        cell *= max(1.1, np.sqrt(len(kept) / count))


def first_of_each_cell(xyz, low, cell, chunk):
    """Indices of the first point in each cube of side `cell`, ascending."""
    seen = np.empty(0, np.int64)
    kept = []
    for start in range(0, len(xyz), chunk):
        steps = np.floor((xyz[start : start + chunk] - low) / cell).astype(np.int64)
        keys, first = np.unique((steps[:, 0] << 42) + (steps[:, 1] << 21) + steps[:, 2], return_index=True)
        new = ~np.isin(keys, seen, assume_unique=True)
        seen = np.union1d(seen, keys[new])
        kept.append(start + first[new])
    return np.sort(np.concatenate(kept))
