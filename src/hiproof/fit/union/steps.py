"""Compute the price of a visible edge of a volume, a step. Compiled.

It is a fixed sum (less if the edge is very short), more by the metre, and most for low steps, which
nearly always stand for a valley or a needless cut. An edge costs extra if no corner of the outline
lies in line with it. It is sampled along its length.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from ...compiled import compiled
from .prices import EDGE_PRICES
from .volumes import DIRECTION, REPLACES, U0, U1, V0, V1, find_lowest, is_within, read_coefficients

VISIBLE_STEP_M = 0.05  # Lowest gap (m) that is a step.
STEP_DEPTH_M = 0.2  # Depth (m) inside the outline at which a step is visible.
# Length (m) from which on an edge costs the whole of its fixed sum. If shorter ones were free, a
# flight of small steps would cost less than one straight edge.
FULL_PRICE_M = 0.55
CORNER_LINE_M = 0.25  # Distance (m) from a corner within which an edge is in line with it.
END_AT_CORNER_M = 0.7  # Distance (m) from a corner within which an edge ends there.
EDGE_SAMPLE_M = 0.5  # Distance (m) between the samples of an edge.
MOST_EDGE_SAMPLES = 40  # Most samples of an edge.
# Samples that a processor computes together. MOST_EDGE_SAMPLES is a multiple of it: samples are
# added so that none is left over.
SAMPLES_AT_ONCE = 8
FEW_VOLUMES = 8  # Of no more volumes, all count as near: looking is as dear as pricing.
COVER_TOUCH_M = 0.03  # A volume that reaches so near (m) covers the place.
NO_STEP, SHOWN_STEP, LOW_STEP = range(3)  # What the heights beside a sample of an edge make.


# What the price of edges depends on, of a scene, and room (MOST_EDGE_SAMPLES,) to work in: the
# places of an edge's samples, and the heights on either side. Fewer arrays are fewer references to
# count, a million times.
Walls = namedtuple(
    "Walls",
    "turn depth corner_u corner_v pitch vertices corners places inside outside evidence",
)


@compiled
def gather_walls(scene):
    raster = scene.corner_u, scene.corner_v, scene.pitch
    room = np.zeros(MOST_EDGE_SAMPLES), np.empty(MOST_EDGE_SAMPLES), np.empty(MOST_EDGE_SAMPLES)
    corners = scene.vertices, scene.corners
    return Walls(scene.turn, scene.depth, *raster, *corners, *room, scene.evidence)


@compiled
def list_near(volumes, turn, moving):
    """List which volumes may cover an edge of each volume.

    Each row of (k, k + 1) begins with their number, and they are in the roof's order. Volume
    `moving` (-1: none) is near all others, and of few volumes all are near each other.
    """
    neighbours = np.empty((len(volumes), len(volumes) + 1), np.int64)
    for k in range(len(volumes)):
        direction, count = int(volumes[k, DIRECTION]), 0
        for j in range(len(volumes)):
            if len(volumes) > FEW_VOLUMES and j != moving and k != moving and j != k:
                low_u, high_u, low_v, high_v = enclose_volume(volumes, j, turn, direction)
                if low_u > volumes[k, U1] or high_u < volumes[k, U0]:
                    continue
                if low_v > volumes[k, V1] or high_v < volumes[k, V0]:
                    continue
            count += 1
            neighbours[k, count] = j
        neighbours[k, 0] = count
    return neighbours


@compiled
def enclose_volume(volumes, j, turn, direction):
    """Return the bounds of volume j, a little widened, in the axes of a direction."""
    other = int(volumes[j, DIRECTION])
    cosine = turn[other, 0] * turn[direction, 0] + turn[other, 1] * turn[direction, 1]
    sine = turn[other, 1] * turn[direction, 0] - turn[other, 0] * turn[direction, 1]
    half_u, half_v = (
        0.5 * (volumes[j, U1] - volumes[j, U0]),
        0.5 * (volumes[j, V1] - volumes[j, V0]),
    )
    u, v = volumes[j, U0] + half_u, volumes[j, V0] + half_v
    reach_u = abs(cosine) * half_u + abs(sine) * half_v + 2.0 * COVER_TOUCH_M
    reach_v = abs(sine) * half_u + abs(cosine) * half_v + 2.0 * COVER_TOUCH_M
    u, v = cosine * u - sine * v, sine * u + cosine * v
    return u - reach_u, u + reach_u, v - reach_v, v + reach_v


@compiled
def price_edge(volumes, walls, k, edge, neighbours):
    """Compute the units of one visible edge of volume k.

    Edges are 0 u low, 1 u high, 2 v low, 3 v high. `neighbours` is that of `list_near`.
    """
    direction, axis, place = int(volumes[k, DIRECTION]), edge // 2, volumes[k, U0 + edge]
    inside, in_line = locate_line(walls, direction, axis, place)
    if not inside:
        return 0.0
    m, step = place_samples(volumes, walls, k, edge)
    if m == 0:
        return 0.0
    fill_heights(volumes, walls, k, edge, neighbours, m)
    shown_count = low_count = 0
    for q in range(m):
        kind = classify_step(walls.inside[q] - walls.outside[q])
        shown_count += kind != NO_STEP
        low_count += kind == LOW_STEP
    if shown_count == 0:
        return 0.0
    whole_price = price_whole_edge(walls, direction, axis, place, in_line, m)
    return price_length(whole_price, step * shown_count, step * low_count)


@compiled
def classify_step(gap):
    """Return which kind of step a gap (m) between the heights beside an edge is."""
    gap = abs(gap)
    return (
        NO_STEP if gap <= VISIBLE_STEP_M else LOW_STEP if gap < EDGE_PRICES.low_step else SHOWN_STEP
    )


@compiled
def price_whole_edge(walls, direction, axis, place, in_line, m):
    """Compute the fixed sum of an edge with `m` samples. Short ones cost less."""
    if not in_line:
        return EDGE_PRICES.any_step + EDGE_PRICES.loose
    first, last = walls.places[0], walls.places[m - 1]
    n_ends = count_corner_ends(walls, direction, axis, place, first, last)
    return EDGE_PRICES.any_step - EDGE_PRICES.at_corner * n_ends


@compiled
def price_length(whole_price, shown_length, low_length):
    """Compute the units of an edge that is a step, or a low one, on these lengths (m)."""
    return (
        whole_price * min(shown_length / FULL_PRICE_M, 1.0)
        + EDGE_PRICES.a_metre * shown_length
        + EDGE_PRICES.low_a_metre * low_length
    )


@compiled
def locate_line(walls, direction, axis, place):
    """Return whether a line of one axis lies deep enough inside for a visible step.

    Also returns whether it is in line with one of the outline's vertices.
    """
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


@compiled
def place_samples(volumes, walls, k, edge):
    """Fill walls.places with an edge's samples inside the outline.

    Returns how many there are, and the metres from one to the next.
    """
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


@compiled
def pad_count(count):
    """Return the next multiple of SAMPLES_AT_ONCE."""
    return (count + SAMPLES_AT_ONCE - 1) // SAMPLES_AT_ONCE * SAMPLES_AT_ONCE


@compiled
def fill_heights(volumes, walls, k, edge, neighbours, m):
    """Fill walls.inside and walls.outside with the heights on either side of an edge.

    They are those at the first `m` of walls.places, just inside and just outside of volume k. All
    places in one volume follow each other, so that a processor computes several at once.
    """
    n_padded = pad_count(m)
    for q in range(n_padded):
        walls.inside[q] = walls.outside[q] = -np.inf
    for p in range(1, neighbours[k, 0] + 1):
        j = neighbours[k, p]
        line = turn_line(volumes, walls.turn, k, edge, j)
        ends = widen_rectangle(volumes, j)
        if j == k or meets_line(line, ends, walls.places[0], walls.places[m - 1]):
            raise_heights(
                volumes, j, line, ends, j == k, walls.places, walls.inside, walls.outside, n_padded
            )


@compiled
def turn_line(volumes, turn, k, edge, j):
    """Return the line of an edge of volume k in the axes of volume j.

    It is a0, a, b0, b: the place t along the edge lies at (a0 + a t, b0 + b t).
    """
    direction, other, place = (
        int(volumes[k, DIRECTION]),
        int(volumes[j, DIRECTION]),
        volumes[k, U0 + edge],
    )
    cosine, sine = 1.0, 0.0
    if other != direction:
        cosine = turn[other, 0] * turn[direction, 0] + turn[other, 1] * turn[direction, 1]
        sine = turn[other, 1] * turn[direction, 0] - turn[other, 0] * turn[direction, 1]
    if edge < 2:
        return cosine * place, sine, -sine * place, cosine
    return sine * place, cosine, cosine * place, -sine


@compiled
def widen_rectangle(volumes, j):
    """Return where volume j covers places: its rectangle and a little more."""
    return (
        volumes[j, U0] - COVER_TOUCH_M,
        volumes[j, U1] + COVER_TOUCH_M,
        volumes[j, V0] - COVER_TOUCH_M,
        volumes[j, V1] + COVER_TOUCH_M,
    )


@compiled
def meets_line(line, ends, first, last):
    """Return whether the bounds of a line from `first` to `last` meet a rectangle."""
    a0, a, b0, b = line
    start_u, end_u, start_v, end_v = a0 + a * first, a0 + a * last, b0 + b * first, b0 + b * last
    return not (
        max(start_u, end_u) < ends[0]
        or min(start_u, end_u) > ends[1]
        or max(start_v, end_v) < ends[2]
        or min(start_v, end_v) > ends[3]
    )


@compiled
def raise_heights(volumes, j, line, ends, is_own, places, inside, outside, n):
    """Raise the heights beside an edge at the first `n` samples to those of volume j.

    Of its own edge (`is_own`), a volume lies inside, all along.
    """
    a0, a, b0, b = line
    c, replaces = read_coefficients(volumes, j), volumes[j, REPLACES] > 0.0
    if is_own:
        for q in range(n):
            h = find_lowest(c, a0 + a * places[q], b0 + b * places[q])
            inside[q] = h if replaces | (h > inside[q]) else inside[q]
        return
    for q in range(n):
        u, v = a0 + a * places[q], b0 + b * places[q]
        h = find_lowest(c, u, v)
        is_inside = is_within(ends, u, v)
        inside[q] = h if is_inside & (replaces | (h > inside[q])) else inside[q]
        outside[q] = h if is_inside & (replaces | (h > outside[q])) else outside[q]


@compiled
def count_corner_ends(walls, direction, axis, place, first, last):
    """Count the ends of a line inside the outline that are at corners of it."""
    has_first = has_last = 0
    for q in range(walls.corners.shape[1]):
        if abs(walls.corners[direction, q, axis] - place) < CORNER_LINE_M:
            along = walls.corners[direction, q, 1 - axis]
            has_first = max(has_first, int(abs(along - first) < END_AT_CORNER_M))
            has_last = max(has_last, int(abs(along - last) < END_AT_CORNER_M))
    return has_first + has_last
