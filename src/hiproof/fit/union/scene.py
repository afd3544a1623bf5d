"""Describe one building as the search sees it.

A scene holds the points in each of the building's directions, unobserved cells, lines and the
outline.
"""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Sequence
from statistics import median

import numpy as np
import shapely

from ..direction import measure_support, quarter_gap
from .plan import Plan, lay_lines, measure_depth, ring_edges

# Most directions along walls that volumes of a building may follow, the main one first.
MOST_WALL_DIRECTIONS = 2
APART_RAD = math.radians(7.0)  # Directions differ by more (rad).
NEAR_RAD = math.radians(3.0)  # Edges within this angle (rad) support a direction.
LEAST_SUPPORT_M = 4.0  # Least length (m) of edges for a further direction.
LEAST_SUPPORT_SHARE = 0.06  # Least share of the outline's edges for a further direction.
# Depth (m) inside the outline from which on a roof is visible. Nearer, an edge that ends a little
# early reveals what lies below.
VISIBLE_DEPTH_M = 0.1
DEPTH_CELL_M = 0.2  # Size (m) of a cell of the outline's depth.
# Most cells a side of the raster of depth: 500 m. Of longer roofs, what is narrower than a cell is
# taken for hidden.
MOST_DEPTH_CELLS = 2500
MOST_WALL_LEAN = 0.6  # Largest lean of walls that planes may face besides those along the axes.
LEANS_APART = 0.035  # Least difference of two such leans.
MOST_LEANS = 3  # Most such leans.
WALL_M = 2.0  # Shortest length (m) of such a wall.

Scene = namedtuple(
    "Scene",
    "U V order z weight shade n low high turn depth corner_u corner_v pitch lines vertices leans "
    "unit dead width allowed",
)
"""A building as the search sees it.

- U, V (directions, n + g): the points, then the unobserved cells.
- order (directions, 2, n + g): their numbers, ascending along each axis.
- z, weight (n + g,): the points' heights, and the points that a place stands for.
- shade (n + g,): the price of the highest of roofs over an unobserved cell without points around
  it, for walls hide only what is lower.
- n: the number of points.
- low, high: the heights that a roof may have over an unobserved cell.
- turn (directions, 2): cosine and sine of each direction from the first.
- depth (a, b): signed depth inside the outline on a raster of the first direction, which begins at
  (corner_u, corner_v) with a node every `pitch` metres.
- lines, vertices: places for an edge, by direction and axis, padded with infinity.
- leans (directions, 2, m): of walls not quite along an axis, x = offset + lean y, padded.
- unit: the points that a unit of structure must explain.
- dead, width: a point costs min((max(|dz| - dead, 0) / width)^2, 1).
- allowed (2, 3, 3, 2): the shapes that a volume may have, see `volumes.is_allowed`.
"""


def find_directions(outline: shapely.Polygon, plan: Plan) -> list[float]:
    """Find the angles (rad) of the building's directions from the plan's own.

    They are those of the outline's edges, and the plan's own comes first. Between two of them comes
    a third: where a house bends, its wings end on one line, square to neither, and their planes
    lean to either side from there.
    """
    step = np.diff(shapely.get_coordinates(outline.exterior), axis=0) @ plan.frame.rotation.T
    length, angle = (
        np.hypot(step[:, 0], step[:, 1]),
        np.arctan2(step[:, 1], step[:, 0]) % (math.pi / 2),
    )
    directions = [0.0]
    while len(directions) < MOST_WALL_DIRECTIONS:
        new = np.all(
            [np.abs(quarter_gap(angle - other)) > APART_RAD for other in directions], axis=0
        )
        if not new.any():
            break
        support = measure_support(angle[new], angle, length, NEAR_RAD)
        best = int(np.argmax(support))
        if support[best] < max(LEAST_SUPPORT_M, LEAST_SUPPORT_SHARE * length.sum()):
            break
        directions.append(float(angle[new][best]))
    return (
        [*directions, 0.5 * float(quarter_gap(np.array(directions[1])))]
        if len(directions) == 2
        else directions
    )


def make_scene(
    plan: Plan,
    outline: shapely.Polygon,
    angles: list[float],
    unit: float,
    tolerance_m: float,
    allowed: np.ndarray,
) -> Scene:
    """Make the scene of a building.

    A point further than `tolerance_m` from the roof counts as unexplained.
    """
    cloud, unobserved = plan.cloud, plan.unobserved
    u, v = np.concatenate([cloud.u, unobserved.u]), np.concatenate([cloud.v, unobserved.v])
    turn = np.array([[math.cos(a), math.sin(a)] for a in angles])
    depth, corner, pitch = make_depth_raster(plan, outline)
    ring = (
        shapely.get_coordinates(outline.exterior)[:-1] - plan.frame.origin[:2]
    ) @ plan.frame.rotation.T
    corners = np.array([ring @ np.array([[c, -s], [s, c]]) for c, s in turn])
    U, V = np.array([c * u + s * v for c, s in turn]), np.array([c * v - s * u for c, s in turn])
    return Scene(
        U,
        V,
        sort_along(U, V),
        np.concatenate([cloud.z, np.zeros(len(unobserved.u))]),
        np.concatenate([np.ones(len(cloud.u)), unobserved.weight]),
        np.concatenate([np.zeros(len(cloud.u)), unobserved.shade]),
        len(cloud.u),
        float(unobserved.low),
        float(unobserved.high),
        turn,
        depth,
        float(corner[0]),
        float(corner[1]),
        pitch,
        make_lines(plan, corners),
        list_vertices(corners),
        list_leans(corners),
        unit,
        DEAD_M,
        max(tolerance_m - DEAD_M, LEAST_RAMP_M),
        allowed,
    )


def sort_along(U: np.ndarray, V: np.ndarray) -> np.ndarray:
    """Return the points' numbers in ascending order along each axis of each direction.

    They are (directions, 2, n).
    """
    return np.argsort(np.stack([U, V], axis=1), axis=2, kind="stable")


DEAD_M = 0.03  # Residual (m) that costs nothing.
LEAST_RAMP_M = 0.02  # Least difference (m) over which larger residuals grow to the cost of a point.


def make_depth_raster(plan: Plan, outline: shapely.Polygon) -> tuple[np.ndarray, np.ndarray, float]:
    """Make a raster of signed depth inside the outline, in the first direction.

    Also returns its lowest corner (2,) and its pitch (m).
    """
    ring = (
        shapely.get_coordinates(outline.exterior) - plan.frame.origin[:2]
    ) @ plan.frame.rotation.T
    lower, upper = ring.min(axis=0), ring.max(axis=0)
    pitch = max(DEPTH_CELL_M, float((upper - lower).max()) / MOST_DEPTH_CELLS)
    u, v = (np.arange(a, b + pitch, pitch) for a, b in zip(lower, upper, strict=True))
    nodes = plan.frame.xy_local(np.array([np.repeat(u, len(v)), np.tile(v, len(u))]).T)
    depth = measure_depth(nodes[:, 0].copy(), nodes[:, 1].copy(), *ring_edges(outline))
    return depth.reshape(len(u), len(v)), lower, pitch


def list_nodes(scene: Scene, least_depth: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return the raster's nodes that deep inside the outline: U, V (directions, n)."""
    u, v = place_nodes(scene, least_depth)
    c, s = scene.turn[:, :1], scene.turn[:, 1:]
    return c * u + s * v, c * v - s * u


def place_nodes(scene: Scene, least_depth: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes of `list_nodes` in the plan's axes: u, v (n,)."""
    i, j = np.nonzero(scene.depth >= least_depth)
    return scene.corner_u + i * scene.pitch, scene.corner_v + j * scene.pitch


def make_lines(plan: Plan, corners: np.ndarray) -> np.ndarray:
    """Return grid lines (directions, 2, m) of an outline, ascending, padded with infinity.

    Its `corners` are (directions, c, 2).
    """
    cell = median(np.diff(plan.grid.u).tolist())
    lines = [plan.grid.u, plan.grid.v]
    lines += [
        lay_lines(x.min(), x.max(), x, cell) for ring_corners in corners[1:] for x in ring_corners.T
    ]
    return pad_rows(lines)


def list_vertices(corners: np.ndarray) -> np.ndarray:
    """Return the lines (directions, 2, m) through corners, ascending, padded with infinity."""
    return pad_rows([sorted(set(x)) for ring_corners in corners for x in ring_corners.T.tolist()])


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
