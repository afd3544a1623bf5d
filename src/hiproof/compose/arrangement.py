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
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely

from ..geometry.grid import KEY_OF_CELL

GRID_M = 1e-4  # m; how CityJSON is rounded, so that what is checked is what is written
OUTSIDE, UNCOVERED = -1, -2  # labels of faces that no plane covers
# units of GRID_M, half a millimetre: a vertex nearer to its neighbours' line is none
COLLINEAR_UNITS = 5.0


def turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> Any:
    """Return twice the signed areas of triangles abc (..., 2), exact for integers."""
    way, off = b - a, c - a
    return way[..., 0] * off[..., 1] - way[..., 1] * off[..., 0]


def is_beside(p: np.ndarray, a: np.ndarray, b: np.ndarray, reach: float) -> Any:
    """Return whether places lie beside the inner part of segments ab (..., 2), within `reach`."""
    way = b - a
    along, length2 = (way * (p - a)).sum(axis=-1), (way * way).sum(axis=-1)
    across = np.abs(turn(a, b, p)).astype(float)
    return (along > 0) & (along < length2) & (across * across < reach * reach * length2)


def find_vertices_beside(xy: np.ndarray, a: int, b: int, reach: float) -> np.ndarray:
    """Return the vertices of `xy` (n, 2) beside segment ab.

    None is one that makes a small triangle with its ends, in which an end lies beside the edge from
    the vertex to the other end: its three edges would replace each other for ever.
    """
    near = np.flatnonzero(is_beside(xy, xy[a], xy[b], reach))
    is_small = is_beside(xy[a], xy[near], xy[b], reach) | is_beside(xy[b], xy[a], xy[near], reach)
    return near[~is_small]


def find_crossings(xy: np.ndarray, edges: np.ndarray, a: int, b: int) -> np.ndarray:
    """Return the edges that properly cross segment ab, in their order."""
    c, d = xy[edges[:, 0]], xy[edges[:, 1]]
    sides = [turn(xy[a], xy[b], c), turn(xy[a], xy[b], d), turn(c, d, xy[a]), turn(c, d, xy[b])]
    one, two, three, four = np.sign(sides)
    return np.flatnonzero((one * two < 0) & (three * four < 0))


def number_ends(segments: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Number the segments' end points, nearer ones than `reach` as one: xy (n, 2), ends (m, 2)."""
    xy, numbers = segments[:1, :2], []
    for place in segments.reshape(-1, 2):
        gaps = ((xy - place) ** 2).sum(axis=1)
        numbers.append(int(gaps.argmin()))
        if gaps.min() >= reach * reach:
            numbers[-1], xy = len(xy), np.vstack([xy, place])
    return xy, np.array(numbers, np.int64).reshape(-1, 2)


def node(segments: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices (n, 2) and edges (e, 2) of an arrangement.

    It is that of `segments` (m, 4), well separated by the `reach` (grid units). Earlier segments
    have the right of way: their end points stay, later ones within reach move onto them. Returns no
    edges if it does not come to rest (never seen; the bound keeps a broken input from hanging a
    run).
    """
    xy, ends = number_ends(segments, reach)
    edges, waiting = np.empty((0, 2), np.int64), ends[::-1].tolist()  # the first is the last
    for _ in range(100 * len(segments) + 10000):
        if not waiting:
            return xy, edges
        a, b = waiting.pop()
        if a != b:
            xy, edges = add_segment(xy, edges, a, b, reach, waiting)
    return xy[:0], edges[:0]


def add_segment(
    xy: np.ndarray, edges: np.ndarray, a: int, b: int, reach: float, waiting: list[list[int]]
) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and edges with segment ab, or put what replaces it last in `waiting`."""
    beside = find_vertices_beside(xy, a, b, reach)
    if len(beside):
        v = int(beside[((xy[beside] - xy[a]) @ (xy[b] - xy[a])).argmin()])
        waiting += [[v, b], [a, v]]
        return xy, edges
    if ((edges == (a, b)) | (edges == (b, a))).all(axis=1).any():
        return xy, edges
    crossed = find_crossings(xy, edges, a, b)[:1]
    if not len(crossed):
        return xy, np.vstack([edges, (a, b)])
    c, d = xy[edges[crossed[0]]]
    left, right = float(turn(c, d, xy[a])), float(turn(c, d, xy[b]))
    place = np.rint(xy[a] + left / (left - right) * (xy[b] - xy[a])).astype(np.int64)
    # the crossed edge and those beside the new vertex go through it
    is_back = is_beside(place, xy[edges[:, 0]], xy[edges[:, 1]], reach)
    is_back[crossed] = True
    waiting += [[a, b], *edges[is_back].tolist()]
    return np.vstack([xy, place]), edges[~is_back]


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


def inside_intervals(soup: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Return sorted places, an even number, at which a `line` meets a polygon of edges (m, 4).

    A line has x, y, and its direction; places on it are distances from there.
    """
    (x0, y0, x1, y1), (px, py, dx, dy) = soup.T, line
    side_a, side_b = dx * (y0 - py) - dy * (x0 - px), dx * (y1 - py) - dy * (x1 - px)
    crosses = (side_a > 0) != (side_b > 0)
    x0, y0, x1, y1, side_a, side_b = np.array([x0, y0, x1, y1, side_a, side_b])[:, crosses]
    s = side_a / (side_a - side_b)
    return np.sort(dx * (x0 + s * (x1 - x0) - px) + dy * (y0 + s * (y1 - y0) - py))


def find_lowest(planes: np.ndarray, own: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Return from where to where (2, n) on lines (n, 4) planes `own` (n or 1, 3) are the lowest.

    None of `planes` (k, 3) is lower there.
    """
    a, b, c = np.moveaxis(planes - own[:, None], -1, 0)
    px, py, dx, dy = lines.T[:, :, None]
    rise, base = a * dx + b * dy, a * px + b * py + c
    is_level = np.abs(rise) < 1e-12
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -base / rise
    t_low = np.where(~is_level & (rise > 0), t, -1e9).max(axis=1)
    t_high = np.where(~is_level & (rise < 0), t, 1e9).min(axis=1)
    return np.array([t_low, np.where((is_level & (base < -1e-3)).any(axis=1), t_low, t_high)])


def meeting_lines(soups: Sequence[np.ndarray], groups: Sequence[np.ndarray]) -> np.ndarray:
    """Return the segments (m, 4) in plan along which the active plane of pieces changes.

    Pieces have edges, `soups`, and `groups` of planes.
    """
    result = [np.empty((0, 4))]
    low, high = (np.array([f(soup[:, :2], axis=0) for soup in soups]) for f in (np.min, np.max))
    meets = ((low[:, None] <= high) & (low <= high[:, None])).all(axis=2)
    for p, q in np.argwhere(np.triu(meets)).tolist():
        for i, own in enumerate(groups[p]):
            others = groups[q][i + 1 if p == q else 0 :]
            others = others[np.hypot(*(own - others)[:, :2].T) >= 1e-7]
            a, b, c = (own - others).T
            steep = np.hypot(a, b)
            lines = np.column_stack([-c * a / steep**2, -c * b / steep**2, -b / steep, a / steep])
            ends = find_lowest(groups[p], own[None], lines), find_lowest(groups[q], others, lines)
            lower, upper = np.maximum(ends[0][0], ends[1][0]), np.minimum(ends[0][1], ends[1][1])
            for k in np.flatnonzero(upper - lower >= 1):
                inside = [inside_intervals(soup, lines[k]) for soup in (soups[p], soups[q])]
                start = np.maximum(lower[k], np.maximum.outer(*(cuts[::2] for cuts in inside)))
                end = np.minimum(upper[k], np.minimum.outer(*(cuts[1::2] for cuts in inside)))
                t = np.array([start, end])[:, end - start >= 1]
                xy = lines[k, :2] + t[:, :, None] * lines[k, 2:]
                result.append(np.rint(np.hstack(xy)))
    return np.concatenate(result)
