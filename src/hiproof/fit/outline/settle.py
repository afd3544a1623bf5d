"""Each side of an outline where the points across it put it: undoing the bias of outermost points.

Across a side of length L the density of points is  density L (Phi(d / blur) + walls N(d; blur)):  even inside, with what a
scanner sees of the wall below the eave piled up on the line. The side's place is the mean of its posterior, over a few values of
blur and walls. Where points come in rows along the side the gap between rows is wider than chance would have it: the side
then lies half a gap beyond the last row.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled import compiled
from .lines import find_corners
from .soft import SURE_BLURS, share_inside

BLURS_M, WALLS_M = (
    (0.02, 0.06, 0.12),
    (0.0, 0.3, 1.0),
)  # points on the wall a metre, as the depth of roof that holds as many
# m across a side at which it is tried: outlines of points lie inside of walls more than outside
OFFSETS_M = np.arange(-0.5, 0.7, 0.02)
DEEP_M, SHALLOW_M, OUTSIDE_M = (
    2.0,
    0.4,
    0.8,
)  # the density is that between shallow and deep; points further out are stray
LEAST_DENSITY, STRAY = 0.3, 0.02  # shares of the outline's density
END_M, LONG_M = 0.3, 1.0  # of a side longer than that, its ends do not count: points there may be another side's
FEWEST, FARTHEST_M = 4, 0.4  # points across a side; fewer tell nothing; m that a side may be moved beyond the last row
ROW_M, MOSTLY = 0.1, 0.6  # points closer across the side are of one row where most of the depth is between rows


def settled(lines: np.ndarray, xy: np.ndarray, density: float) -> np.ndarray:
    """The `lines` (n, 2) of an outline, each moved to where the points `xy` (m, 2) across it put it."""
    corners, moved = np.empty_like(lines), lines.copy()
    find_corners(lines, corners)
    for i, (azimuth, distance) in enumerate(lines):
        normal = np.array([math.cos(azimuth), math.sin(azimuth)])
        along = xy @ [-normal[1], normal[0]]
        low, high = sorted(corners[k % len(lines)] @ [-normal[1], normal[0]] for k in (i, i + 1))
        moved[i, 1] += side_offset(along, distance - xy @ normal, low, high, density)
    return moved if find_corners(moved, corners) else lines


@compiled
def side_offset(along, depth, low, high, density):
    """How far (m) outwards a side from `low` to `high` lies of the line from which `depth` (n,) of points at `along` was measured."""
    if high - low > LONG_M:
        low, high = low + END_M, high - END_M
    across = np.empty(len(depth))
    count = 0
    for k in range(len(depth)):
        if low <= along[k] <= high and -OUTSIDE_M < depth[k] < DEEP_M:
            across[count] = depth[k]
            count += 1
    return offset(across[:count], high - low, density)


@compiled
def offset(depth, length, density):
    """How far (m) outwards a side of `length` lies of where points `depth` (n,) were measured from."""
    if len(depth) < FEWEST:
        return 0.0
    inside = 0
    for d in depth:
        inside += d > SHALLOW_M
    a_metre = max(inside / ((DEEP_M - SHALLOW_M) * length), LEAST_DENSITY * density) * length
    logs = log_likelihoods(depth, a_metre)
    likely = np.exp(logs - logs.max())
    mean = (likely.sum(axis=0) * OFFSETS_M).sum() / likely.sum()
    behind = depth[depth + mean > -ROW_M]
    return mean + min(max(half_gap(behind) - 1.0 / a_metre, 0.0), FARTHEST_M)


@compiled
def log_likelihoods(depth, a_metre):
    """Log likelihoods (blurs x walls, offsets) of the points `depth` (n,) across a side with `a_metre` points a metre of depth."""
    logs = np.empty((len(BLURS_M) * len(WALLS_M), len(OFFSETS_M)))
    for m, walls in enumerate(WALLS_M):
        for q in range(len(OFFSETS_M)):
            logs[m :: len(WALLS_M), q] = -a_metre * (DEEP_M + OFFSETS_M[q] + walls)
    far_in, far_out = math.log(a_metre * (1.0 + STRAY)), math.log(a_metre * STRAY)
    for d in depth:
        if d >= SHALLOW_M - OFFSETS_M[0]:  # inside wherever the side lies
            continue
        for b, blur in enumerate(BLURS_M):
            for q in range(len(OFFSETS_M)):
                away = (d + OFFSETS_M[q]) / blur
                row = len(WALLS_M) * b
                if abs(away) > SURE_BLURS:
                    logs[row : row + len(WALLS_M), q] += far_in if away > 0.0 else far_out
                    continue
                inner = share_inside(away)
                wall = math.exp(-0.5 * away * away) / (blur * math.sqrt(2.0 * math.pi))
                for m, walls in enumerate(WALLS_M):
                    logs[row + m, q] += math.log(a_metre * (inner + walls * wall + STRAY))
    return logs


@compiled
def half_gap(depth):
    """Distance (m) from a line placed by chance to the next point behind it, or the next row where points lie in rows.

    That is half the mean gap, wide gaps being hit more often.
    """
    if len(depth) < 2:
        return 0.0
    depth = np.sort(depth)
    gaps = np.diff(depth)
    if gaps[gaps > ROW_M].sum() > MOSTLY * gaps.sum():
        starts = np.append(np.append(0, np.flatnonzero(gaps > ROW_M) + 1), len(depth))
        rows = np.array([depth[starts[r] : starts[r + 1]].mean() for r in range(len(starts) - 1)])
        gaps = np.diff(rows)
    return (gaps**2).sum() / (2.0 * gaps.sum()) if len(gaps) > 1 and gaps.sum() > 0.0 else 0.0
