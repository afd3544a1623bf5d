"""The planar arrangement behind a solid, on an integer grid, so every orientation test is exact.

Plan coordinates are int64 in units of `GRID_M` (0.1 mm), which is also how CityJSON rounds: what is
valid here stays valid when written. Segments are noded with a *reach*: afterwards no two vertices
are closer than it, no vertex is closer than it to an edge it does not end, and no two edges cross.
That well-separated arrangement is what the rest can rely on.

Half-edges are numbered 2 e (edge e from its first to its second vertex) and 2 e + 1 (back), so the
twin of h is h ^ 1. Polygons are soups of edges (x0, y0, x1, y1) in any order; inside is by parity.
"""

from __future__ import annotations

import math
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
def turn(a, b, c):
    """Return twice the signed area of triangle abc, exact for integers; left is positive."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


@compiled
def is_beside(p, a, b, reach):
    """Return whether `p` lies beside the inner part of segment ab, closer than `reach`."""
    along, length2 = dot(a, b, p), dot(a, b, b)
    across = float(turn(a, b, p))
    return 0 < along < length2 and across * across < reach * reach * float(length2)


@compiled
def dot(a, b, c):
    """Return the product of ab and ac."""
    return (b[0] - a[0]) * (c[0] - a[0]) + (b[1] - a[1]) * (c[1] - a[1])


@compiled
def crosses(a, b, c, d):
    """Return whether line ab passes between `c` and `d`."""
    return float(turn(a, b, c)) * float(turn(a, b, d)) < 0.0


@compiled
def find_vertex_beside(xy, a, b, reach):
    """Return the vertex of `xy` (n, 2) beside segment ab nearest to a, else -1.

    None is one that makes a small triangle with the ends, in which an end lies beside the edge from
    the vertex to the other end: its three edges would replace each other for ever.
    """
    best = -1
    for v in range(len(xy)):
        if (
            is_beside(xy[v], xy[a], xy[b], reach)
            and (best < 0 or dot(xy[a], xy[b], xy[v]) < dot(xy[a], xy[b], xy[best]))
            and not is_beside(xy[a], xy[v], xy[b], reach)
            and not is_beside(xy[b], xy[a], xy[v], reach)
        ):
            best = v
    return best


@compiled
def number_ends(places, xy, numbers, reach):
    """Number `places` (m, 2), those closer than `reach` as one; `xy` gets vertices, their count."""
    count = 0
    for k in range(len(places)):
        number, nearest = count, reach * reach
        for v in range(count):
            x, y = places[k, 0] - xy[v, 0], places[k, 1] - xy[v, 1]
            if float(x * x + y * y) < nearest:
                number, nearest = v, float(x * x + y * y)
        if number == count:
            copy_row(xy[count], places[k])
            count += 1
        numbers[k] = number
    return count


def node(segments: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices (n, 2) and edges (e, 2) of an arrangement.

    It is that of `segments` (m, 4), well separated by the `reach` (grid units). Earlier segments
    have the right of way: their end points stay, later ones within reach move onto them. Returns no
    edges if it does not come to rest (never seen; the bound keeps a broken input from hanging a
    run).
    """
    steps = 100 * len(segments) + 10000
    xy, edges, waiting = (np.empty((k * steps, 2), np.int64) for k in (1, 1, 4))
    ends = np.empty(2 * len(segments), np.int64)
    count = number_ends(segments.reshape(-1, 2), xy, ends, reach)
    waiting[: len(segments)] = ends.reshape(-1, 2)[::-1]  # the first is the last
    count, edge_count = add_segments(xy, count, edges, waiting, len(segments), reach)
    edges = edges[:edge_count]
    return xy[:count], edges[edges[:, 0] >= 0]


@compiled
def add_segments(xy, count, edges, waiting, top, reach):
    """Add to `edges` the segments that are `waiting`, the last of the first `top` first.

    `xy` has `count` vertices. Returns the numbers of vertices and of edges, of which some are -1.
    """
    edge_count = 0
    for _ in range(len(edges)):
        if top == 0:
            return count, edge_count
        top -= 1
        a, b = waiting[top, 0], waiting[top, 1]
        v, e = find_vertex_beside(xy[:count], a, b, reach), -1
        for k in range(edge_count):
            c, d = edges[k, 0], edges[k, 1]
            if (c == a and d == b) or (c == b and d == a):
                a = b
            elif e < 0 <= c and crosses(xy[a], xy[b], xy[c], xy[d]):
                e = k if crosses(xy[c], xy[d], xy[a], xy[b]) else e
        if a == b:
            continue
        if v >= 0:
            waiting[top, 0], waiting[top, 1], waiting[top + 1, 0], waiting[top + 1, 1] = v, b, a, v
            top += 2
        elif e < 0:
            edges[edge_count, 0], edges[edge_count, 1] = a, b
            edge_count += 1
        else:
            waiting[top, 0], waiting[top, 1] = a, b
            top = take_back(xy, count, edges[:edge_count], e, waiting, top + 1, reach)
            count += 1
    return 0, 0


@compiled
def take_back(xy, vertex, edges, crossed, waiting, top, reach):
    """Put a new vertex where the last waiting segment crosses an edge, and edges to go through it.

    These are the `crossed` edge and those beside the vertex. Returns the new top of `waiting`.
    """
    a, b = xy[waiting[top - 1, 0]], xy[waiting[top - 1, 1]]
    c, d = xy[edges[crossed, 0]], xy[edges[crossed, 1]]
    t = float(turn(c, d, a)) / (float(turn(c, d, a)) - float(turn(c, d, b)))
    for axis in range(2):
        xy[vertex, axis] = np.rint(a[axis] + t * (b[axis] - a[axis]))
    for k in range(len(edges)):
        c = edges[k, 0]
        if c >= 0 and (k == crossed or is_beside(xy[vertex], xy[c], xy[edges[k, 1]], reach)):
            copy_row(waiting[top], edges[k])
            edges[k, 0] = -1
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


class PlanCells(NamedTuple):
    """The plan as labelled edges.

    `xy` (n, 2) are int64 grid units, `edges` (e, 2), and `side` (e, 2) the labels left and right. A
    label is the index of the plane that roofs the cell, OUTSIDE (-1) beyond the outline.
    """

    xy: np.ndarray
    edges: np.ndarray
    side: np.ndarray


def dissolve(cells: PlanCells) -> PlanCells:
    """Drop edges with one label on either side, then straight vertices; compacted."""
    is_border = cells.side[:, 0] != cells.side[:, 1]
    edges = drop_straight_vertices(cells.xy, cells.edges[is_border])
    return renumber_vertices(PlanCells(cells.xy, edges, cells.side[is_border]))


def renumber_vertices(cells: PlanCells) -> PlanCells:
    """Renumber vertices in the order in which edges name them; edges below zero go."""
    is_live = cells.edges[:, 0] >= 0
    ends = cells.edges[is_live].ravel()
    used, first, number = np.unique(ends, return_index=True, return_inverse=True)
    order = np.argsort(first)
    edges = np.argsort(order)[number].reshape(-1, 2)
    return PlanCells(cells.xy[used[order]], edges, cells.side[is_live])


def drop_straight_vertices(xy: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return the edges (e, 2) without straight vertices; vertices of edges that go are -1.

    A vertex goes when it lies within COLLINEAR_UNITS of the line between its two neighbours,
    counting what was already dropped along them.
    """
    ends, drift = edges.tolist(), np.zeros(len(edges))
    touching: list[list[int]] = [[] for _ in xy]
    for e, pair in enumerate(ends):
        for v in pair:
            touching[v].append(e)
    candidates = [v for v, meeting in enumerate(touching) if len(meeting) == 2]
    changed = True
    while changed:
        changed = False
        for v in candidates:
            if not touching[v]:
                continue
            e, g = touching[v]
            a, b = (sum(ends[k]) - v for k in (e, g))
            off = abs(turn(xy[a], xy[b], xy[v])) / max(math.dist(xy[a], xy[b]), 1)
            off += max(drift[e], drift[g])
            is_straight = is_beside(xy[v], xy[a], xy[b], 2 * COLLINEAR_UNITS)
            if a == b or off > COLLINEAR_UNITS or not is_straight:
                continue
            ends[e][ends[e].index(v)] = b
            drift[e], ends[g] = off, [-1, -1]
            touching[v], touching[b] = [], [e if k == g else k for k in touching[b]]
            changed = True
    return np.array(ends, np.int64).reshape(-1, 2)


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
def meeting_lines(soup, soup_start, planes, plane_start):
    """Return the segments (m, 4) in plan along which the active plane changes.

    Piece p has the edges soup_start[p]:soup_start[p + 1] of `soup`, and so its planes.
    """
    out, count = np.empty((64, 4), np.int64), 0
    pieces = len(plane_start) - 1
    for p in range(pieces):
        for q in range(p, pieces):
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
                    in_p = inside_intervals(soup, soup_start[p], soup_start[p + 1], px, py, dx, dy)
                    in_q = inside_intervals(soup, soup_start[q], soup_start[q + 1], px, py, dx, dy)
                    for k in range(0, len(in_p) - 1, 2):
                        for m in range(0, len(in_q) - 1, 2):
                            t0 = max(lower, in_p[k], in_q[m])
                            t1 = min(upper, in_p[k + 1], in_q[m + 1])
                            if t1 - t0 < 1:
                                continue
                            if count == len(out):
                                out, full = np.empty((2 * count, 4), np.int64), out
                                copy_rows(out, full)
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
