"""What an edge of a volume costs that shows: a step in the roof. Compiled.

It costs a fixed sum (less where it is very short), more by the metre, most for low steps, which nearly always stand for a valley or a
needless cut, and something extra where no corner of the outline lies in line with it. It is looked at in samples along it.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from ...compiled import compiled
from .volumes import DIRECTION, REPLACES, U0, U1, V0, V1, coefficients, is_within, lowest

STEP_M, INSIDE_M = 0.05, 0.2  # a gap that is a step; how far inside the outline it shows
# m from which on an edge costs the whole of its fixed sum; were shorter ones free, a flight of small steps would cost less than one straight edge
WHOLE_STEP_M = 0.55
# m from an outline's corner within which an edge is in line with it, and within which it ends there
AT_CORNER_M, END_AT_CORNER_M = 0.25, 0.7
# m between the places at which a step between volumes is judged, and how many at most of an edge
SAMPLE_M, MOST_SAMPLES = 0.5, 40
# samples that a processor looks at together, of which MOST_SAMPLES is a multiple: so many more are looked at that none is left over
AT_ONCE = 8
TOUCH_M = 0.03  # m; a volume that reaches so near covers the place


# Of a scene what the cost of edges depends on, and room (MOST_SAMPLES,) to work in: where the samples of an edge are, and the heights on
# either side of it. Fewer arrays are fewer to count references of, a million times.
Walls = namedtuple("Walls", "turn depth corner_u corner_v pitch vertices corners places inside outside prices evidence")


@compiled
def walls_of(scene):
    where = scene.corner_u, scene.corner_v, scene.pitch
    corners, prices = (scene.vertices, scene.corners), scene.edge_prices
    room = np.zeros(MOST_SAMPLES), np.empty(MOST_SAMPLES), np.empty(MOST_SAMPLES)
    return Walls(scene.turn, scene.depth, *where, *corners, *room, prices, scene.evidence)


@compiled(allocates=False)
def edge_cost(volumes, walls, k, edge):
    """Units of complexity for what shows of one edge (0 u low, 1 u high, 2 v low, 3 v high) of volume k."""
    direction, axis, at = int(volumes[k, DIRECTION]), edge // 2, volumes[k, U0 + edge]
    inside, in_line = among_vertices(walls, direction, axis, at)
    if not inside:
        return 0.0
    m, step = samples_inside(volumes, walls, k, edge)
    if m == 0:
        return 0.0
    heights_beside(volumes, walls, k, edge, m)
    any_step, a_metre, low_a_metre, low_step, loose, at_corner = walls.prices
    shown = low = 0.0
    for q in range(m):
        gap = abs(walls.inside[q] - walls.outside[q])
        if gap > STEP_M:
            shown += step
            if gap < low_step:
                low += step
    if shown == 0.0:
        return 0.0
    first, last = walls.places[0], walls.places[m - 1]
    once = any_step + (-at_corner * ends_at_corners(walls, direction, axis, at, first, last) if in_line else loose)
    return once * min(shown / WHOLE_STEP_M, 1.0) + a_metre * shown + low_a_metre * low


@compiled(inline="always")
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
def samples_inside(volumes, walls, k, edge):
    """How many of an edge's samples are inside the outline, and m from one to the next; where along the edge they are goes to
    walls.places."""
    own, at, across = int(volumes[k, DIRECTION]), volumes[k, U0 + edge], U0 + 2 - 2 * (edge // 2)
    start, length = volumes[k, across], volumes[k, across + 1] - volumes[k, across]
    count = min(MOST_SAMPLES, max(2, int(length / SAMPLE_M) + 1))
    step = length / count
    c, s = walls.turn[own, 0], walls.turn[own, 1]
    rows, columns, m = walls.inside, walls.outside, 0  # of the raster; the heights come later
    for q in range(whole(count)):
        t = start + (q + 0.5) * step
        a, b = (at, t) if edge < 2 else (t, at)
        rows[q] = math.floor((c * a - s * b - walls.corner_u) / walls.pitch + 0.5)
        columns[q] = math.floor((s * a + c * b - walls.corner_v) / walls.pitch + 0.5)
    for q in range(count):
        i, j = int(rows[q]), int(columns[q])
        if 0 <= i < walls.depth.shape[0] and 0 <= j < walls.depth.shape[1] and walls.depth[i, j] >= INSIDE_M:
            walls.places[m] = start + (q + 0.5) * step
            m += 1
    return m, step


@compiled(inline="always")
def whole(count):
    """The next multiple of AT_ONCE."""
    return (count + AT_ONCE - 1) // AT_ONCE * AT_ONCE


@compiled(inline="always")
def heights_beside(volumes, walls, k, edge, m):
    """Fill walls.inside and walls.outside with the heights just inside and just outside of volume k at the first `m` of walls.places.

    All places in one volume after another, so that a processor does several at once.
    """
    own, at = int(volumes[k, DIRECTION]), volumes[k, U0 + edge]
    places, inside, outside, turn = walls.places, walls.inside, walls.outside, walls.turn
    first, last = places[0], places[m - 1]
    there = whole(m)
    for q in range(there):
        inside[q] = outside[q] = -np.inf
    for j in range(len(volumes)):
        other, cosine, sine = int(volumes[j, DIRECTION]), 1.0, 0.0
        if other != own:
            cosine = turn[other, 0] * turn[own, 0] + turn[other, 1] * turn[own, 1]
            sine = turn[other, 1] * turn[own, 0] - turn[other, 0] * turn[own, 1]
        # along the edge the place in the axes of volume j is (a0 + a t, b0 + b t)
        a0, a, b0, b = (cosine * at, sine, -sine * at, cosine) if edge < 2 else (sine * at, cosine, cosine * at, -sine)
        u0, u1 = volumes[j, U0] - TOUCH_M, volumes[j, U1] + TOUCH_M
        v0, v1 = volumes[j, V0] - TOUCH_M, volumes[j, V1] + TOUCH_M
        ends_u, ends_v = (a0 + a * first, a0 + a * last), (b0 + b * first, b0 + b * last)
        if j != k and (max(ends_u) < u0 or min(ends_u) > u1 or max(ends_v) < v0 or min(ends_v) > v1):
            continue
        c, replaces = coefficients(volumes, j), volumes[j, REPLACES] > 0.0
        if j == k:
            for q in range(there):
                h = lowest(c, a0 + a * places[q], b0 + b * places[q])
                inside[q] = h if replaces | (h > inside[q]) else inside[q]
            continue
        for q in range(there):
            u, v = a0 + a * places[q], b0 + b * places[q]
            h = lowest(c, u, v)
            within = is_within((u0, u1, v0, v1), u, v)
            inside[q] = h if within & (replaces | (h > inside[q])) else inside[q]
            outside[q] = h if within & (replaces | (h > outside[q])) else outside[q]


@compiled(allocates=False)
def ends_at_corners(walls, direction, axis, at, first, last):
    """How many of the two ends of what lies of the line `at` inside the outline are at corners of it."""
    low = high = 0
    for q in range(walls.corners.shape[1]):
        if abs(walls.corners[direction, q, axis] - at) < AT_CORNER_M:
            along = walls.corners[direction, q, 1 - axis]
            low = max(low, int(abs(along - first) < END_AT_CORNER_M))
            high = max(high, int(abs(along - last) < END_AT_CORNER_M))
    return low + high
