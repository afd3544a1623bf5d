"""Refit a volume's planes to the points over which it is visible. Compiled.

Its slopes are tied as it says.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from .volumes import (
    ALL_EQUAL,
    DIRECTION,
    LEVEL,
    N_PLANES,
    N_SIDES,
    OFFSET0,
    OPPOSITE,
    REPLACES,
    SLOPE0,
    SLOPE_HIGH,
    SLOPE_LOW,
    TIE,
    find_lowest_plane,
    is_within,
    measure_run,
    read_coefficients,
    read_rectangle,
)

FIT_ROUNDS = 2  # Rounds of fitting and re-weighting.
# Least weight (points) of a plane that is refitted. A slope needs twice as much.
LEAST_WEIGHT = 1.0
LEAST_SPREAD_M2 = 0.02  # Least variance (m2) of such points along the slope.


@compiled
def refit(volumes, scene, k, context):
    """Refit volume k, in place, by two rounds of biweighted least squares.

    It is fitted to the points where it is the visible volume.
    """
    direction, n = int(volumes[k, DIRECTION]), scene.n
    u, v, z = scene.U[direction, :n], scene.V[direction, :n], scene.z[:n]
    earlier, later = context.earlier, context.later
    ends, replaces = read_rectangle(volumes, k), volumes[k, REPLACES] > 0.0
    weights, planes = np.empty(n), np.empty(n, np.int64)
    for turn in range(FIT_ROUNDS):
        scale = (scene.dead + scene.width) * (2.0 if turn == 0 else 1.5)
        c = read_coefficients(volumes, k)
        for i in range(n):  # no branches: a processor does several points at once
            h, planes[i] = find_lowest_plane(c, u[i], v[i])
            w = 1.0 - ((z[i] - h) / scale) ** 2
            shows = is_within(ends, u[i], v[i]) & (replaces | (h > earlier[i])) & (h >= later[i])
            weights[i] = w * w if shows & (abs(z[i] - h) < scale) else 0.0
        solve_planes(volumes[k], sum_by_plane(volumes, k, u, v, z, weights, planes))


@compiled
def sum_by_plane(volumes, k, u, v, z, weights, planes):
    """Sum up w, w x, w z, w x x, w x z over the points of each plane of volume k.

    These are the points where the plane is the lowest. The sums are (5, N_PLANES).
    """
    sums = np.zeros((5, N_PLANES))
    for i in range(len(u)):
        w, plane = weights[i], planes[i]
        if w > 0.0:
            x = measure_run(volumes[k], plane, u[i], v[i]) if plane < LEVEL else 0.0
            sums[0, plane] += w
            sums[1, plane] += w * x
            sums[2, plane] += w * z[i]
            sums[3, plane] += w * x * x
            sums[4, plane] += w * x * z[i]
    return sums


@compiled
def solve_planes(row, sums):
    """Solve for a volume's slopes and offsets from its planes' sums (5, N_PLANES).

    A plane without points keeps its offset.
    """
    step = N_SIDES if row[TIE] == ALL_EQUAL else 2 if row[TIE] == OPPOSITE else 1
    for first in range(0, N_SIDES, step):
        spread = product = weight = 0.0
        for k in range(first, first + step):
            if row[OFFSET0 + k] < np.inf and sums[0, k] > LEAST_WEIGHT:
                spread += sums[3, k] - sums[1, k] ** 2 / sums[0, k]
                product += sums[4, k] - sums[1, k] * sums[2, k] / sums[0, k]
                weight += sums[0, k]
        determined = weight > 2.0 * LEAST_WEIGHT and spread > LEAST_SPREAD_M2 * weight
        slope = min(max(product / spread, SLOPE_LOW), SLOPE_HIGH) if determined else -1.0
        for k in range(first, first + step):
            if row[OFFSET0 + k] < np.inf:
                if slope > 0.0:
                    row[SLOPE0 + k] = slope
                if sums[0, k] > LEAST_WEIGHT:
                    row[OFFSET0 + k] = (sums[2, k] - row[SLOPE0 + k] * sums[1, k]) / sums[0, k]
    if row[OFFSET0 + LEVEL] < np.inf and sums[0, LEVEL] > LEAST_WEIGHT:
        row[OFFSET0 + LEVEL] = sums[2, LEVEL] / sums[0, LEVEL]
