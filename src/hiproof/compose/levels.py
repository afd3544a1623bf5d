"""Heights over the plan: levels that meet at each plan vertex, and where faces cross."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely

from .arrangement import OUTSIDE, PlanCells, find_previous, heights, trace_faces

# units of the grid, 1.1 mm; levels closer than this become one: points within 1 mm are one by
# ISO 19107 as checked
LEVEL_GAP_UNITS = 11.0
NEAR_UNITS = 2000.0  # units of the grid, 0.2 m: a crossing nearer to a corner is moved aside of it
# units of the grid that it is moved by, about a millimetre; the first that leaves the face flat
ASIDE_UNITS = (6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0)


def split_at_crossings(
    cells: PlanCells, planes: np.ndarray, reach: float
) -> tuple[PlanCells, list[tuple[int, float, float]]]:
    """Split every edge over which the two cells' heights swap order.

    Returns the cells and ties. A tie (vertex, z low, z high) replaces a split that would fall
    within reach of a vertex: there the levels become one.
    """
    xy, edges, side = cells
    x, y = np.moveaxis(xy[edges], -1, 0)
    left, right = (heights(planes[side[:, k], None], x, y) for k in (0, 1))
    gap = left - right
    crosses = (gap[:, 0] * gap[:, 1] < 0) & (np.abs(gap) > LEVEL_GAP_UNITS).all(axis=1)
    places, split, ties = [xy], edges.copy(), []
    for e in np.flatnonzero(crosses & (side != OUTSIDE).all(axis=1)).tolist():
        (a, b), t = xy[edges[e]], gap[e, 0] / (gap[e, 0] - gap[e, 1])
        room, end = min(t, 1 - t) * math.dist(a, b), int(t >= 0.5)
        if room < reach:
            ties.append((edges[e, end], *sorted((left[e, end], right[e, end]))))
            continue
        place = a + t * (b - a)
        if room < NEAR_UNITS:
            place = move_crossing(cells, planes[side[e]], e, place, reach)
        split[e, 1] = len(xy) + len(places) - 1
        places.append(np.rint([place]).astype(np.int64))
    is_split = split[:, 1] >= len(xy)
    rest = np.column_stack([split[is_split, 1], edges[is_split, 1]])
    parts = places, [split, rest], [side, side[is_split]]
    return PlanCells(*map(np.concatenate, parts)), ties


def move_crossing(
    cells: PlanCells, planes: np.ndarray, e: int, place: np.ndarray, reach: float
) -> np.ndarray:
    """Return the grid point for a crossing of the two `planes` (2, 3) beside edge e.

    The crossing is at `place`; the point lies a millimetre aside where there is room. On the edge
    itself rounding would leave it hundredths of a millimetre off the line between its neighbours,
    and so make a triangle of any slope. It moves along the line on which the planes meet, to where
    both are nearest the grid.
    """
    gx, gy, _ = planes[0] - planes[1]
    along = np.diff(cells.xy[cells.edges[e]], axis=0)[0]
    size = math.hypot(gx, gy)
    # sine of the angle between that line and e
    across = abs((gx * along[0] + gy * along[1]) / (size * math.hypot(*along)))
    if across < 0.3:
        return place
    aside = np.repeat(ASIDE_UNITS, 2)
    steps = np.tile([-1.0, 1.0], len(ASIDE_UNITS)) * aside / across / size
    x, y = np.rint(place[0] - steps * gy), np.rint(place[1] + steps * gx)
    z = heights(planes[:, None], x, y)
    off = np.abs(z - np.rint(0.5 * (z[0] + z[1]))).max(axis=0) / aside
    others = cells.xy[np.delete(cells.edges, e, axis=0)]
    lines = shapely.multilinestrings(shapely.linestrings(others))
    for k in np.argsort(off, kind="stable"):
        if shapely.distance(lines, shapely.Point(x[k], y[k])) >= reach:
            return np.array([x[k], y[k]])
    return place


class Levels(NamedTuple):
    """The levels of a plan: 3D `vertices` (m, 3) in grid units.

    `level` (2e,) is the vertex over each half-edge's origin at the height of the cell on its left.
    Vertices over one plan vertex are numbered upwards without gaps. `order`, `face` and `polygons`
    are those of the half-edges.
    """

    order: np.ndarray
    face: np.ndarray
    polygons: np.ndarray
    level: np.ndarray
    vertices: np.ndarray


def stack_levels(
    cells: PlanCells, planes: np.ndarray, z_ground: float, ties: list[tuple[int, float, float]]
) -> Levels:
    """Stack levels over every plan vertex, in grid units."""
    xy, origin, label = cells.xy, cells.edges.ravel(), cells.side.ravel()
    z = np.where(label == OUTSIDE, z_ground, heights(planes[label], *xy[origin].T))
    ranking = np.lexsort((z, origin))
    z, at = z[ranking], origin[ranking]
    is_top = (np.diff(at) > 0) | (np.diff(z) > LEVEL_GAP_UNITS)
    for v, lower, upper in ties:
        is_top[(at[:-1] == v) & (at[1:] == v) & (z[:-1] >= lower) & (z[1:] <= upper)] = False
    level = np.empty_like(ranking)
    level[ranking] = np.append(0, np.cumsum(is_top))
    first, last = np.flatnonzero(np.append(True, is_top)), np.flatnonzero(np.append(is_top, True))
    middle = np.rint(0.5 * (z[first] + z[last]))
    traced = trace_faces(xy, cells.edges)
    return Levels(*traced, level, np.column_stack([xy[at[first]], middle]))


def find_saddles(cells: PlanCells, levels: Levels) -> np.ndarray:
    """Return plan vertices where levels rise and fall twice, or a cell has two sectors."""
    origin, order, level = cells.edges.ravel(), levels.order, levels.level
    rise = level[order] - level[order[find_previous(origin[order])]]
    climbing, at = rise[rise != 0] > 0, origin[order][rise != 0]
    turns = np.bincount(at, climbing != climbing[find_previous(at)])
    sectors = np.column_stack([origin, levels.face])[cells.side.ravel() != OUTSIDE]
    sectors, counts = np.unique(sectors, axis=0, return_counts=True)
    return np.union1d(np.flatnonzero(turns > 2), sectors[counts > 1, 0])
