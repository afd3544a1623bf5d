"""Search a large roof block by block.

Each block is searched as a house. The loop over moves makes one roof of what meets along the cuts.
"""

from __future__ import annotations

import numpy as np
import shapely

from .blocks import BLOCK_M2, HeightRaster, find_cheapest_cut
from .candidates import Effort
from .grow import grow
from .moves import refit_volumes
from .objective import BASE_SHARE, compute_objective
from .plan import Plan
from .scene import Scene
from .trim import trim
from .volumes import U0, V1, compute_roof_heights, make_base
from .whole import Box, Whole, clip_to_box
from .window import end_at_border, open_window

# Points of a block in which structure is searched: 2.7 per square metre of the largest block. With
# a house's 600 points, dormers and annexes of blocks stay unseen.
BLOCK_POINTS = 1600
# Points of a block to which its planes are fitted again: 5 per square metre of the largest block.
FULL_POINTS = 3000
# Growing more than one volume anew gains nothing in blocks and costs a quarter of the time
# (Vienna's even places at 5 points/m2).
BLOCK = Effort(pool_points=1200, seeds=200, regrown=1)
LEAST_HALF_M2 = 1.0  # Least area (m2) of outline on either side of a cut.
# Distance (m) of the base below the lowest point of a roof in several blocks: it is never visible.
BELOW_ALL_M = 1.0


def find_in_blocks(plan: Plan, outline: shapely.Polygon, scene: Scene) -> np.ndarray:
    """Find the volumes (k, COLUMNS) of a large roof.

    Its points and outline are those of `scene`.
    """
    whole = Whole(scene, plan, outline)
    base = make_base(float(whole.z.min()) - BELOW_ALL_M)
    if whole.area <= BLOCK_M2:  # it keeps its base
        found = search_block(whole, whole.box)
        return base if found is None else found[0]
    return np.concatenate([base, *search_box(whole, HeightRaster(whole), whole.box, whole.area)])


def search_box(whole: Whole, raster: HeightRaster, box: Box, area_m2: float) -> list[np.ndarray]:
    """Return the volumes of each block of a box that holds so much of the outline."""
    cut = find_cheapest_cut(raster, box) if area_m2 > BLOCK_M2 else None
    halves = box.split(cut[0], find_step(whole, box, *cut, raster.pitch)) if cut else (box, box)
    areas = [clip_to_box(whole.outline, half).area for half in halves]
    if cut is None or min(areas) < LEAST_HALF_M2:
        return list_block_volumes(whole, box)
    return [
        volumes
        for half, area in zip(halves, areas, strict=True)
        for volumes in search_box(whole, raster, half, area)
    ]


def find_step(whole: Whole, box: Box, axis: int, place: float, pitch: float) -> float:
    """Return where within two cells of a cut, at a `place` of an axis, heights change most.

    The squares of heights about their means on both sides have the least sum there.
    """
    strip = box.split(axis, place + 2 * pitch)[0].split(axis, place - 2 * pitch)[1]
    numbers = whole.find_points(strip)
    x = (whole.u, whole.v)[axis][numbers]
    order = np.argsort(x, kind="stable")
    x, z = x[order], whole.z[numbers[order]]
    if len(x) < 2:
        return place
    before = np.arange(1, len(x))
    sums = np.cumsum(z)[:-1]
    spread = sums**2 / before + (z.sum() - sums) ** 2 / (len(x) - before)
    q = int(np.argmax(spread))
    return float(0.5 * (x[q] + x[q + 1]))


def list_block_volumes(whole: Whole, box: Box) -> list[np.ndarray]:
    """Return the volumes of a block that end where it does, in a list, empty without points."""
    found = search_block(whole, box)
    if found is None:
        return []
    volumes, scene = found
    if is_base_bare(volumes, scene):
        volumes[0, U0 : V1 + 1] = box
    else:
        volumes = volumes[1:]
    return [end_at_border(whole, volumes, box)]


def search_block(whole: Whole, box: Box) -> tuple[np.ndarray, Scene] | None:
    """Find the volumes of a block by itself, its own base first.

    Also returns the scene of more points that they fit. Returns None for hardly a point.
    """
    scene, full = open_window(whole, box, BLOCK_POINTS), open_window(whole, box, FULL_POINTS)
    if scene is None or full is None:
        return None
    volumes = grow(scene, BLOCK)[0]
    value = compute_objective(volumes, full)
    volumes, value = refit_volumes(volumes, full, value)
    return trim(volumes, full, value)[0], full


def is_base_bare(volumes: np.ndarray, scene: Scene) -> bool:
    """Return whether so much of the base is visible that it becomes a level volume."""
    _, top = compute_roof_heights(volumes, scene.U, scene.V, scene.order)
    cells = scene.weight[scene.n :][top[scene.n :] == 0].sum()
    return bool(max(cells, 0.5 * (top[: scene.n] == 0).sum()) > BASE_SHARE * scene.n)
