"""Lay out the plan of one building.

It has a frame of its own and the points that count. Places where none may be seen are laid out as
cells.
"""

from __future__ import annotations

import math
from collections import namedtuple
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from ...compiled import compiled
from ...frames import PlanFrame
from ...geometry.point_in_polygon import update_nearest
from ...geometry.rings import ring_edges
from ..direction import main_direction
from ..walls import on_walls

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
HEIGHT_MARGIN_M = 0.3  # Distance (m) beyond the range of heights that an unobserved roof may have.
SHADE = 0.2  # Price (points) of the highest of roofs for each missing point.

Cloud = namedtuple("Cloud", "u v z i j")  # Points (n,) and the grid cell of each.


@dataclass(frozen=True)
class Plan:
    """The points of one building in its own axes.

    `uvz` (3, n) count and ascend by u. Those next to the outline in `border` (3, m) do not: they
    may be of the walls. `density` is in points per square metre of covered outline. `points` (n, 3)
    are all inside the outline, in the frame of the building.
    """

    frame: PlanFrame
    uvz: np.ndarray
    border: np.ndarray
    density: float
    points: np.ndarray


@compiled
def measure_depth(x, y, starts, ends):
    """Return the distance (n,) of points to the nearest of the edges.

    These go from `starts` to `ends` (m, 2). The distance is negative outside (even-odd rule).
    """
    inside, nearest = np.zeros(len(x), np.bool_), np.full(len(x), np.inf)
    # Edges follow each other, so that the processor computes several points at once.
    for e in range(len(starts)):
        update_nearest(starts[e, 0], starts[e, 1], ends[e, 0], ends[e, 1], x, y, nearest, inside)
    for i in range(len(x)):
        nearest[i] = np.sqrt(nearest[i]) if inside[i] else -np.sqrt(nearest[i])
    return nearest


def lay_lines(
    lowest: float, highest: float, vertices: np.ndarray, cell: float, most_cells: int
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
    """Lay out the frame and the points of `points_local` (n, 3).

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
    uvz = frame.to_plan(inside).T
    uvz = uvz[:, np.lexsort(np.round(uvz[::-1], 6))]  # independent of the points' order
    density = len(inside) / max(COVERED_SHARE * outline.area, 1.0)
    return Plan(frame, uvz, frame.to_plan(all_points[~counts]).T, density, all_points)


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


def lay_cells(cloud: Cloud, u_lines: np.ndarray, v_lines: np.ndarray, density: float) -> np.ndarray:
    """Return u, v, weight and shade (4, g) of the middle of every cell between lines.

    A cell weighs as many points as its area usually holds, at a `density` of points (n / m2).
    """
    centres = np.meshgrid(*(0.5 * (x[:-1] + x[1:]) for x in (u_lines, v_lines)), indexing="ij")
    weight = np.outer(np.diff(u_lines), np.diff(v_lines)) * density
    shade = SHADE * weight * measure_emptiness(cloud, weight)
    return np.array([*centres, weight, shade]).reshape(4, -1)
