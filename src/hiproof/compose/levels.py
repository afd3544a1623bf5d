"""Heights over the plan. Compiled.

They are the levels that meet at each plan vertex, and the places where faces of neighbours cross.
"""

from __future__ import annotations

import numpy as np

from ..compiled import compiled
from ..geometry.arrays import copy_row, copy_rows, sort_order
from .arrangement import OUTSIDE, half_edge_order, next_half_edges, trace_faces

# levels closer than this become one: points within 1 mm are one by ISO 19107 as checked
LEVEL_GAP_M = 1.1e-3
NEAR_UNITS = 2000.0  # units of the grid, 0.2 m: a crossing nearer to a corner is moved aside of it
# units of the grid that it is moved by, about a millimetre; the first that leaves the face flat
ASIDE_UNITS = (6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0)


@compiled
def evaluate_plane(planes, label, x, y):
    return planes[label, 0] * x + planes[label, 1] * y + planes[label, 2]


@compiled
def has_room(xy, edges, e, x, y, reach):
    """Return whether (x, y) is at least `reach` from every edge but edge `e`."""
    for other in range(len(edges)):
        a, b = xy[edges[other, 0]], xy[edges[other, 1]]
        if other == e or min(a[0], b[0]) - reach > x or max(a[0], b[0]) + reach < x:
            continue
        dx, dy, px, py = float(b[0] - a[0]), float(b[1] - a[1]), x - a[0], y - a[1]
        t = min(1.0, max(0.0, (px * dx + py * dy) / (dx * dx + dy * dy)))
        if np.hypot(px - t * dx, py - t * dy) < reach:
            return False
    return True


@compiled
def crossing_place(xy, edges, side, planes, e, x, y, reach):
    """Return the grid point for a crossing of the planes beside edge e.

    The crossing is at (x, y); the point lies a millimetre aside where there is room.

    On the edge itself rounding would leave it hundredths of a millimetre off the line between its
    neighbours, and so make a triangle of any slope. It moves along the line on which the planes
    meet, to where both are nearest the grid.
    """
    left, right = side[e, 0], side[e, 1]
    gx, gy = planes[left, 0] - planes[right, 0], planes[left, 1] - planes[right, 1]
    dx, dy = xy[edges[e, 1], 0] - xy[edges[e, 0], 0], xy[edges[e, 1], 1] - xy[edges[e, 0], 1]
    size = np.hypot(gx, gy)
    # sine of the angle between that line and e
    across = (gx * dx + gy * dy) / (size * np.hypot(float(dx), float(dy)))
    best, best_x, best_y = np.inf, x, y
    if abs(across) < 0.3:
        return best_x, best_y
    for aside_unit in ASIDE_UNITS:
        for way in (-1.0, 1.0):
            step = way * aside_unit / abs(across) / size
            at_x, at_y = np.rint(x - step * gy), np.rint(y + step * gx)
            z0 = evaluate_plane(planes, left, at_x, at_y)
            z1 = evaluate_plane(planes, right, at_x, at_y)
            off = (
                max(abs(z0 - np.rint(0.5 * (z0 + z1))), abs(z1 - np.rint(0.5 * (z0 + z1))))
                / aside_unit
            )
            if off < best and has_room(xy, edges, e, at_x, at_y, reach):
                best, best_x, best_y = off, at_x, at_y
    return best_x, best_y


@compiled
def split_at_crossings(xy, edges, side, planes, reach):
    """Split every edge over which the two cells' heights swap order.

    Returns (xy, edges, side, ties (k, 3)).

    A tie (vertex, z low, z high) replaces a split that would fall within reach of a vertex: there
    the levels become one.
    """
    room = len(edges)
    out_xy = np.empty((len(xy) + room, 2), np.int64)
    out_edges, out_side = np.empty((2 * room, 2), np.int64), np.empty((2 * room, 2), np.int64)
    ties = np.empty((room, 3))
    copy_rows(out_xy, xy)
    copy_rows(out_edges, edges)
    copy_rows(out_side, side)
    vertices, count, tied = len(xy), room, 0
    gap = LEVEL_GAP_M * 1e4
    for e in range(room):
        left, right = side[e, 0], side[e, 1]
        if left == OUTSIDE or right == OUTSIDE:
            continue
        a, b = xy[edges[e, 0]], xy[edges[e, 1]]
        at_a = evaluate_plane(planes, left, a[0], a[1]) - evaluate_plane(planes, right, a[0], a[1])
        at_b = evaluate_plane(planes, left, b[0], b[1]) - evaluate_plane(planes, right, b[0], b[1])
        if at_a * at_b >= 0 or abs(at_a) <= gap or abs(at_b) <= gap:
            continue
        t = at_a / (at_a - at_b)
        length = np.hypot(float(b[0] - a[0]), float(b[1] - a[1]))
        if t * length < reach or (1 - t) * length < reach:
            v = edges[e, 0] if t < 0.5 else edges[e, 1]
            z0 = evaluate_plane(planes, left, xy[v, 0], xy[v, 1])
            z1 = evaluate_plane(planes, right, xy[v, 0], xy[v, 1])
            ties[tied, 0], ties[tied, 1], ties[tied, 2] = v, min(z0, z1), max(z0, z1)
            tied += 1
            continue
        x, y = a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])
        if min(t, 1 - t) * length < NEAR_UNITS:
            x, y = crossing_place(xy, edges, side, planes, e, x, y, reach)
        out_xy[vertices, 0], out_xy[vertices, 1] = np.int64(np.rint(x)), np.int64(np.rint(y))
        out_edges[e, 1] = vertices
        out_edges[count, 0], out_edges[count, 1] = vertices, edges[e, 1]
        copy_row(out_side[count], side[e])
        vertices += 1
        count += 1
    return (
        out_xy[:vertices].copy(),
        out_edges[:count].copy(),
        out_side[:count].copy(),
        ties[:tied].copy(),
    )


@compiled
def is_tied(ties, v, lower, upper):
    """Return whether a tie at vertex v spans the gap from `lower` to `upper`."""
    for k in range(len(ties)):
        if ties[k, 0] == v and ties[k, 1] <= lower and upper <= ties[k, 2]:
            return True
    return False


@compiled
def stack_levels(xy, edges, side, planes, z_ground, ties):
    """Stack levels over every plan vertex, in grid units.

    Returns (order, start, follow, face) of the half-edges, `level` (2e,) the 3D vertex over each
    half-edge's origin at the height of the cell on its left, and `vertices` (m, 3). Vertices over
    one plan vertex are numbered upwards without gaps.
    """
    order, start = half_edge_order(xy, edges)
    follow = next_half_edges(edges, order, start)
    face, _ = trace_faces(xy, edges, follow)
    label = side.ravel()
    level = np.empty(len(label), np.int64)
    vertices = np.empty((len(label) + len(xy), 3))
    count = 0
    for v in range(len(xy)):
        surroundings = order[start[v] : start[v + 1]]
        z = np.empty(len(surroundings))
        for k in range(len(surroundings)):
            current = label[surroundings[k]]
            z[k] = (
                z_ground
                if current == OUTSIDE
                else evaluate_plane(planes, current, xy[v, 0], xy[v, 1])
            )
        ranking = sort_order(z)
        first = 0
        for k in range(len(surroundings)):
            top = k + 1 == len(surroundings)
            if not top:
                lower, upper = z[ranking[k]], z[ranking[k + 1]]
                top = upper - lower > LEVEL_GAP_M * 1e4 and not is_tied(ties, v, lower, upper)
            level[surroundings[ranking[k]]] = count
            if top:
                vertices[count, 0], vertices[count, 1] = xy[v, 0], xy[v, 1]
                vertices[count, 2] = np.rint(0.5 * (z[ranking[first]] + z[ranking[k]]))
                first, count = k + 1, count + 1
    return order, start, follow, face, level, vertices[:count].copy()


@compiled
def is_saddle(around, level, face, label):
    """Return whether the half-edges `around` a plan vertex make it no clean manifold.

    That is where the levels rise and fall more than once, or where one cell has two sectors that do
    not adjoin.
    """
    size = len(around)
    turns, last, first = 0, 0, 0
    for k in range(size):
        current, following = around[k], around[(k + 1) % size]
        sign = np.sign(level[following] - level[current])
        if sign != 0:
            turns += last != 0 and sign != last
            first = sign if first == 0 else first
            last = sign
        if label[current] != OUTSIDE and face[current] != face[following]:
            for m in range(2, size):
                if face[around[(k + m) % size]] == face[current]:
                    return True
    return turns + (last != first) > 2


@compiled
def find_saddles(order, start, level, face, label):
    """Return which plan vertices (n,) are no clean manifolds."""
    result = np.empty(len(start) - 1, np.bool_)
    for v in range(len(result)):
        result[v] = is_saddle(order[start[v] : start[v + 1]], level, face, label)
    return result
