"""What a roof costs, in points: its misfit, its volumes, and every step between them that shows. Compiled.

    sum over points of min((max(|dz| - dead, 0) / width)^2, 1)
    + sum over ghosts (places without points) of their weight, where the roof leaves the points' range of heights,
      and a little where it is high although no point was seen around: what is hidden is lower
    + evidence * (volumes + offsets + slopes + edges that show)

An edge that shows is a step in the roof: it costs a fixed sum, more by the metre, most for low steps, which nearly always
stand for a valley or a needless cut, and something extra where no corner of the outline lies in line with it.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled import compiled
from .volumes import (
    BASE_COST,
    DIRECTION,
    REPLACES,
    U0,
    U1,
    V0,
    V1,
    coefficients,
    is_allowed,
    lowest,
    roof_heights,
    volume_cost,
)

STEP_M, INSIDE_M, LEAST_STEP_LENGTH_M = 0.05, 0.2, 0.55  # a gap that is a step; how far inside the outline it shows
AT_CORNER_M, END_AT_CORNER_M = 0.25, 0.7
SAMPLE_M, MOST_SAMPLES = 0.5, 40
TOUCH_M = 0.03
BASE_SHARE = 0.01  # of the outline's area: the base costs nothing where less of it shows


@compiled
def point_cost(z_point, z_roof, dead, width):
    r = max(abs(z_point - z_roof) - dead, 0.0) / width
    r *= r
    return r if r < 1.0 else 1.0


@compiled
def ghost_cost(z_roof, weight, shade, low, high):
    if z_roof < low or z_roof > high:
        return weight
    return shade * (z_roof - low) / (high - low)


@compiled
def place_cost(scene, i, z_roof):
    """Cost of point or ghost i under a roof `z_roof` high there."""
    if i < scene.n:
        return point_cost(scene.z[i], z_roof, scene.dead, scene.width)
    return ghost_cost(z_roof, scene.weight[i], scene.shade[i], scene.low, scene.high)


@compiled
def costs(z, scene):
    """Cost (n + g,) of every point and ghost under roof heights `z` (n + g,)."""
    cost = np.empty(len(z))
    for i in range(len(z)):
        cost[i] = place_cost(scene, i, z[i])
    return cost


@compiled
def objective(volumes, scene, limit):
    """The roof's cost; infinite where a shape is not allowed, and as soon as it is known to be above `limit`."""
    for k in range(1, len(volumes)):
        if not is_allowed(volumes[k], scene.allowed):
            return np.inf
    z, top = roof_heights(volumes, scene.U, scene.V)
    total, bare = costs(z, scene).sum(), 0.0
    for k in range(1, len(volumes)):
        total += scene.evidence * volume_cost(volumes[k])
    for i in range(scene.n, len(z)):
        if top[i] == 0:
            bare += scene.weight[i]
    if bare > BASE_SHARE * scene.n:
        total += scene.evidence * BASE_COST
    for k in range(1, len(volumes)):
        for edge in range(4):
            if total > limit:
                return np.inf
            total += scene.evidence * edge_cost(volumes, scene, k, edge)
    return total if total <= limit else np.inf


@compiled
def base_shows(volumes, scene):
    """Whether a noticeable share of the outline is roofed by the base."""
    _, top = roof_heights(volumes, scene.U, scene.V)
    return scene.weight[scene.n :][top[scene.n :] == 0].sum() > BASE_SHARE * scene.n


@compiled
def edge_cost(volumes, scene, k, edge):
    """Units of complexity for what shows of one edge (0 u low, 1 u high, 2 v low, 3 v high) of volume k."""
    direction = int(volumes[k, DIRECTION])
    at = volumes[k, U0 + edge]
    start, end = (volumes[k, V0], volumes[k, V1]) if edge < 2 else (volumes[k, U0], volumes[k, U1])
    count = min(MOST_SAMPLES, max(2, int((end - start) / SAMPLE_M) + 1))
    step = (end - start) / count
    u, v = np.empty(count), np.empty(count)
    m = samples_inside(scene, direction, at, start, step, edge < 2, u, v)
    if m * step < LEAST_STEP_LENGTH_M:
        return 0.0
    inside, outside = np.full(m, -np.inf), np.full(m, -np.inf)
    heights_along(volumes, scene, k, u[:m], v[:m], inside, outside)
    any_step, a_metre, low_a_metre, low_step, loose, at_corner = scene.edge_prices
    shown = low = 0.0
    for p in range(m):
        gap = abs(inside[p] - outside[p])
        if gap > STEP_M:
            shown += step
            if gap < low_step:
                low += step
    if shown < LEAST_STEP_LENGTH_M:
        return 0.0
    cost = any_step + a_metre * shown + low_a_metre * low
    if not is_vertex_line(scene, direction, edge // 2, at):
        return cost + loose
    along = v if edge < 2 else u
    return cost - at_corner * ends_at_corners(scene, direction, edge // 2, at, along[0], along[m - 1])


@compiled
def samples_inside(scene, direction, at, start, step, along_v, u, v):
    """Fill `u`, `v` with the samples of an edge that lie well inside the outline; returns how many."""
    c, s = scene.turn[direction]
    depth, pitch = scene.depth, scene.pitch
    m = 0
    for q in range(len(u)):
        t = start + (q + 0.5) * step
        a, b = (at, t) if along_v else (t, at)
        i = math.floor((c * a - s * b - scene.corner_u) / pitch + 0.5)
        j = math.floor((s * a + c * b - scene.corner_v) / pitch + 0.5)
        if 0 <= i < depth.shape[0] and 0 <= j < depth.shape[1] and depth[i, j] >= INSIDE_M:
            u[m], v[m] = a, b
            m += 1
    return m


@compiled
def heights_along(volumes, scene, k, u, v, inside, outside):
    """Heights just inside and just outside of volume k at its own edge's samples `u`, `v`, in its direction."""
    own = int(volumes[k, DIRECTION])
    for j in range(len(volumes)):
        c, replaces = coefficients(volumes, j), volumes[j, REPLACES] > 0.0
        if j == k:
            for p in range(len(u)):
                h = lowest(c, u[p], v[p])
                inside[p] = h if replaces else max(h, outside[p])
            continue
        other = int(volumes[j, DIRECTION])
        cosine = scene.turn[other, 0] * scene.turn[own, 0] + scene.turn[other, 1] * scene.turn[own, 1]
        sine = scene.turn[other, 1] * scene.turn[own, 0] - scene.turn[other, 0] * scene.turn[own, 1]
        u0, u1, v0, v1 = volumes[j, U0], volumes[j, U1], volumes[j, V0], volumes[j, V1]
        for p in range(len(u)):
            a, b = cosine * u[p] + sine * v[p], cosine * v[p] - sine * u[p]
            if u0 - TOUCH_M <= a <= u1 + TOUCH_M and v0 - TOUCH_M <= b <= v1 + TOUCH_M:
                h = lowest(c, a, b)
                inside[p] = h if replaces else max(h, inside[p])
                outside[p] = h if replaces else max(h, outside[p])


@compiled
def ends_at_corners(scene, direction, axis, at, first, last):
    """How many of the two ends of what lies of the line `at` inside the outline are at corners of it."""
    corners = scene.corners[direction]
    low = high = 0
    for q in range(len(corners)):
        if abs(corners[q, axis] - at) < AT_CORNER_M:
            low = max(low, int(abs(corners[q, 1 - axis] - first) < END_AT_CORNER_M))
            high = max(high, int(abs(corners[q, 1 - axis] - last) < END_AT_CORNER_M))
    return low + high


@compiled
def is_vertex_line(scene, direction, axis, at):
    vertices = scene.vertices[direction, axis]
    for q in range(len(vertices)):
        if abs(vertices[q] - at) < 1e-6:
            return True
    return False
