"""Sides moved to where the points across them lie. Compiled.

It undoes the bias of outermost points.

Across a side of length L the density of points is density L (Phi(d / blur) + walls N(d; blur)):
even inside, with what a scanner sees of the wall below the eave piled up on the line. The side's
place is the mean of its posterior, over a few values of blur and walls. Where points come in rows
along the side the gap between rows is wider than chance would have it: the side then lies half a
gap beyond the last row.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from ...compiled import compiled
from ...geometry.arrays import measure_range, sort_values
from .lines import find_corners
from .soft import SURE_BLURS, share_inside

BLURS_M, WALLS_M = (
    (0.02, 0.06, 0.12),
    (0.0, 0.3, 1.0),
)  # points on the wall a metre, as the depth of roof that holds as many
# m across a side at which it is tried, and between two of them: outlines of points lie inside of
# walls more than outside
STEP_M = 0.02
OFFSETS_M = np.arange(-0.5, 0.7, STEP_M)
# places a step at which densities are kept; between them they are straight, to a thousandth of
# their logarithm
OFFSET_STEPS = 32
DEEP_M, SHALLOW_M, OUTSIDE_M = (
    2.0,
    0.4,
    0.8,
)  # the density is that between shallow and deep; points further out are stray
LEAST_DENSITY, STRAY_SHARE = 0.3, 0.02  # shares of the outline's density
# of a side longer than that, its ends do not count: points there may be another side's
END_M, LONG_M = 0.3, 1.0
# points across a side; fewer tell nothing; m that a side may be moved beyond the last row
FEWEST, FARTHEST_MOVE_M = 4, 0.4
# points closer across the side are of one row where most of the depth is between rows
ROW_M, MOSTLY_ON_POINTS = 0.1, 0.6


def settle_lines(lines: np.ndarray, xy: np.ndarray, density: float) -> np.ndarray:
    """Move each of the `lines` (n, 2) to where the points `xy` (m, 2) put it."""
    corners, moved = np.empty_like(lines), lines.copy()
    find_corners(lines, corners, -1)
    normals = np.column_stack([np.cos(lines[:, 0]), np.sin(lines[:, 0])])
    ends = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    moved[:, 1] += side_offsets(xy, normals, lines[:, 1], ends, density)
    return moved if find_corners(moved, corners, -1) else lines


def side_offsets(
    xy: np.ndarray, normals: np.ndarray, distances: np.ndarray, ends: np.ndarray, density: float
) -> np.ndarray:
    """Return how far (m,) outwards points `xy` (n, 2) move sides.

    Sides have `normals` (m, 2), lie `distances` (m,) from the origin along these and run between
    `ends` (m, 2, 2).
    """
    distances = np.ascontiguousarray(distances)  # one kind of array is compiled
    return offsets_by(xy, normals, distances, ends, density, log_densities())


@functools.cache
def log_densities() -> np.ndarray:
    """Return logarithms of the density of points across a side.

    They are relative to that inside: (blurs x walls, FINE, k), the places FINE apart in a row, so
    that those of one point under all offsets lie side by side.
    """
    count = (
        round((SHALLOW_M - OFFSETS_M[0] + OUTSIDE_M + OFFSETS_M[-1] - OFFSETS_M[0]) / STEP_M) + 2
    )
    return log_densities_at(OFFSETS_M[0] - OUTSIDE_M, count)


@compiled
def log_densities_at(first, count):
    """Return `log_densities` from the depth `first` on for `count` steps."""
    table = np.empty((len(BLURS_M) * len(WALLS_M), OFFSET_STEPS, count))
    for b, blur in enumerate(BLURS_M):
        for m, walls in enumerate(WALLS_M):
            for p in range(OFFSET_STEPS):
                for k in range(count):
                    distance = (first + (k + p / OFFSET_STEPS) * STEP_M) / blur
                    density = 1.0 if distance > 0.0 else 0.0
                    if abs(distance) <= SURE_BLURS:
                        wall = math.exp(-0.5 * distance * distance) / (
                            blur * math.sqrt(2.0 * math.pi)
                        )
                        density = share_inside(distance) + walls * wall
                    table[len(WALLS_M) * b + m, p, k] = math.log(density + STRAY_SHARE)
    return table


@compiled
def offsets_by(xy, normals, distances, ends, density, table):
    """Return `side_offsets` by the table of `log_densities`."""
    offsets = np.empty(len(normals))
    for m in range(len(normals)):
        lower, upper = compute_span(normals[m], ends[m])
        if upper - lower > LONG_M:
            lower, upper = lower + END_M, upper - END_M
        offsets[m] = interpolate_offset(
            depths_across(xy, normals[m], distances[m], lower, upper), upper - lower, density, table
        )
    return offsets


@compiled
def compute_span(normal, ends):
    """Return the span of a side with `ends` (2, 2), square to its `normal`."""
    first, last = (
        normal[0] * ends[0, 1] - normal[1] * ends[0, 0],
        normal[0] * ends[1, 1] - normal[1] * ends[1, 0],
    )
    return min(first, last), max(first, last)


@compiled
def depths_across(xy, normal, distance, lower, upper):
    """Return the depths (k,) of the points that determine a side.

    They lie across it from `lower` to `upper`, near enough.
    """
    depths, count = np.empty(len(xy)), 0
    for k in range(len(xy)):
        depth = distance - normal[0] * xy[k, 0] - normal[1] * xy[k, 1]
        if (
            -OUTSIDE_M < depth < DEEP_M
            and lower <= normal[0] * xy[k, 1] - normal[1] * xy[k, 0] <= upper
        ):
            depths[count] = depth
            count += 1
    return depths[:count]


@compiled
def interpolate_offset(depth, length, density, table):
    """Return how far (m) a side lies outwards of its assumed place.

    The points `depth` (n,) were measured from that place; the side is `length` long.
    """
    if len(depth) < FEWEST:
        return 0.0
    inside = 0
    for d in depth:
        inside += d > SHALLOW_M
    a_metre = max(inside / ((DEEP_M - SHALLOW_M) * length), LEAST_DENSITY * density) * length
    logs = log_likelihoods(depth, a_metre, table)
    top, moment = -np.inf, 0.0
    for row in logs:
        top = max(top, measure_range(row)[1])
    likely = np.exp(logs - top)
    for q in range(len(OFFSETS_M)):
        share = 0.0
        for walls in range(len(likely)):
            share += likely[walls, q]
        moment += share * OFFSETS_M[q]
    mean = moment / likely.sum()
    behind = depth[depth + mean > -ROW_M]
    return mean + min(max(half_gap(behind) - 1.0 / a_metre, 0.0), FARTHEST_MOVE_M)


@compiled
def log_likelihoods(depth, a_metre, table):
    """Return log likelihoods (blurs x walls, offsets) of points `depth` (n,).

    They lie across a side with `a_metre` points a metre of depth.
    """
    logs = np.empty((len(BLURS_M) * len(WALLS_M), len(OFFSETS_M)))
    for m, walls in enumerate(WALLS_M):
        for q in range(len(OFFSETS_M)):
            logs[m :: len(WALLS_M), q] = -a_metre * (DEEP_M + OFFSETS_M[q] + walls)
    counted, count = 0, len(OFFSETS_M)
    for d in depth:
        if d >= SHALLOW_M - OFFSETS_M[0]:  # inside wherever the side lies
            continue
        counted += 1
        place = (d + OUTSIDE_M) / STEP_M
        k = int(place)
        p = int((place - k) * OFFSET_STEPS)
        excess = (place - k) * OFFSET_STEPS - p
        then, remainder = (k, p + 1) if p + 1 < OFFSET_STEPS else (k + 1, 0)
        for row in range(len(logs)):  # along arrays of their own: several offsets at once
            sums, near = logs[row], table[row, p, k : k + count]
            far = table[row, remainder, then : then + count]
            for q in range(count):
                sums[q] += (1.0 - excess) * near[q] + excess * far[q]
    return logs + counted * math.log(a_metre)


@compiled
def half_gap(depth):
    """Return the distance (m) from a random line to the next point behind it.

    Where points lie in rows it is that to the next row.

    That is half the mean gap, wide gaps being hit more often.
    """
    if len(depth) < 2:
        return 0.0
    depth = sort_values(depth)
    gaps = depth[1:] - depth[:-1]
    if gaps[gaps > ROW_M].sum() > MOSTLY_ON_POINTS * gaps.sum():
        rows, count, first = np.empty(len(depth)), 0, 0
        for k in range(len(depth)):
            if k == len(gaps) or gaps[k] > ROW_M:
                rows[count] = depth[first : k + 1].mean()
                count, first = count + 1, k + 1
        gaps = rows[1:count] - rows[: count - 1]
    return (gaps**2).sum() / (2.0 * gaps.sum()) if len(gaps) > 1 and gaps.sum() > 0.0 else 0.0
