"""A volume's planes refitted to the points over which it shows, its slopes tied as it says. Compiled."""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from .volumes import (
    ALL,
    DIRECTION,
    LEVEL,
    OFFSET,
    OPPOSITE,
    PLANES,
    SIDES,
    SLOPE,
    SLOPE_HIGH,
    SLOPE_LOW,
    TIE,
    coefficients,
    distance_up,
    lowest_plane,
    roof_heights,
)

ROUNDS = 2
LEAST_WEIGHT, LEAST_SLOPE_WEIGHT, LEAST_SPREAD_M2 = 1.0, 2.0, 0.02


@compiled
def refit(volumes, scene, k):
    """Two rounds of biweighted least squares for volume k (in place) on the points where it is the one that shows."""
    direction = int(volumes[k, DIRECTION])
    u, v, n = scene.U[direction], scene.V[direction], scene.n
    z_points, tolerance = scene.z, scene.dead + scene.width
    for turn in range(ROUNDS):
        _, top = roof_heights(volumes, scene.U[:, :n], scene.V[:, :n])
        scale = tolerance * (2.0 if turn == 0 else 1.5)
        sums = np.zeros((5, PLANES))  # w, w x, w z, w x x, w x z of each plane
        c = coefficients(volumes, k)
        for i in range(n):
            if top[i] != k:
                continue
            h, plane = lowest_plane(c, u[i], v[i])
            w = 1.0 - ((z_points[i] - h) / scale) ** 2
            if w <= 0.0:
                continue
            w *= w
            x = distance_up(volumes[k], plane, u[i], v[i]) if plane < LEVEL else 0.0
            sums[0, plane] += w
            sums[1, plane] += w * x
            sums[2, plane] += w * z_points[i]
            sums[3, plane] += w * x * x
            sums[4, plane] += w * x * z_points[i]
        solve_planes(volumes[k], sums)


@compiled
def solve_planes(row, sums):
    """Slopes and offsets of a volume from its planes' weighted sums (5, PLANES); what has no points keeps its offset."""
    step = SIDES if row[TIE] == ALL else 2 if row[TIE] == OPPOSITE else 1
    for first in range(0, SIDES, step):
        spread = product = weight = 0.0
        for k in range(first, first + step):
            if row[OFFSET + k] < np.inf and sums[0, k] > LEAST_WEIGHT:
                spread += sums[3, k] - sums[1, k] ** 2 / sums[0, k]
                product += sums[4, k] - sums[1, k] * sums[2, k] / sums[0, k]
                weight += sums[0, k]
        determined = weight > LEAST_SLOPE_WEIGHT and spread > LEAST_SPREAD_M2 * weight
        slope = min(max(product / spread, SLOPE_LOW), SLOPE_HIGH) if determined else -1.0
        for k in range(first, first + step):
            if row[OFFSET + k] < np.inf:
                if slope > 0.0:
                    row[SLOPE + k] = slope
                if sums[0, k] > LEAST_WEIGHT:
                    row[OFFSET + k] = (sums[2, k] - row[SLOPE + k] * sums[1, k]) / sums[0, k]
    if row[OFFSET + LEVEL] < np.inf and sums[0, LEVEL] > LEAST_WEIGHT:
        row[OFFSET + LEVEL] = sums[2, LEVEL] / sums[0, LEVEL]
