"""Search the volumes of a plan, block by block.

Structure is searched with some of the points of a block. The loop over moves fits it to all, and
makes one roof of what meets along the cuts.
"""

from __future__ import annotations

import numpy as np

from .blocks import BLOCK_M2, HeightRaster, find_cheapest_cut
from .grow import grow
from .objective import is_base_visible
from .scene import end_at_border, open_window
from .volumes import U0, V1, make_base
from .whole import Box, Whole, clip_to_box

# Points in which structure is searched, of a house and of a larger roof or block.
HOUSE_POINTS, BLOCK_POINTS = 600, 1600
LARGEST_HOUSE_M2 = 200.0  # Area (m2) of the largest house.
LEAST_HALF_M2 = 1.0  # Least area (m2) of outline on either side of a cut.


def find_volumes(whole: Whole) -> np.ndarray:
    """Find the volumes (k, COLUMNS) of a roof."""
    blocks = search_box(whole, HeightRaster(whole), whole.box, whole.outline.area)
    if blocks:
        return np.concatenate(blocks)
    z = np.sort(whole.plan.uvz[2])  # of hardly a point
    return make_base(float(z[(len(z) - 1) // 2]))


def count_search_points(area_m2: float) -> int:
    """Return how many points of a block are searched at most."""
    return HOUSE_POINTS if area_m2 <= LARGEST_HOUSE_M2 else BLOCK_POINTS


def search_box(whole: Whole, raster: HeightRaster, box: Box, area_m2: float) -> list[np.ndarray]:
    """Return the volumes of each block of a box that holds so much of the outline."""
    cut = find_cheapest_cut(raster, box) if area_m2 > BLOCK_M2 else None
    halves = box.split(cut[0], find_step(whole, box, *cut, raster.pitch)) if cut else (box, box)
    areas = [clip_to_box(whole.outline, half).area for half in halves]
    if cut is None or min(areas) < LEAST_HALF_M2:
        return search_block(whole, box, area_m2)
    return [
        block
        for half, area in zip(halves, areas, strict=True)
        for block in search_box(whole, raster, half, area)
    ]


def find_step(whole: Whole, box: Box, axis: int, place: float, pitch: float) -> float:
    """Return where within two cells of a cut, at a `place` of an axis, heights change most.

    The squares of heights about their means on both sides have the least sum there.
    """
    strip = box.split(axis, place + 2 * pitch)[0].split(axis, place - 2 * pitch)[1]
    numbers = whole.find_points(strip)
    x, z = whole.plan.uvz[[axis, 2]][:, numbers]
    order = np.argsort(x, kind="stable")
    x, z = x[order], z[order]
    if len(x) < 2:
        return place
    before = np.arange(1, len(x))
    sums = np.cumsum(z)[:-1]
    spread = sums**2 / before + (z.sum() - sums) ** 2 / (len(x) - before)
    q = int(np.argmax(spread))
    return float(0.5 * (x[q] + x[q + 1]))


def search_block(whole: Whole, box: Box, area_m2: float) -> list[np.ndarray]:
    """Return the volumes of a block, which end where it does, in a list.

    It is searched by itself, its own base first. The list is empty for hardly a point.
    """
    scene = open_window(whole, box, count_search_points(area_m2))
    if scene is None:
        return []
    volumes, _ = grow(scene)
    is_alone = box == whole.box
    if not is_base_visible(volumes, scene, count_points=not is_alone):
        volumes = volumes[1:]
    elif not is_alone:
        volumes[0, U0 : V1 + 1] = box
    return [volumes if is_alone else end_at_border(whole, volumes, box)]
