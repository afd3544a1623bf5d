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
    REPLACES,
    SIDES,
    SLOPE,
    SLOPE_HIGH,
    SLOPE_LOW,
    TIE,
    U0,
    U1,
    V0,
    V1,
    coefficients,
    distance_up,
    lowest,
    lowest_plane,
)

ROUNDS = 2  # of fitting and re-weighting
# points a plane must show over to be refitted, and to find its slope; m2 of their spread along it
LEAST_WEIGHT, LEAST_SLOPE_WEIGHT, LEAST_SPREAD_M2 = 1.0, 2.0, 0.02


@compiled
def refit(volumes, scene, k):
    """Two rounds of biweighted least squares for volume k (in place) on the points where it is the one that shows."""
    direction = int(volumes[k, DIRECTION])
    u, v, z_points = scene.U[direction], scene.V[direction], scene.z
    members, above, not_below = where_it_may_show(volumes, scene.U, scene.V, scene.n, k)
    for turn in range(ROUNDS):
        scale = (scene.dead + scene.width) * (2.0 if turn == 0 else 1.5)
        sums = np.zeros((5, PLANES))  # w, w x, w z, w x x, w x z of each plane
        c = coefficients(volumes, k)
        for m in range(len(members)):
            i = members[m]
            h = lowest(c, u[i], v[i])
            if not (h > above[m] and h >= not_below[m] and abs(z_points[i] - h) < scale):
                continue
            _, plane = lowest_plane(c, u[i], v[i])
            w = (1.0 - ((z_points[i] - h) / scale) ** 2) ** 2
            x = distance_up(volumes[k], plane, u[i], v[i]) if plane < LEVEL else 0.0
            sums[0, plane] += w
            sums[1, plane] += w * x
            sums[2, plane] += w * z_points[i]
            sums[3, plane] += w * x * x
            sums[4, plane] += w * x * z_points[i]
        solve_planes(volumes[k], sums)


@compiled
def where_it_may_show(volumes, U, V, n, k):
    """Which of the first n points at U, V lie in the rectangle of volume k with none over them that replaces it, and how high it has
    to be to show there: above one height (m,) and not below another (m,)."""
    own = int(volumes[k, DIRECTION])
    members, above, not_below = np.empty(n, np.int64), np.empty(n), np.empty(n)
    m = 0
    for i in range(n):
        if volumes[k, U0] <= U[own, i] <= volumes[k, U1] and volumes[k, V0] <= V[own, i] <= volumes[k, V1]:
            members[m], above[m], not_below[m] = i, -np.inf, -np.inf
            m += 1
    for j in range(len(volumes)):
        if j == k:
            if volumes[k, REPLACES] > 0.0:
                above[:m] = -np.inf
            continue
        direction, replaces, c = int(volumes[j, DIRECTION]), volumes[j, REPLACES] > 0.0, coefficients(volumes, j)
        u, v = U[direction], V[direction]
        u0, u1, v0, v1 = volumes[j, U0], volumes[j, U1], volumes[j, V0], volumes[j, V1]
        for q in range(m):
            i = members[q]
            if u0 <= u[i] <= u1 and v0 <= v[i] <= v1:
                if j > k:
                    not_below[q] = np.inf if replaces else max(not_below[q], lowest(c, u[i], v[i]))
                else:
                    h = lowest(c, u[i], v[i])
                    above[q] = h if replaces else max(above[q], h)
    return members[:m], above[:m], not_below[:m]


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
