"""Open windows on a large roof: scenes of a box.

A window holds a bounded number of points, spread over all heights, and grid lines and unobserved
cells of its own. Steps along its border cost nothing.
"""

from __future__ import annotations

import math

import numpy as np
import shapely

from ..shapes.regions import list_polygons
from . import plan as plans
from .planes import Cloud, Grid
from .scene import Scene, list_leans, list_vertices, pad_rows, sort_along
from .volumes import DIRECTION, U0
from .whole import Box, Whole, clip_to_box

MOST_WINDOW_CELLS = 40  # Most cells a side of a window. Of a larger one they are wider.


def open_window(whole: Whole, box: Box, most_points: int) -> Scene | None:
    """Return the scene of a box, of at most so many of its points.

    Returns None if it holds no roof or hardly a point.
    """
    part = shapely.MultiPolygon(list_polygons(clip_to_box(whole.outline, box)))
    numbers = whole.find_points(box)
    if part.is_empty or len(numbers) < plans.MIN_STRUCTURE_POINTS:
        return None
    n = min(len(numbers), most_points)
    selected = numbers[
        np.argsort(whole.z[numbers], kind="stable")[np.arange(n) * len(numbers) // n]
    ]
    share, scene = n / len(numbers), whole.scene
    cloud_u, cloud_v, cloud_z = whole.u[selected], whole.v[selected], whole.z[selected]
    ring = shapely.get_coordinates(part)
    corners = np.array([ring @ np.array([[c, -s], [s, c]]) for c, s in scene.turn])
    spacing = 1.0 / math.sqrt(n / part.area)
    cell = max(plans.GRID_CELL_M, plans.GRID_CELL_SPACINGS * spacing)
    lines = [
        plans.lay_lines(x.min(), x.max(), x, cell, MOST_WINDOW_CELLS)
        for ring_corners in corners
        for x in ring_corners.T
    ]
    cloud = Cloud(cloud_u, cloud_v, cloud_z, *map(plans.find_cells, lines[:2], (cloud_u, cloud_v)))
    unobserved = lay_window_cells(whole, Grid(*lines[:2]), cloud, n / part.area)
    u, v = np.r_[cloud_u, unobserved[0]], np.r_[cloud_v, unobserved[1]]
    c, s = scene.turn[:, :1], scene.turn[:, 1:]
    U, V = c * u + s * v, c * v - s * u
    depth, corner = cut_depth_raster(scene, box)
    return scene._replace(
        U=U,
        V=V,
        order=sort_along(U, V),
        z=np.r_[cloud_z, np.zeros(len(unobserved[0]))],
        weight=np.r_[np.ones(n), unobserved[2]],
        shade=np.r_[np.zeros(n), unobserved[3]],
        n=n,
        low=float(cloud_z.min()) - plans.HEIGHT_MARGIN_M,
        high=float(cloud_z.max()) + plans.HEIGHT_MARGIN_M,
        depth=depth,
        corner_u=corner[0],
        corner_v=corner[1],
        lines=pad_rows(lines),
        vertices=list_vertices(corners),
        leans=list_leans(corners),
        unit=share * scene.unit,
    )


def lay_window_cells(
    whole: Whole, grid: Grid, cloud: Cloud, density: float
) -> tuple[np.ndarray, ...]:
    """Return the unobserved cells of a window: u, v, weight and shade (g,).

    They lie inside the outline, and weigh as those of `plan.lay_unobserved_cells`.
    """
    centre_u, centre_v = (0.5 * (lines[:-1] + lines[1:]) for lines in grid)
    u, v = np.repeat(centre_u, len(centre_v)), np.tile(centre_v, len(centre_u))
    weight = np.outer(np.diff(grid.u), np.diff(grid.v)) * density
    shade = plans.SHADE * weight * plans.measure_emptiness(cloud, weight)
    inside = measure_depth_at(whole.scene, u, v) > 0.0
    return u[inside], v[inside], weight.ravel()[inside], shade.ravel()[inside]


def measure_depth_at(scene: Scene, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the depth (n,) inside the outline of places in the plan's axes.

    It is that of the raster's nearest nodes.
    """
    i = np.round((u - scene.corner_u) / scene.pitch).astype(int)
    j = np.round((v - scene.corner_v) / scene.pitch).astype(int)
    rows, columns = scene.depth.shape
    return scene.depth[np.clip(i, 0, rows - 1), np.clip(j, 0, columns - 1)]


def cut_depth_raster(scene: Scene, box: Box) -> tuple[np.ndarray, tuple[float, float]]:
    """Return the raster of depths in a box, and its corner.

    No place is deeper than its distance from the box's border.
    """
    p, low_u, low_v = scene.pitch, scene.corner_u, scene.corner_v
    i0, j0 = max(math.floor((box.u0 - low_u) / p), 0), max(math.floor((box.v0 - low_v) / p), 0)
    i1, j1 = math.ceil((box.u1 - low_u) / p) + 1, math.ceil((box.v1 - low_v) / p) + 1
    depth = scene.depth[i0:i1, j0:j1]
    u, v = (
        low_u + (i0 + np.arange(depth.shape[0])) * p,
        low_v + (j0 + np.arange(depth.shape[1])) * p,
    )
    border_u, border_v = np.minimum(u - box.u0, box.u1 - u), np.minimum(v - box.v0, box.v1 - v)
    depth = np.minimum(np.minimum(depth, border_u[:, None]), border_v[None, :])
    return np.ascontiguousarray(depth), (low_u + i0 * p, low_v + j0 * p)


def end_at_border(whole: Whole, rows: np.ndarray, box: Box) -> np.ndarray:
    """Let volumes of the first direction end where a window does.

    They do not where the window ends at the outline.
    """
    is_aligned = rows[:, DIRECTION] == 0
    for side in range(4):
        if abs(box[side] - whole.box[side]) < plans.HEIGHT_MARGIN_M:
            continue
        limit = np.maximum if side % 2 == 0 else np.minimum
        rows[is_aligned, U0 + side] = limit(rows[is_aligned, U0 + side], box[side])
    return rows
