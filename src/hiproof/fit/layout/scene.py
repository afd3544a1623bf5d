"""Describe a box of a building as candidates are found in it.

A scene holds a bounded number of the box's points, spread over all heights, in each of the
building's directions, and grid lines and unobserved cells of its own.
"""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Sequence

import numpy as np
import shapely

from ..shapes.regions import list_polygons
from .plan import (
    GRID_CELL_M,
    GRID_CELL_SPACINGS,
    HEIGHT_MARGIN_M,
    MIN_STRUCTURE_POINTS,
    Cloud,
    find_cells,
    lay_cells,
    lay_lines,
)
from .whole import DEAD_M, Box, Whole, clip_to_box

LEAST_CELLS = 22  # As many cells a side a scene may have, and more where it has many points.
MOST_WALL_LEAN = 0.6  # Largest lean of walls that planes may face besides those along the axes.
LEANS_APART = 0.035  # Least difference of two such leans.
MOST_LEANS = 3  # Most such leans.
WALL_M = 2.0  # Shortest length (m) of such a wall.


Scene = namedtuple(
    "Scene",
    "U V z weight shade n low high turn lines cell_u cell_v leans unit dead width allowed",
)
"""A box of a building as candidates are found in it.

- U, V (directions, n + g): the points, then the unobserved cells.
- z, weight (n + g,): the points' heights, and the points that a place stands for.
- shade (n + g,): the price of the highest of roofs over an unobserved cell without points around
  it, for walls hide only what is lower.
- n: the number of points.
- low, high: the heights that a roof may have over an unobserved cell.
- turn (directions, 2): cosine and sine of each direction from the first.
- lines: places for an edge, by direction and axis, padded with infinity.
- cell_u, cell_v (directions, n + g): the cells between these in which points and cells lie.
- leans (directions, 2, m): of walls not quite along an axis, x = offset + lean y, padded.
- unit: the points that a unit of structure must explain.
- dead, width: a point costs min((max(|dz| - dead, 0) / width)^2, 1).
- allowed (2, 3, 3, 2): the shapes that a volume may have, see `volumes.is_allowed`.
"""


def open_window(whole: Whole, box: Box, most_points: int) -> Scene | None:
    """Return the scene of a box, of at most so many of its points.

    Returns None if it holds no roof or hardly a point.
    """
    part = shapely.MultiPolygon(list_polygons(clip_to_box(whole.outline, box)))
    numbers = whole.find_points(box)
    if part.is_empty or len(numbers) < MIN_STRUCTURE_POINTS:
        return None
    n, uvz = min(len(numbers), most_points), whole.plan.uvz[:, numbers]
    u, v, z = uvz[:, np.argsort(uvz[2], kind="stable")[np.arange(n) * len(numbers) // n]]
    ring = shapely.get_coordinates(part)
    corners = np.array([ring @ np.array([[c, -s], [s, c]]) for c, s in whole.turn])
    most = max(LEAST_CELLS, math.isqrt(n))
    lines = [line for turned in corners for line in lay_grid(turned, n / part.area, most)]
    cells = lay_unobserved_cells(whole, lines[0], lines[1], np.array([u, v, z]), n / part.area)
    u, v, c, s = np.r_[u, cells[0]], np.r_[v, cells[1]], whole.turn[:, :1], whole.turn[:, 1:]
    U, V = c * u + s * v, c * v - s * u
    return Scene(
        U,
        V,
        np.r_[z, np.zeros(cells.shape[1])],
        np.r_[np.ones(n), cells[2]],
        np.r_[np.zeros(n), cells[3]],
        n,
        float(z.min()) - HEIGHT_MARGIN_M,
        float(z.max()) + HEIGHT_MARGIN_M,
        whole.turn,
        pad_rows(lines),
        np.array([find_cells(axis, u) for axis, u in zip(lines[::2], U, strict=True)]),
        np.array([find_cells(axis, v) for axis, v in zip(lines[1::2], V, strict=True)]),
        list_leans(corners),
        whole.compute_unit(n / len(numbers)),
        DEAD_M,
        whole.width,
        whole.allowed,
    )


def lay_grid(corners: np.ndarray, density: float, most_cells: int) -> list[np.ndarray]:
    """Lay lines along u and along v over a place with corners (c, 2), at a density (points/m2)."""
    cell = max(GRID_CELL_M, GRID_CELL_SPACINGS / math.sqrt(max(density, 1e-9)))
    return [lay_lines(x.min(), x.max(), x, cell, most_cells) for x in corners.T]


def lay_unobserved_cells(
    whole: Whole, u_lines: np.ndarray, v_lines: np.ndarray, uvz: np.ndarray, density: float
) -> np.ndarray:
    """Return u, v, weight and shade (4, g) of the cells inside the outline, among points (3, n)."""
    i, j = find_cells(u_lines, uvz[0]), find_cells(v_lines, uvz[1])
    cells = lay_cells(Cloud(uvz[0], uvz[1], uvz[2], i, j), u_lines, v_lines, density)
    return cells[:, whole.raster.measure(cells[0], cells[1]) > 0.0]


def list_leans(corners: np.ndarray) -> np.ndarray:
    """Return the leans (directions, 2, m) of walls between corners, padded with infinity."""
    return pad_rows([find_leans(ring_corners, axis) for ring_corners in corners for axis in (0, 1)])


def find_leans(ring: np.ndarray, axis: int) -> list[float]:
    """Find the leans of a ring's (n, 2) edges that are nearly along an axis' lines.

    Edges quite along it do not count. The longest comes first.
    """
    step = np.concatenate([ring[1:], ring[:1]]) - ring
    length, across, along = np.hypot(step[:, 0], step[:, 1]), step[:, axis], step[:, 1 - axis]
    walls = np.nonzero((np.abs(across) < MOST_WALL_LEAN * np.abs(along)) & (length > WALL_M))[0]
    leans: list[float] = []
    for lean in (across[walls] / along[walls])[np.argsort(-length[walls], kind="stable")].tolist():
        if len(leans) < MOST_LEANS and min(abs(lean - x) for x in (0.0, *leans)) > LEANS_APART:
            leans.append(lean)
    return leans


def pad_rows(rows: Sequence[Sequence[float] | np.ndarray]) -> np.ndarray:
    """Pad rows of several lengths, two a direction, with infinity: (directions, 2, m)."""
    filled = np.full((len(rows), max(1, *map(len, rows))), np.inf)
    for row, values in zip(filled, rows, strict=True):
        row[: len(values)] = values
    return filled.reshape(len(rows) // 2, 2, -1)
