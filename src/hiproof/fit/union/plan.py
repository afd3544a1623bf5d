"""Lay out the plan of one building.

It has a frame of its own, the points that count, a grid of cells, and the unobserved cells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from ...compiled import compiled
from ...frames import PlanFrame
from ...geometry.point_in_polygon import flips
from ...geometry.rings import ring_edges
from ..direction import main_direction
from ..walls import on_walls
from .planes import Cloud, Grid, UnobservedCells

# With fewer points, a building is one level block at their median, and a window shows nothing.
MIN_STRUCTURE_POINTS = 4
FACADE_BORDER_M = 0.15  # Distance (m) from the border within which returns may be a facade's.
# Density (points/m2) from which on a cloud loses all points so near the border. Sparser clouds lose
# those that lie on walls.
FACADE_MIN_DENSITY = 4.0
# Distance (m) for each of these points: a bay half a metre deep must keep some of its few.
FACADE_M_A_POINT = 0.025
LEAST_AWAY = 8  # With fewer points further in, none is lost.
LEAST_AWAY_SHARE = 0.5  # With a smaller share of points further in, none is lost.
COVERED_SHARE = 0.8  # Share of the outline that points usually cover.
MERGE_LINES_M = 0.2  # Lines of the grid that are nearer (m) are one.
GRID_CELL_M = 0.5  # Size (m) of a cell.
GRID_CELL_SPACINGS = 0.6  # Size of a cell in spacings of points, where these are larger.
MAX_CELLS = 22  # Most cells a side.
HEIGHT_MARGIN_M = 0.3  # Distance (m) beyond the range of heights that an unobserved roof may have.
SHADE = 0.2  # Price (points) of the highest of roofs for each missing point.


@dataclass(frozen=True)
class Plan:
    """Everything that the search needs of one building.

    `density` is in points per square metre of covered outline. `border` (3, m) are u, v, z of
    points next to the outline that do not count: they may be of the walls. `points` (n, 3) are all
    inside the outline, in the frame of the building.
    """

    frame: PlanFrame
    cloud: Cloud
    grid: Grid
    unobserved: UnobservedCells
    density: float
    border: np.ndarray
    points: np.ndarray


@compiled
def measure_depth(x, y, starts, ends):
    """Return the distance (n,) of points to the nearest of the edges.

    These go from `starts` to `ends` (m, 2). The distance is negative outside (even-odd rule).
    """
    inside, nearest = np.zeros(len(x), np.bool_), np.full(len(x), np.inf)
    # Edges follow each other, so that the processor computes several points at once.
    for e in range(len(starts)):
        x0, y0, x1, y1 = starts[e, 0], starts[e, 1], ends[e, 0], ends[e, 1]
        dx, dy = x1 - x0, y1 - y0
        square = max(dx * dx + dy * dy, 1e-18)
        for i in range(len(x)):
            inside[i] ^= flips(x0, y0, x1, y1, x[i], y[i])
            t = min(max(((x[i] - x0) * dx + (y[i] - y0) * dy) / square, 0.0), 1.0)
            nearest[i] = min(nearest[i], (x0 + t * dx - x[i]) ** 2 + (y0 + t * dy - y[i]) ** 2)
    for i in range(len(x)):
        nearest[i] = np.sqrt(nearest[i]) if inside[i] else -np.sqrt(nearest[i])
    return nearest


def lay_lines(
    lowest: float, highest: float, vertices: np.ndarray, cell: float, most_cells: int = MAX_CELLS
) -> np.ndarray:
    """Lay at most `most_cells` cells' lines from `lowest` to `highest`.

    They lie at the footprint's `vertices`, and about `cell` apart between these.
    """
    corner_lines, end = [float(lowest)], float(highest)
    for x in sorted(vertices.tolist()):
        if abs(x - corner_lines[-1]) > MERGE_LINES_M and abs(x - end) > MERGE_LINES_M:
            corner_lines.append(x)
    corner_lines.append(end)
    # If an outline has hundreds of vertices, drop the line closest to its neighbours.
    while len(corner_lines) > most_cells:
        crowded = min(
            range(1, len(corner_lines) - 1), key=lambda k: corner_lines[k + 1] - corner_lines[k - 1]
        )
        del corner_lines[crowded]
    gaps = [b - a for a, b in pairwise(corner_lines)]
    step = max(cell, (corner_lines[-1] - corner_lines[0]) / most_cells)
    fill = [max(1, round(gap / step)) for gap in gaps]
    while sum(fill) > most_cells and max(fill) > 1:
        step *= 1.1
        fill = [max(1, round(gap / step)) for gap in gaps]
    lines = [
        a + gap * q / count
        for a, gap, count in zip(corner_lines, gaps, fill, strict=False)
        for q in range(count)
    ]
    return np.array([*lines, corner_lines[-1]])


def find_cells(lines: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return which of the cells between neighbouring `lines` each of x (n,) lies in.

    The lines ascend. It is the first or last cell for a place beyond all.
    """
    return np.searchsorted(lines[1:-1], x, side="right")


def lay_out_plan(points_local: np.ndarray, outline: shapely.Polygon) -> Plan:
    """Lay out frame, points, grid and unobserved cells for `points_local` (n, 3).

    Points outside `outline` do not count.
    """
    angle = main_direction(outline)
    rotation = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    depth = measure_depth(
        points_local[:, 0].copy(), points_local[:, 1].copy(), *ring_edges(outline)
    )
    all_points = points_local[depth >= 0.0]
    counts = find_roof_points(all_points, depth[depth >= 0.0], outline.area)
    inside = all_points[counts]
    centroid = shapely.get_coordinates(outline.centroid)[0]
    middle = len(inside) // 2
    height = np.partition(inside[:, 2], middle)[middle] if len(inside) else 0.0
    frame = PlanFrame(np.array([*centroid, height]), rotation)
    uvz = frame.to_plan(inside)
    uvz = uvz[np.lexsort(np.round(uvz.T, 6))]  # independent of the points' order
    density = len(uvz) / max(COVERED_SHARE * outline.area, 1.0)
    corners = (shapely.get_coordinates(outline.exterior)[:-1] - centroid) @ rotation.T
    cell = max(GRID_CELL_M, GRID_CELL_SPACINGS / math.sqrt(max(density, 1e-9)))
    (low_u, low_v), (high_u, high_v) = corners.min(axis=0), corners.max(axis=0)
    u_lines = lay_lines(low_u, high_u, corners[:, 0], cell)
    v_lines = lay_lines(low_v, high_v, corners[:, 1], cell)
    grid = Grid(u_lines, v_lines)
    u, v, z = (np.ascontiguousarray(column) for column in uvz.T)
    cloud = Cloud(u, v, z, find_cells(u_lines, u), find_cells(v_lines, v))
    border = frame.to_plan(all_points[~counts]).T
    unobserved = lay_unobserved_cells(frame, grid, cloud, outline)
    return Plan(frame, cloud, grid, unobserved, density, border, all_points)


def find_roof_points(points: np.ndarray, depth: np.ndarray, area_m2: float) -> np.ndarray:
    """Return which points (n, 3) are of the roof, at `depth` (n,) inside an outline.

    Those near its border may be of the walls.
    """
    density = len(points) / area_m2
    dense = density >= FACADE_MIN_DENSITY
    is_near = depth < (
        min(FACADE_BORDER_M, FACADE_M_A_POINT * density) if dense else FACADE_BORDER_M
    )
    if len(points) - is_near.sum() < max(LEAST_AWAY, LEAST_AWAY_SHARE * len(points)):
        return np.ones(len(points), bool)
    if not dense:
        is_near[is_near] = on_walls(points[is_near], points, 1.0 / math.sqrt(density))
    return ~is_near


def measure_emptiness(cloud: Cloud, expected: np.ndarray) -> np.ndarray:
    """Return how empty (nu, nv) cells and their neighbours are of `expected` points.

    It is 1 without any, and 0 from half of the expected (nu, nv) on.
    """
    rows, columns = expected.shape
    padded = np.zeros((2, rows + 2, columns + 2))
    padded[0, 1:-1, 1:-1] = np.bincount(
        cloud.i * columns + cloud.j, minlength=expected.size
    ).reshape(rows, columns)
    padded[1, 1:-1, 1:-1] = expected
    windows = [padded[:, a : a + rows, b : b + columns] for a in range(3) for b in range(3)]
    sums = np.sum(windows, axis=0)
    return np.clip(1.0 - sums[0] / np.maximum(0.5 * sums[1], 1e-9), 0.0, 1.0)


def lay_unobserved_cells(
    frame: PlanFrame, grid: Grid, cloud: Cloud, outline: shapely.Polygon
) -> UnobservedCells:
    """Lay a cell's centre inside the outline in every cell of the grid.

    It weighs as many points as its area usually holds.
    """
    centre_u, centre_v = (0.5 * (lines[:-1] + lines[1:]) for lines in (grid.u, grid.v))
    u, v = np.repeat(centre_u, len(centre_v)), np.tile(centre_v, len(centre_u))
    xy = frame.xy_local(np.column_stack([u, v]))
    inside = measure_depth(xy[:, 0].copy(), xy[:, 1].copy(), *ring_edges(outline)) > 0.0
    weight = np.outer(np.diff(grid.u), np.diff(grid.v)) * len(cloud.u) / outline.area
    shade = SHADE * weight * measure_emptiness(cloud, weight)
    z_low, z_high = (cloud.z.min(), cloud.z.max()) if len(cloud.z) else (0.0, 0.0)
    u, v, weight, shade = (
        np.ascontiguousarray(column[inside]) for column in (u, v, weight.ravel(), shade.ravel())
    )
    return UnobservedCells(u, v, weight, shade, z_low - HEIGHT_MARGIN_M, z_high + HEIGHT_MARGIN_M)
