"""What an edge of a volume costs that shows: a step in the roof. Compiled.

It costs a fixed sum (less where it is very short), more by the metre, most for low steps, which nearly always stand for a valley or a
needless cut, and something extra where no corner of the outline lies in line with it. It is looked at in samples along it.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from ...compiled import compiled
from .volumes import DIRECTION, REPLACES, U0, U1, V0, V1, find_lowest, is_within, read_coefficients

VISIBLE_STEP_M, STEP_DEPTH_M = (
    0.05,
    0.2,
)  # a gap that is a step; how far inside the outline it shows
# m from which on an edge costs the whole of its fixed sum; were shorter ones free, a flight of small steps would cost less than one straight edge
FULL_PRICE_M = 0.55
# m from an outline's corner within which an edge is in line with it, and within which it ends there
CORNER_LINE_M, END_AT_CORNER_M = 0.25, 0.7
# m between the places at which a step between volumes is judged, and how many at most of an edge
EDGE_SAMPLE_M, MOST_EDGE_SAMPLES = 0.5, 40
# samples that a processor looks at together, of which MOST_EDGE_SAMPLES is a multiple: so many more are looked at that none is left over
SAMPLES_AT_ONCE = 8
COVER_TOUCH_M = 0.03  # m; a volume that reaches so near covers the place


# Of a scene what the cost of edges depends on, and room (MOST_EDGE_SAMPLES,) to work in: where the samples of an edge are, and the heights on
# either side of it. Fewer arrays are fewer to count references of, a million times.
Walls = namedtuple(
    "Walls",
    "turn depth corner_u corner_v pitch vertices corners places inside outside prices evidence",
)


@compiled
def gather_walls(scene):
    raster = scene.corner_u, scene.corner_v, scene.pitch
    corners, prices = (scene.vertices, scene.corners), scene.edge_prices
    room = np.zeros(MOST_EDGE_SAMPLES), np.empty(MOST_EDGE_SAMPLES), np.empty(MOST_EDGE_SAMPLES)
    return Walls(scene.turn, scene.depth, *raster, *corners, *room, prices, scene.evidence)


@compiled(allocates=False)
def price_edge(volumes, walls, k, edge):
    """Units of complexity for what shows of one edge (0 u low, 1 u high, 2 v low, 3 v high) of volume k."""
    direction, axis, place = int(volumes[k, DIRECTION]), edge // 2, volumes[k, U0 + edge]
    inside, in_line = locate_line(walls, direction, axis, place)
    if not inside:
        return 0.0
    m, step = place_samples(volumes, walls, k, edge)
    if m == 0:
        return 0.0
    fill_heights(volumes, walls, k, edge, m)
    any_step, a_metre, low_a_metre, low_step, loose, at_corner = walls.prices
    shown_length = low_length = 0.0
    for q in range(m):
        gap = abs(walls.inside[q] - walls.outside[q])
        if gap > VISIBLE_STEP_M:
            shown_length += step
            if gap < low_step:
                low_length += step
    if shown_length == 0.0:
        return 0.0
    first, last = walls.places[0], walls.places[m - 1]
    fixed_price = any_step + (
        -at_corner * count_corner_ends(walls, direction, axis, place, first, last)
        if in_line
        else loose
    )
    return (
        fixed_price * min(shown_length / FULL_PRICE_M, 1.0)
        + a_metre * shown_length
        + low_a_metre * low_length
    )


@compiled(inline="always")
def locate_line(walls, direction, axis, place):
    """Whether a line of one axis of a direction comes far enough inside the outline for a step to show there, and whether it is in line
    with one of the outline's vertices."""
    lowest = highest = walls.vertices[direction, axis, 0]
    in_line = False
    for q in range(walls.vertices.shape[2]):
        x = walls.vertices[direction, axis, q]
        if x == np.inf:
            break
        highest = x
        in_line = in_line or abs(x - place) < 1e-6
    off_a_node = math.sqrt(0.5) * walls.pitch  # the depth is that of the nearest node of the raster
    return min(place - lowest, highest - place) + off_a_node >= STEP_DEPTH_M, in_line


@compiled(inline="always")
def place_samples(volumes, walls, k, edge):
    """How many of an edge's samples are inside the outline, and m from one to the next; where along the edge they are goes to
    walls.places."""
    direction, place, across = (
        int(volumes[k, DIRECTION]),
        volumes[k, U0 + edge],
        U0 + 2 - 2 * (edge // 2),
    )
    start, length = volumes[k, across], volumes[k, across + 1] - volumes[k, across]
    count = min(MOST_EDGE_SAMPLES, max(2, int(length / EDGE_SAMPLE_M) + 1))
    step = length / count
    c, s = walls.turn[direction, 0], walls.turn[direction, 1]
    rows, columns, m = walls.inside, walls.outside, 0  # of the raster; the heights come later
    for q in range(pad_count(count)):
        t = start + (q + 0.5) * step
        a, b = (place, t) if edge < 2 else (t, place)
        rows[q] = math.floor((c * a - s * b - walls.corner_u) / walls.pitch + 0.5)
        columns[q] = math.floor((s * a + c * b - walls.corner_v) / walls.pitch + 0.5)
    for q in range(count):
        i, j = int(rows[q]), int(columns[q])
        if (
            0 <= i < walls.depth.shape[0]
            and 0 <= j < walls.depth.shape[1]
            and walls.depth[i, j] >= STEP_DEPTH_M
        ):
            walls.places[m] = start + (q + 0.5) * step
            m += 1
    return m, step


@compiled(inline="always")
def pad_count(count):
    """The next multiple of SAMPLES_AT_ONCE."""
    return (count + SAMPLES_AT_ONCE - 1) // SAMPLES_AT_ONCE * SAMPLES_AT_ONCE


@compiled(inline="always")
def fill_heights(volumes, walls, k, edge, m):
    """Fill walls.inside and walls.outside with the heights just inside and just outside of volume k at the first `m` of walls.places.

    All places in one volume after another, so that a processor does several at once.
    """
    direction, place = int(volumes[k, DIRECTION]), volumes[k, U0 + edge]
    places, inside, outside, turn = walls.places, walls.inside, walls.outside, walls.turn
    first, last = places[0], places[m - 1]
    n_padded = pad_count(m)
    for q in range(n_padded):
        inside[q] = outside[q] = -np.inf
    for j in range(len(volumes)):
        other, cosine, sine = int(volumes[j, DIRECTION]), 1.0, 0.0
        if other != direction:
            cosine = turn[other, 0] * turn[direction, 0] + turn[other, 1] * turn[direction, 1]
            sine = turn[other, 1] * turn[direction, 0] - turn[other, 0] * turn[direction, 1]
        # along the edge the place in the axes of volume j is (a0 + a t, b0 + b t)
        a0, a, b0, b = (
            (cosine * place, sine, -sine * place, cosine)
            if edge < 2
            else (sine * place, cosine, cosine * place, -sine)
        )
        u0, u1 = volumes[j, U0] - COVER_TOUCH_M, volumes[j, U1] + COVER_TOUCH_M
        v0, v1 = volumes[j, V0] - COVER_TOUCH_M, volumes[j, V1] + COVER_TOUCH_M
        ends_u, ends_v = (a0 + a * first, a0 + a * last), (b0 + b * first, b0 + b * last)
        if j != k and (
            max(ends_u) < u0 or min(ends_u) > u1 or max(ends_v) < v0 or min(ends_v) > v1
        ):
            continue
        c, replaces = read_coefficients(volumes, j), volumes[j, REPLACES] > 0.0
        if j == k:
            for q in range(n_padded):
                h = find_lowest(c, a0 + a * places[q], b0 + b * places[q])
                inside[q] = h if replaces | (h > inside[q]) else inside[q]
            continue
        for q in range(n_padded):
            u, v = a0 + a * places[q], b0 + b * places[q]
            h = find_lowest(c, u, v)
            is_inside = is_within((u0, u1, v0, v1), u, v)
            inside[q] = h if is_inside & (replaces | (h > inside[q])) else inside[q]
            outside[q] = h if is_inside & (replaces | (h > outside[q])) else outside[q]


@compiled(allocates=False)
def count_corner_ends(walls, direction, axis, place, first, last):
    """How many of the two ends of what lies of the line `place` inside the outline are at corners of it."""
    has_first = has_last = 0
    for q in range(walls.corners.shape[1]):
        if abs(walls.corners[direction, q, axis] - place) < CORNER_LINE_M:
            along = walls.corners[direction, q, 1 - axis]
            has_first = max(has_first, int(abs(along - first) < END_AT_CORNER_M))
            has_last = max(has_last, int(abs(along - last) < END_AT_CORNER_M))
    return has_first + has_last
