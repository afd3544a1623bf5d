"""Price the edges of all other volumes while one moves. Compiled.

The heights beside such an edge depend on where volume k lies by one thing only: whether it covers
the sample. So each sample is looked at twice, with volume k and without it, for all its moves.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ...compiled import compiled
from .steps import (
    LOW_STEP,
    MOST_EDGE_SAMPLES,
    NO_STEP,
    classify_step,
    locate_line,
    meets_line,
    pad_count,
    place_samples,
    price_length,
    price_whole_edge,
    raise_heights,
    turn_line,
    widen_rectangle,
)
from .volumes import DIRECTION, U0, U1, V0, V1, is_within

# Columns of an edge: how many of its samples lie inside the outline, the metres from one to the
# next, the fixed sum of its price, and the first of its bounds in the axes of the moving volume: u
# low, u high, v low, v high, empty where it is never visible.
SAMPLE_COUNT, PITCH, WHOLE_PRICE, BOX0 = range(4)
EDGE_COLUMNS = BOX0 + 4  # Number of columns of an edge.
SAMPLE_ROWS = 4  # Number of rows of an edge's samples.
# These are where they lie in the axes of the moving volume, and what step is there without that
# volume, and with it.
PLACE_U, PLACE_V, STEP_BARE, STEP_COVERED = range(SAMPLE_ROWS)

Beside = namedtuple("Beside", "edges samples inside outside")
"""The edges of all volumes but a moving one.

- edges (volumes, 4, EDGE_COLUMNS)
- samples (volumes, 4, SAMPLE_ROWS, MOST_EDGE_SAMPLES): those inside the outline
- inside, outside (MOST_EDGE_SAMPLES,): room for the heights with the moving volume
"""


@compiled
def make_room(count):
    """Make room for what moves of one of `count` volumes need of the others' edges."""
    return Beside(
        np.zeros((count, 4, EDGE_COLUMNS)),
        np.empty((count, 4, SAMPLE_ROWS, MOST_EDGE_SAMPLES)),
        np.empty(MOST_EDGE_SAMPLES),
        np.empty(MOST_EDGE_SAMPLES),
    )


@compiled
def gather_neighbour_edges(volumes, walls, neighbours, k):
    """Look at all edges beside volume k. `neighbours` is that of `list_near`."""
    beside = make_room(len(volumes))
    for j in range(1, len(volumes)):
        for edge in range(4):
            if j != k:
                gather_edge(volumes, walls, neighbours, k, j, edge, beside)
    return beside


@compiled
def gather_edge(volumes, walls, neighbours, k, j, edge, beside):
    """Fill `beside` with what moves of volume k need of an edge of volume j."""
    edges, samples, direction, axis = (
        beside.edges,
        beside.samples,
        int(volumes[j, DIRECTION]),
        edge // 2,
    )
    edges[j, edge, BOX0] = edges[j, edge, BOX0 + 2] = np.inf
    edges[j, edge, BOX0 + 1] = edges[j, edge, BOX0 + 3] = -np.inf
    inside, in_line = locate_line(walls, direction, axis, volumes[j, U0 + edge])
    if not inside:
        return
    a0, a, b0, b = turn_line(volumes, walls.turn, j, edge, k)
    start, end = (volumes[j, V0], volumes[j, V1]) if edge < 2 else (volumes[j, U0], volumes[j, U1])
    edges[j, edge, BOX0] = min(a0 + a * start, a0 + a * end)
    edges[j, edge, BOX0 + 1] = max(a0 + a * start, a0 + a * end)
    edges[j, edge, BOX0 + 2] = min(b0 + b * start, b0 + b * end)
    edges[j, edge, BOX0 + 3] = max(b0 + b * start, b0 + b * end)
    m, step = place_samples(volumes, walls, j, edge)
    if m == 0:
        return
    edges[j, edge, SAMPLE_COUNT], edges[j, edge, PITCH] = m, step
    edges[j, edge, WHOLE_PRICE] = price_whole_edge(
        walls, direction, axis, volumes[j, U0 + edge], in_line, m
    )
    fill_heights_twice(volumes, walls, neighbours, k, j, edge, m, beside)
    for q in range(m):
        samples[j, edge, PLACE_U, q] = a0 + a * walls.places[q]
        samples[j, edge, PLACE_V, q] = b0 + b * walls.places[q]
        gap, covered_gap = (
            walls.inside[q] - walls.outside[q],
            beside.inside[q] - beside.outside[q],
        )
        samples[j, edge, STEP_BARE, q] = classify_step(gap)
        samples[j, edge, STEP_COVERED, q] = classify_step(covered_gap)
    for q in range(m, pad_count(m)):
        samples[j, edge, PLACE_U, q] = samples[j, edge, PLACE_V, q] = 0.0
        samples[j, edge, STEP_BARE, q] = samples[j, edge, STEP_COVERED, q] = NO_STEP


@compiled
def fill_heights_twice(volumes, walls, neighbours, k, j, edge, m, beside):
    """Fill the heights beside an edge of volume j without volume k, and under it."""
    n, is_raised, places = pad_count(m), False, walls.places
    for q in range(n):
        walls.inside[q] = walls.outside[q] = -np.inf
    for p in range(1, neighbours[j, 0] + 1):
        i = neighbours[j, p]
        line = turn_line(volumes, walls.turn, j, edge, i)
        if i == k:
            is_raised = True
            for q in range(n):
                beside.inside[q], beside.outside[q] = walls.inside[q], walls.outside[q]
            everywhere = (-np.inf, np.inf, -np.inf, np.inf)
            raise_heights(
                volumes, i, line, everywhere, False, places, beside.inside, beside.outside, n
            )
            continue
        ends = widen_rectangle(volumes, i)
        if i == j or meets_line(line, ends, places[0], places[m - 1]):
            raise_heights(volumes, i, line, ends, i == j, places, walls.inside, walls.outside, n)
            if is_raised:
                raise_heights(
                    volumes, i, line, ends, i == j, places, beside.inside, beside.outside, n
                )


@compiled
def price_neighbour_edge(beside, j, edge, ends):
    """Compute the units of an edge of volume j where the moving volume covers `ends`."""
    edges, samples = beside.edges, beside.samples
    shown_count = low_count = 0
    for q in range(pad_count(int(edges[j, edge, SAMPLE_COUNT]))):
        is_covered = is_within(ends, samples[j, edge, PLACE_U, q], samples[j, edge, PLACE_V, q])
        kind = samples[j, edge, STEP_COVERED, q] if is_covered else samples[j, edge, STEP_BARE, q]
        shown_count += kind != NO_STEP
        low_count += kind == LOW_STEP
    if shown_count == 0:
        return 0.0
    step = edges[j, edge, PITCH]
    return price_length(edges[j, edge, WHOLE_PRICE], step * shown_count, step * low_count)
