"""Flat corners turned in, so that rounding cannot fold a face. Compiled.

A plan vertex in the middle of a cell's straight border (another edge ends there) is a corner of the
cell's face. It lies off the line between its neighbours by a fraction of a millimetre, and so do
rounded heights off the face's plane. Where the three are the face's tip, they make a triangle of
any slope (val3dity's 204). A corner that points into its cell makes no such triangle.
"""

from __future__ import annotations

import numpy as np

from ..compiled import compiled
from .arrangement import OUTSIDE, find_reach, half_edge_order, next_half_edges, turn

# units of the grid, 0.3 mm: heights rounded to 0.1 mm can turn a thinner triangle by over 20
# degrees
FLAT_UNITS = 3.0
INWARD_UNITS = (
    # units of the grid, 0.3 mm: far enough that the corner points inwards in the plane of a steep
    # face too
    3.0
)


@compiled
def borders_outside(edges, side, v):
    """Return whether the outline passes through vertex v."""
    for e in range(len(edges)):
        if (edges[e, 0] == v or edges[e, 1] == v) and (
            side[e, 0] == OUTSIDE or side[e, 1] == OUTSIDE
        ):
            return True
    return False


@compiled
def is_free(xy, edges, v, x, y, reach):
    """Return whether vertex v can lie at (x, y).

    No edge but its own and no vertex may lie within reach.
    """
    for e in range(len(edges)):
        a, b = edges[e, 0], edges[e, 1]
        ax, ay, bx, by = float(xy[a, 0]), float(xy[a, 1]), float(xy[b, 0]), float(xy[b, 1])
        if v in (a, b):
            far_x, far_y = (bx, by) if a == v else (ax, ay)
            if np.hypot(x - far_x, y - far_y) < reach:
                return False
            continue
        dx, dy = bx - ax, by - ay
        t = min(1.0, max(0.0, ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)))
        if np.hypot(x - ax - t * dx, y - ay - t * dy) < reach:
            return False
    return True


@compiled
def turn_flat_corners_in(xy, edges, side, ties, reaches, may_turn):
    """Move every flat corner to the inner side of its neighbours' line.

    Returns plan vertices (n, 2). The inner side is the cell's.

    `edges` (e, 2), `side` (e, 2) and `ties` (k, 3) as `split_at_crossings` returns them. Corners
    that `may_turn` (n,) leaves out stay, those of the outline, with a tie, and without room.
    """
    xy = xy.copy()
    follow = next_half_edges(edges, *half_edge_order(xy, edges))
    label = side.ravel()
    for h in range(len(follow)):
        following = follow[h]
        a, v, b = (
            edges[h >> 1, h & 1],
            edges[following >> 1, following & 1],
            edges[following >> 1, 1 - (following & 1)],
        )
        if label[h] == OUTSIDE or a == b or not may_turn[v]:
            continue
        if borders_outside(edges, side, v):
            continue
        if (ties[:, 0] == v).any():
            continue
        dx, dy = float(xy[b, 0] - xy[a, 0]), float(xy[b, 1] - xy[a, 1])
        length = np.hypot(dx, dy)
        along = ((xy[v, 0] - xy[a, 0]) * dx + (xy[v, 1] - xy[a, 1]) * dy) / length
        outward = turn(xy[a], xy[v], xy[b]) / length
        if not (-INWARD_UNITS < outward < FLAT_UNITS and 0.0 < along < length):
            continue
        x = np.rint(xy[a, 0] + along * dx / length - INWARD_UNITS * dy / length)
        y = np.rint(xy[a, 1] + along * dy / length + INWARD_UNITS * dx / length)
        if is_free(xy, edges, v, x, y, find_reach(reaches, xy[v, 0], xy[v, 1])):
            xy[v, 0], xy[v, 1] = np.int64(x), np.int64(y)
    return xy
