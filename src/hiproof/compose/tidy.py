"""Plan cells without steps a millimetre or two long. Compiled.

No face can be flat beside such a step.
"""

from __future__ import annotations

import numpy as np

from ..compiled import compiled
from .arrangement import OUTSIDE, find_reach, is_beside, renumber_vertices, turn
from .levels import evaluate_plane

# units of the grid, 3 mm: beside a shorter edge no face can be flat to val3dity's 20 degrees
SHORT_UNITS = 30.0


@compiled
def edges_at(edges, v):
    """Return the first two edges that end in vertex v, and how many do.

    A missing edge is -1.
    """
    result, count = (-1, -1), 0
    for e in range(len(edges)):
        if edges[e, 0] == v or edges[e, 1] == v:
            result = (e, result[1]) if count == 0 else (result[0], e) if count == 1 else result
            count += 1
    return result[0], result[1], count


@compiled
def gap_at(xy, side, planes, e, v):
    """Return how far apart the planes beside edge e are over vertex v."""
    return abs(
        evaluate_plane(planes, side[e, 0], xy[v, 0], xy[v, 1])
        - evaluate_plane(planes, side[e, 1], xy[v, 0], xy[v, 1])
    )


@compiled
def is_clear(xy, edges, missing, stays, distant, reach):
    """Return whether edge (missing, distant) can become (stays, distant).

    No vertex may lie in the triangle between them or within reach of it.
    """
    for e in range(len(edges)):
        for v in edges[e]:
            if v < 0 or v in (missing, stays, distant):
                continue
            if is_beside(xy[v], xy[stays], xy[distant], reach):
                return False
            a, b, c = (
                turn(xy[missing], xy[stays], xy[v]),
                turn(xy[stays], xy[distant], xy[v]),
                turn(xy[distant], xy[missing], xy[v]),
            )
            if (a >= 0) == (b >= 0) and (b >= 0) == (c >= 0):
                return False
    return True


@compiled
def without_short_edges(xy, edges, side, planes, reaches):
    """Drop an end of every edge between two cells that is shorter than 3 mm.

    Returns (xy, edges, side), compacted.

    Only an end where nothing else meets can go, of two the one over which the cells are further
    apart. Outlines stay.
    """
    edges = edges.copy()
    for e in range(len(edges)):
        u, v = edges[e]
        if u < 0 or side[e, 0] == OUTSIDE or side[e, 1] == OUTSIDE:
            continue
        if np.hypot(float(xy[u, 0] - xy[v, 0]), float(xy[u, 1] - xy[v, 1])) >= SHORT_UNITS:
            continue
        if gap_at(xy, side, planes, e, u) < gap_at(xy, side, planes, e, v):
            u, v = v, u
        for missing, stays in ((u, v), (v, u)):
            first, second, count = edges_at(edges, missing)
            other = second if first == e else first
            end = 0 if edges[other, 0] == missing else 1
            distant = edges[other, 1 - end]
            if (
                count != 2
                or distant == stays
                or not is_clear(
                    xy,
                    edges,
                    missing,
                    stays,
                    distant,
                    find_reach(reaches, xy[missing, 0], xy[missing, 1]),
                )
            ):
                continue
            edges[other, end] = stays
            edges[e, 0] = edges[e, 1] = -1
            break
    return renumber_vertices(xy, edges, side)
