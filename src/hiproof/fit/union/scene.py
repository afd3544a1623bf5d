"""What the search sees of one building: its points in each of its directions, unseen roof, lines, and the outline."""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Sequence
from statistics import median

import numpy as np
import shapely

from ..direction import measure_support, quarter_gap
from .plan import Plan, lay_lines, measure_depth, ring_edges
from .prices import EDGE_PRICES

MOST_WALL_DIRECTIONS = 2  # of a building that volumes may follow along walls, the main one first
APART_RAD, NEAR_RAD = (
    math.radians(7.0),
    math.radians(3.0),
)  # directions differ by more; edges support one within
LEAST_SUPPORT_M, LEAST_SUPPORT_SHARE = 4.0, 0.06  # of the outline's edges, for a further direction
# m inside the outline from which on a roof shows: nearer, an edge that ends a hair early shows what lies below
VISIBLE_DEPTH_M = 0.1
DEPTH_CELL_M, MOST_DEPTH_CELLS = (
    0.2,
    400,
)  # m of a cell of the outline's depth, and cells a side at most
MOST_WALL_LEAN, LEANS_APART, MOST_LEANS, WALL_M = (
    0.6,
    0.035,
    3,
    2.0,
)  # walls that planes may face besides those along the axes

# U, V (directions, n + g): the points, then the ghosts of unseen roof; z, weight (n + g); n: how many points.
# shade (n + g): what the highest of roofs costs over a ghost without points around it, for walls hide only what is lower.
# low, high: heights a roof may take over a ghost. turn (directions, 2): cosine and sine of each from the first.
# depth (a, b): signed depth inside the outline on a raster from (corner_u, corner_v) every `pitch` metres, first direction.
# lines, vertices: places an edge may move to, by direction and axis, infinite where there are no more.
# evidence: points a unit of structure must explain; dead, width: a point costs min((max(|dz| - dead, 0) / width)^2, 1).
# allowed (2, 3, 3, 2): which shapes a volume may have, see `volumes.is_allowed`.
# corners (directions, c, 2): the outline's vertices.
# leans (directions, 2, m): of walls that are not quite along an axis, x = at + lean y; infinite where there are no more.
# edge_prices: units for an edge that shows, a metre of it, a metre of it lower than low_step (m), if in line with no corner,
# and off for each end at a corner.
Scene = namedtuple(
    "Scene",
    "U V order z weight shade n low high turn depth corner_u corner_v pitch lines vertices corners leans evidence dead width edge_prices allowed",
)


def find_directions(outline: shapely.Polygon, plan: Plan) -> list[float]:
    """Angles (rad) of the building's directions from the plan's own, which comes first: those its outline's edges have.

    Between two of them comes a third: where a house bends, its wings end on one line, square to neither, and from there their planes
    lean to either side.
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
    evidence: float,
    tolerance_m: float,
    allowed: np.ndarray,
) -> Scene:
    """The building as the search sees it; a point further than `tolerance_m` from the roof counts as unexplained."""
    cloud, ghosts = plan.cloud, plan.unobserved
    u, v = np.r_[cloud.u, ghosts.u], np.r_[cloud.v, ghosts.v]
    turn = np.array([[math.cos(a), math.sin(a)] for a in angles])
    depth, corner, pitch = make_depth_raster(plan, outline)
    ring = (
        shapely.get_coordinates(outline.exterior)[:-1] - plan.frame.origin[:2]
    ) @ plan.frame.rotation.T
    corners = np.array([ring @ np.array([[c, -s], [s, c]]) for c, s in turn])
    lines, vertices = make_lines(plan, corners)
    U, V = np.array([c * u + s * v for c, s in turn]), np.array([c * v - s * u for c, s in turn])
    return Scene(
        U,
        V,
        sort_along(U, V),
        np.r_[cloud.z, np.zeros(len(ghosts.u))],
        np.r_[np.ones(len(cloud.u)), ghosts.weight],
        np.r_[np.zeros(len(cloud.u)), ghosts.shade],
        len(cloud.u),
        float(ghosts.low),
        float(ghosts.high),
        turn,
        depth,
        float(corner[0]),
        float(corner[1]),
        pitch,
        lines,
        vertices,
        corners,
        pad_rows([find_leans(ring_corners, axis) for ring_corners in corners for axis in (0, 1)]),
        evidence,
        DEAD_M,
        max(tolerance_m - DEAD_M, LEAST_RAMP_M),
        EDGE_PRICES,
        allowed,
    )


def thin_scene(scene: Scene, numbers: np.ndarray, evidence: float) -> Scene:
    """The scene with only the points `numbers` (m,), ghosts weighing as many of them; what the outline gives is shared."""
    if len(numbers) == scene.n:
        return scene._replace(evidence=evidence)
    thinned = select_points(scene, np.r_[numbers, scene.n : len(scene.z)])
    thinned.weight[thinned.n :] *= thinned.n / scene.n
    return thinned._replace(
        order=sort_along(thinned.U, thinned.V),
        shade=thinned.shade * (thinned.n / scene.n),
        evidence=evidence,
    )


def select_points(scene: Scene, numbers: np.ndarray) -> Scene:
    """The scene of some of its points and ghosts, by ascending `numbers` (m,); `order` stays the whole's."""
    return scene._replace(
        U=scene.U.take(numbers, axis=1),
        V=scene.V.take(numbers, axis=1),
        z=scene.z[numbers],
        weight=scene.weight[numbers],
        shade=scene.shade[numbers],
        n=int(np.count_nonzero(numbers < scene.n)),
    )


def sort_along(U: np.ndarray, V: np.ndarray) -> np.ndarray:
    """The points' numbers in ascending order along each axis of each direction: (directions, 2, n)."""
    return np.argsort(np.stack([U, V], axis=1), axis=2, kind="stable")


DEAD_M = 0.03  # residuals that cost nothing
LEAST_RAMP_M = 0.02  # over how much more they grow to a whole point, at least


def make_depth_raster(plan: Plan, outline: shapely.Polygon) -> tuple[np.ndarray, np.ndarray, float]:
    """Signed depth inside the outline on a raster of the first direction, its lowest corner (2,) and its pitch (m)."""
    ring = (
        shapely.get_coordinates(outline.exterior) - plan.frame.origin[:2]
    ) @ plan.frame.rotation.T
    lower, upper = ring.min(axis=0), ring.max(axis=0)
    pitch = max(DEPTH_CELL_M, float((upper - lower).max()) / MOST_DEPTH_CELLS)
    axes = [np.arange(a, b + pitch, pitch) for a, b in zip(lower, upper, strict=True)]
    nodes = plan.frame.xy_local(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2))
    depth = measure_depth(nodes[:, 0].copy(), nodes[:, 1].copy(), *ring_edges(outline))
    return depth.reshape(len(axes[0]), len(axes[1])), lower, pitch


def list_nodes(scene: Scene, least_depth: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """The raster's nodes at least so deep inside the outline, in every direction: U, V (directions, n)."""
    i, j = np.nonzero(scene.depth >= least_depth)
    u, v = scene.corner_u + i * scene.pitch, scene.corner_v + j * scene.pitch
    c, s = scene.turn[:, :1], scene.turn[:, 1:]
    return c * u + s * v, c * v - s * u


def make_lines(plan: Plan, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Grid lines and vertex lines (directions, 2, m) of an outline's `corners` (directions, c, 2), ascending, padded with infinity."""
    cell = median(np.diff(plan.grid.u).tolist())
    lines = [plan.grid.u, plan.grid.v]
    lines += [
        lay_lines(x.min(), x.max(), x, cell) for ring_corners in corners[1:] for x in ring_corners.T
    ]
    return pad_rows(lines), pad_rows(
        [sorted(set(x)) for ring_corners in np.round(corners, 3) for x in ring_corners.T.tolist()]
    )


def find_leans(ring: np.ndarray, axis: int) -> list[float]:
    """Leans of those of a ring's (n, 2) edges that are nearly but not quite along an axis' lines, the longest first."""
    step = np.concatenate([ring[1:], ring[:1]]) - ring
    length, across, along = np.hypot(step[:, 0], step[:, 1]), step[:, axis], step[:, 1 - axis]
    walls = np.nonzero((np.abs(across) < MOST_WALL_LEAN * np.abs(along)) & (length > WALL_M))[0]
    leans: list[float] = []
    for lean in (across[walls] / along[walls])[np.argsort(-length[walls], kind="stable")].tolist():
        if len(leans) < MOST_LEANS and min(abs(lean - x) for x in (0.0, *leans)) > LEANS_APART:
            leans.append(lean)
    return leans


def pad_rows(rows: Sequence[Sequence[float] | np.ndarray]) -> np.ndarray:
    """Rows of several lengths, two a direction, as (directions, 2, m), filled up with infinity."""
    filled = np.full((len(rows), max(1, *map(len, rows))), np.inf)
    for row, values in zip(filled, rows, strict=True):
        row[: len(values)] = values
    return filled.reshape(len(rows) // 2, 2, -1)
