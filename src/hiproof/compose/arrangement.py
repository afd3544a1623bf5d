"""The planar arrangement behind a solid, on an integer grid, so every orientation test is exact.

Plan coordinates are int64 in units of `GRID_M` (0.1 mm), which is also how CityJSON rounds: what is
valid here stays valid when written. Segments are noded with a *reach*: afterwards no two vertices
are closer than it, no vertex is closer than it to an edge it does not end, and no two edges cross.
That well-separated arrangement is what the rest can rely on.

Half-edges are numbered 2 e (edge e from its first to its second vertex) and 2 e + 1 (back), so the
twin of h is h ^ 1. Polygons are soups of edges (x0, y0, x1, y1) in any order; inside is by parity.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import shapely

from ..compiled import compiled
from ..geometry.arrays import copy_row, copy_rows, sort_values
from ..geometry.grid import KEY_OF_CELL

GRID_M = 1e-4  # m; how CityJSON is rounded, so that what is checked is what is written
OUTSIDE, UNCOVERED = -1, -2  # labels of faces that no plane covers
# units of GRID_M, half a millimetre: a vertex nearer to its neighbours' line is none
COLLINEAR_UNITS = 5.0


@compiled
def grow_array(array):
    """Return a copy of `array` with twice the rows."""
    larger = np.empty((2 * len(array), array.shape[1]), array.dtype)
    copy_rows(larger, array)
    return larger


@compiled
def append_row(rows, count, a, b):
    """Append (a, b) to `rows`, of which `count` are used, or a copy; returns rows and count."""
    if count == len(rows):
        rows = grow_array(rows)
    rows[count, 0], rows[count, 1] = a, b
    return rows, count + 1


@compiled
def find_vertex_at(xy, x, y, reach):
    """Return the vertex of `xy` (n, 2) nearest to (x, y) within `reach`, else -1."""
    best, best_d2 = -1, reach * reach
    for v in range(len(xy)):
        dx, dy = xy[v, 0] - x, xy[v, 1] - y
        if abs(dx) < reach and abs(dy) < reach:
            d2 = float(dx * dx + dy * dy)
            if d2 < best_d2:
                best, best_d2 = v, d2
    return best


@compiled
def is_beside(p, a, b, reach):
    """Return whether `p` lies beside the inner part of segment ab, closer than `reach`."""
    abx, aby, apx, apy = b[0] - a[0], b[1] - a[1], p[0] - a[0], p[1] - a[1]
    along, length2 = abx * apx + aby * apy, abx * abx + aby * aby
    if along <= 0 or along >= length2:
        return False
    across = float(abx * apy - aby * apx)
    return across * across < reach * reach * float(length2)


@compiled
def find_vertex_near_segment(xy, a, b, reach):
    """Return the vertex of `xy` (n, 2) beside segment ab nearest to a, else -1.

    The segment's ends do not count. Nor does a vertex that makes a small triangle with them, in
    which an end lies beside the edge from the vertex to the other end: its three edges would
    replace each other for ever.
    """
    x_low, x_high = min(xy[a, 0], xy[b, 0]) - reach, max(xy[a, 0], xy[b, 0]) + reach
    y_low, y_high = min(xy[a, 1], xy[b, 1]) - reach, max(xy[a, 1], xy[b, 1]) + reach
    best, best_along = -1, np.int64(0)
    for v in range(len(xy)):
        x, y = xy[v, 0], xy[v, 1]
        if x < x_low or x > x_high or y < y_low or y > y_high or v in (a, b):
            continue
        if not is_beside(xy[v], xy[a], xy[b], reach):
            continue
        along = (xy[b, 0] - xy[a, 0]) * (x - xy[a, 0]) + (xy[b, 1] - xy[a, 1]) * (y - xy[a, 1])
        if best >= 0 and along >= best_along:
            continue
        if is_beside(xy[a], xy[v], xy[b], reach) or is_beside(xy[b], xy[a], xy[v], reach):
            continue
        best, best_along = v, along
    return best


@compiled
def turn(a, b, c):
    """Return twice the signed area of triangle abc, exact for integers; left is positive."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


@compiled
def find_first_crossing(xy, edges, a, b):
    """Return the first live edge that properly crosses segment ab, else -1."""
    x_low, x_high = min(xy[a, 0], xy[b, 0]), max(xy[a, 0], xy[b, 0])
    y_low, y_high = min(xy[a, 1], xy[b, 1]), max(xy[a, 1], xy[b, 1])
    for e in range(len(edges)):
        c, d = edges[e, 0], edges[e, 1]
        if c < 0 or c in (a, b) or d in (a, b):
            continue
        if max(xy[c, 0], xy[d, 0]) < x_low or min(xy[c, 0], xy[d, 0]) > x_high:
            continue
        if max(xy[c, 1], xy[d, 1]) < y_low or min(xy[c, 1], xy[d, 1]) > y_high:
            continue
        left, right = turn(xy[a], xy[b], xy[c]), turn(xy[a], xy[b], xy[d])
        if (left > 0) == (right > 0) or left == 0 or right == 0:
            continue
        left, right = turn(xy[c], xy[d], xy[a]), turn(xy[c], xy[d], xy[b])
        if (left > 0) != (right > 0) and left != 0 and right != 0:
            return e
    return -1


@compiled
def crossing_point(a, b, c, d):
    """Return the grid point nearest to the crossing of ab and cd."""
    left, right = float(turn(c, d, a)), float(turn(c, d, b))
    t = left / (left - right)
    return np.int64(np.rint(a[0] + t * (b[0] - a[0]))), np.int64(np.rint(a[1] + t * (b[1] - a[1])))


@compiled
def number_ends(segments, reach):
    """Number the segments' end points: xy with room, their number, and ends (m, 2)."""
    xy, count = np.empty((2 * len(segments) + 16, 2), np.int64), 0
    ends = np.empty((len(segments), 2), np.int64)
    for s in range(len(segments)):
        for end in range(2):
            x, y = segments[s, 2 * end], segments[s, 2 * end + 1]
            v = find_vertex_at(xy[:count], x, y, reach)
            if v < 0:
                v, xy[count, 0], xy[count, 1] = count, x, y
                count += 1
            ends[s, end] = v
    return xy, count, ends


@compiled
def has_edge(edges, a, b):
    """Return whether edge ab, in either direction, is one of `edges` (e, 2)."""
    for c, d in edges:
        if (c == a and d == b) or (c == b and d == a):
            return True
    return False


@compiled
def node(segments, reach):
    """Return the vertices (n, 2) and edges (e, 2) of an arrangement.

    It is that of `segments` (m, 4), well separated by the `reach` (grid units). Earlier segments
    have the right of way: their end points stay, later ones within reach move onto them. Returns no
    edges if it does not come to rest (never seen; the bound keeps a broken input from hanging a
    run).
    """
    xy, count, ends = number_ends(segments, reach)
    stack, top = ends[::-1].copy(), len(ends)  # the first on top
    edges, edge_count = np.empty((2 * len(segments) + 16, 2), np.int64), 0
    steps = 0
    while top > 0:
        steps += 1
        if steps > 100 * len(segments) + 10000:
            return xy[:0], edges[:0]
        top -= 1
        a, b = stack[top, 0], stack[top, 1]
        if a == b:
            continue
        while top + 1 + edge_count > len(stack):  # what may be taken back, and the segment itself
            stack = grow_array(stack)
        v = find_vertex_near_segment(xy[:count], a, b, reach)
        if v >= 0:
            stack, top = append_row(stack, top, v, b)
            stack, top = append_row(stack, top, a, v)
            continue
        if has_edge(edges[:edge_count], a, b):
            continue
        e = find_first_crossing(xy, edges[:edge_count], a, b)
        if e < 0:
            edges, edge_count = append_row(edges, edge_count, a, b)
            continue
        x, y = crossing_point(xy[a], xy[b], xy[edges[e, 0]], xy[edges[e, 1]])
        xy, count = append_row(xy, count, x, y)
        stack, top = append_row(stack, top, a, b)
        top = take_back(xy, count - 1, e, edges[:edge_count], stack, top, reach)
    live = 0
    for e in range(edge_count):
        if edges[e, 0] >= 0:
            copy_row(edges[live], edges[e])
            live += 1
    return xy[:count].copy(), edges[:live].copy()


@compiled
def take_back(xy, vertex, crossed, edges, stack, top, reach):
    """Put `edges` (e, 2) back on the stack that must go through a new vertex.

    These are the `crossed` edge and those beside `vertex`. Returns the stack's new top.
    """
    for e in range(len(edges)):
        c = edges[e, 0]
        if c >= 0 and (e == crossed or is_beside(xy[vertex], xy[c], xy[edges[e, 1]], reach)):
            copy_row(stack[top], edges[e])
            edges[e, 0] = edges[e, 1] = -1
            top += 1
    return top


def heights(planes: np.ndarray, x: Any, y: Any) -> Any:
    """Return the heights of planes (..., 3) at places, in grid units."""
    return planes[..., 0] * x + planes[..., 1] * y + planes[..., 2]


def find_previous(owner: np.ndarray) -> np.ndarray:
    """Return the place before each in its run of equal owners (n,), in a circle.

    >>> find_previous(np.array([4, 4, 4, 7]))
    array([2, 0, 1, 3])
    """
    place = np.arange(len(owner))
    end = np.searchsorted(owner, owner, side="right")
    return np.where(place == np.searchsorted(owner, owner), end, place) - 1


class HalfEdges(NamedTuple):
    """Half-edges (2e,) by origin, and the `face` on the left of each; face 0 is unbounded.

    The others are `polygons` (f - 1,).
    """

    order: np.ndarray
    face: np.ndarray
    polygons: np.ndarray


def trace_faces(xy: np.ndarray, edges: np.ndarray) -> HalfEdges:
    """Trace the faces of an arrangement of vertices (n, 2) and edges (e, 2).

    An edge that bounds no face, for it ends within one, has face 0 on either side.
    """
    origin, end = edges.ravel(), edges[:, ::-1].ravel()
    dx, dy = (xy[end] - xy[origin]).T
    order = np.lexsort((np.arctan2(dy, dx), origin))
    lines = shapely.linestrings(xy[edges].astype(float))
    polygons = shapely.orient_polygons(shapely.get_parts(shapely.polygonize(lines)))
    rings, owner = shapely.get_rings(polygons, return_index=True)
    corners, ring = shapely.get_coordinates(rings, return_index=True)
    vertex = look_up(xy @ KEY_OF_CELL, corners.astype(np.int64) @ KEY_OF_CELL)
    starts, ends = vertex[:-1], vertex[1:]
    keys = (starts * len(xy) + ends)[ring[:-1] == ring[1:]]
    face = np.zeros(len(origin), np.int64)
    face[look_up(origin * len(xy) + end, keys)] = owner[ring[:-1][ring[:-1] == ring[1:]]] + 1
    return HalfEdges(order, face, polygons)


def look_up(keys: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return the places (k,) of `wanted` keys (k,) among distinct `keys` (n,)."""
    order = np.argsort(keys)
    return order[np.searchsorted(keys, wanted, sorter=order)]


def edge_lengths(xy: np.ndarray, edges: np.ndarray) -> np.ndarray:
    return np.hypot(*(xy[edges[:, 0]] - xy[edges[:, 1]]).T.astype(float))


def dissolve(
    xy: np.ndarray, edges: np.ndarray, side: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Drop edges with one label (`side`: left, right), then straight vertices; compacted."""
    is_border = side[:, 0] != side[:, 1]
    edges = drop_straight_vertices(xy, edges[is_border])
    return renumber_vertices(xy, edges, side[is_border])


def renumber_vertices(
    xy: np.ndarray, edges: np.ndarray, side: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Renumber vertices in the order in which edges name them; edges below zero go."""
    is_live = edges[:, 0] >= 0
    used, first, number = np.unique(edges[is_live].ravel(), return_index=True, return_inverse=True)
    order = np.argsort(first)
    return xy[used[order]], np.argsort(order)[number].reshape(-1, 2), side[is_live]


@compiled
def drop_straight_vertices(xy, edges):
    """Return the edges (e, 2) without straight vertices; vertices of edges that go are -1.

    A vertex goes when it lies within COLLINEAR_UNITS of the line between its two neighbours,
    counting what was already dropped along them.
    """
    degree, touching = np.zeros(len(xy), np.int64), np.zeros((len(xy), 2), np.int64)
    for e in range(len(edges)):
        for end in range(2):
            v = edges[e, end]
            if degree[v] < 2:
                touching[v, degree[v]] = e
            degree[v] += 1
    drift = np.zeros(len(edges))
    changed = True
    while changed:
        changed = False
        for v in range(len(xy)):
            if degree[v] != 2:
                continue
            e, g = touching[v, 0], touching[v, 1]
            a = edges[e, 0] if edges[e, 1] == v else edges[e, 1]
            b = edges[g, 0] if edges[g, 1] == v else edges[g, 1]
            off = abs(turn(xy[a], xy[b], xy[v])) / max(
                np.hypot(float(xy[a, 0] - xy[b, 0]), float(xy[a, 1] - xy[b, 1])), 1
            )
            off += max(drift[e], drift[g])
            if (
                a == b
                or off > COLLINEAR_UNITS
                or not is_beside(xy[v], xy[a], xy[b], 2 * COLLINEAR_UNITS)
            ):
                continue
            edges[e, 0 if edges[e, 0] == v else 1] = b
            drift[e] = off
            edges[g, 0] = edges[g, 1] = -1
            degree[v] = 0
            touching[b, 0 if touching[b, 0] == g else 1] = e
            changed = True
    return edges


@compiled
def inside_intervals(soup, lower, upper, px, py, dx, dy):
    """Return sorted parameters t, an even number, where (px, py) + t (dx, dy) meets a polygon."""
    cuts = np.empty(upper - lower)
    count = 0
    for e in range(lower, upper):
        side_a = dx * (soup[e, 1] - py) - dy * (soup[e, 0] - px)
        side_b = dx * (soup[e, 3] - py) - dy * (soup[e, 2] - px)
        if (side_a > 0) != (side_b > 0):
            s = side_a / (side_a - side_b)
            x = soup[e, 0] + s * (soup[e, 2] - soup[e, 0])
            y = soup[e, 1] + s * (soup[e, 3] - soup[e, 1])
            cuts[count] = dx * (x - px) + dy * (y - py)
            count += 1
    return sort_values(cuts[:count])


@compiled
def clip_to_lowest(planes, lower, upper, j, px, py, dx, dy, t_low, t_high):
    """Narrow [t_low, t_high] to where plane j is the lowest of planes[lower:upper] on the line."""
    for k in range(lower, upper):
        if k == j:
            continue
        a, b, c = planes[k] - planes[j]
        rise, base = a * dx + b * dy, a * px + b * py + c
        if abs(rise) < 1e-12:
            if base < -1e-3:
                return 1.0, 0.0
        elif rise > 0:
            t_low = max(t_low, -base / rise)
        else:
            t_high = min(t_high, -base / rise)
    return t_low, t_high


@compiled
def meeting_lines(soup, soup_start, boxes, planes, plane_start):
    """Return the segments (m, 4) in plan along which the active plane changes.

    Pieces lie in `boxes` (k, 4): low x, low y, high x, high y.
    """
    out, count = np.empty((64, 4), np.int64), 0
    pieces = len(plane_start) - 1
    for p in range(pieces):
        for q in range(p, pieces):
            if boxes[p, 0] > boxes[q, 2] or boxes[q, 0] > boxes[p, 2]:
                continue
            if boxes[p, 1] > boxes[q, 3] or boxes[q, 1] > boxes[p, 3]:
                continue
            for i in range(plane_start[p], plane_start[p + 1]):
                for j in range(i + 1 if p == q else plane_start[q], plane_start[q + 1]):
                    a, b, c = planes[i] - planes[j]
                    steep = np.hypot(a, b)
                    if steep < 1e-7:
                        continue
                    px, py, dx, dy = -c * a / steep**2, -c * b / steep**2, -b / steep, a / steep
                    lower, upper = clip_to_lowest(
                        planes, plane_start[p], plane_start[p + 1], i, px, py, dx, dy, -1e9, 1e9
                    )
                    lower, upper = clip_to_lowest(
                        planes, plane_start[q], plane_start[q + 1], j, px, py, dx, dy, lower, upper
                    )
                    if upper - lower < 1:
                        continue
                    in_p = inside_intervals(
                        soup, soup_start[p + 1], soup_start[p + 2], px, py, dx, dy
                    )
                    in_q = inside_intervals(
                        soup, soup_start[q + 1], soup_start[q + 2], px, py, dx, dy
                    )
                    for k in range(0, len(in_p) - 1, 2):
                        for m in range(0, len(in_q) - 1, 2):
                            t0 = max(lower, in_p[k], in_q[m])
                            t1 = min(upper, in_p[k + 1], in_q[m + 1])
                            if t1 - t0 < 1:
                                continue
                            if count == len(out):
                                out = grow_array(out)
                            out[count, 0], out[count, 1] = (
                                np.rint(px + t0 * dx),
                                np.rint(py + t0 * dy),
                            )
                            out[count, 2], out[count, 3] = (
                                np.rint(px + t1 * dx),
                                np.rint(py + t1 * dy),
                            )
                            count += 1
    return out[:count].copy()
