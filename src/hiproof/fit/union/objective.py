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
from collections import namedtuple

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
# m from an outline's corner within which an edge is in line with it, and within which it ends there
AT_CORNER_M, END_AT_CORNER_M = 0.25, 0.7
# m between the places at which a step between volumes is judged, and how many at most of an edge
SAMPLE_M, MOST_SAMPLES = 0.5, 40
TOUCH_M = 0.03  # m; a volume that reaches so near covers the place
BASE_SHARE = 0.01  # of the outline's area: the base costs nothing where less of it shows


# Of a scene what the cost of edges depends on; fewer arrays are fewer to count references of, a million times.
Walls = namedtuple("Walls", "turn depth corner_u corner_v pitch vertices corners prices evidence")


@compiled
def walls_of(scene):
    where = scene.corner_u, scene.corner_v, scene.pitch
    return Walls(scene.turn, scene.depth, *where, scene.vertices, scene.corners, scene.edge_prices, scene.evidence)


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
    walls = walls_of(scene)
    for k in range(1, len(volumes)):
        for edge in range(4):
            if total > limit:
                return np.inf
            total += scene.evidence * edge_cost(volumes, walls, k, edge)
    return total if total <= limit else np.inf


@compiled
def base_shows(volumes, scene):
    """Whether a noticeable share of the outline is roofed by the base."""
    _, top = roof_heights(volumes, scene.U, scene.V)
    return scene.weight[scene.n :][top[scene.n :] == 0].sum() > BASE_SHARE * scene.n


@compiled
def edge_cost(volumes, walls, k, edge):
    """Units of complexity for what shows of one edge (0 u low, 1 u high, 2 v low, 3 v high) of volume k."""
    direction, axis, at = int(volumes[k, DIRECTION]), edge // 2, volumes[k, U0 + edge]
    inside, in_line = among_vertices(walls, direction, axis, at)
    if not inside:
        return 0.0
    any_step, a_metre, low_a_metre, low_step, loose, at_corner = walls.prices
    first, last, shown, low = what_shows(volumes, walls, k, edge, low_step)
    if shown < LEAST_STEP_LENGTH_M:
        return 0.0
    cost = any_step + a_metre * shown + low_a_metre * low
    if not in_line:
        return cost + loose
    return cost - at_corner * ends_at_corners(walls, direction, axis, at, first, last)


@compiled
def among_vertices(walls, direction, axis, at):
    """Whether a line of one axis of a direction comes far enough inside the outline for a step to show there, and whether it is in line
    with one of the outline's vertices."""
    low = high = walls.vertices[direction, axis, 0]
    in_line = False
    for q in range(walls.vertices.shape[2]):
        x = walls.vertices[direction, axis, q]
        if x == np.inf:
            break
        high = x
        in_line = in_line or abs(x - at) < 1e-6
    off_a_node = math.sqrt(0.5) * walls.pitch  # the depth is that of the nearest node of the raster
    return min(at - low, high - at) + off_a_node >= INSIDE_M, in_line


@compiled(inline="always")
def what_shows(volumes, walls, k, edge, low_step):
    """Of an edge of volume k where its samples inside the outline begin and end, for how many metres it shows there, and for how
    many with a step of less than `low_step`."""
    own, at = int(volumes[k, DIRECTION]), volumes[k, U0 + edge]
    start, end = (volumes[k, V0], volumes[k, V1]) if edge < 2 else (volumes[k, U0], volumes[k, U1])
    count = min(MOST_SAMPLES, max(2, int((end - start) / SAMPLE_M) + 1))
    step = (end - start) / count
    c, s = walls.turn[own, 0], walls.turn[own, 1]
    first = last = shown = low = 0.0
    m = 0
    for q in range(count):
        t = start + (q + 0.5) * step
        a, b = (at, t) if edge < 2 else (t, at)
        i = math.floor((c * a - s * b - walls.corner_u) / walls.pitch + 0.5)
        j = math.floor((s * a + c * b - walls.corner_v) / walls.pitch + 0.5)
        if 0 <= i < walls.depth.shape[0] and 0 <= j < walls.depth.shape[1] and walls.depth[i, j] >= INSIDE_M:
            first, last, m = t if m == 0 else first, t, m + 1
            gap = gap_at(volumes, k, walls.turn, a, b)
            if gap > STEP_M:
                shown += step
                if gap < low_step:
                    low += step
    return first, last, shown if m * step >= LEAST_STEP_LENGTH_M else 0.0, low


@compiled
def gap_at(volumes, k, turn, u, v):
    """Between the heights just inside and just outside of volume k at a place u, v of its edge, in its direction."""
    own = int(volumes[k, DIRECTION])
    inside = outside = -np.inf
    for j in range(len(volumes)):
        other, a, b = int(volumes[j, DIRECTION]), u, v
        if other != own:
            cosine = turn[other, 0] * turn[own, 0] + turn[other, 1] * turn[own, 1]
            sine = turn[other, 1] * turn[own, 0] - turn[other, 0] * turn[own, 1]
            a, b = cosine * u + sine * v, cosine * v - sine * u
        if j == k or (
            volumes[j, U0] - TOUCH_M <= a <= volumes[j, U1] + TOUCH_M
            and volumes[j, V0] - TOUCH_M <= b <= volumes[j, V1] + TOUCH_M
        ):
            h, replaces = lowest(coefficients(volumes, j), a, b), volumes[j, REPLACES] > 0.0
            inside = h if replaces or h > inside else inside
            if j != k:
                outside = h if replaces or h > outside else outside
    return abs(inside - outside)


@compiled
def ends_at_corners(walls, direction, axis, at, first, last):
    """How many of the two ends of what lies of the line `at` inside the outline are at corners of it."""
    low = high = 0
    for q in range(walls.corners.shape[1]):
        if abs(walls.corners[direction, q, axis] - at) < AT_CORNER_M:
            along = walls.corners[direction, q, 1 - axis]
            low = max(low, int(abs(along - first) < END_AT_CORNER_M))
            high = max(high, int(abs(along - last) < END_AT_CORNER_M))
    return low + high
