"""Search a large roof block by block.

Each block is searched as a house. The loop over moves makes one roof of what meets along the cuts.
"""

from __future__ import annotations

import numpy as np

from .blocks import BLOCK_M2, HeightRaster, find_cheapest_cut
from .candidates import Effort
from .grow import grow
from .moves import refit_volumes
from .objective import compute_objective, is_base_visible
from .trim import trim
from .volumes import U0, V1
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


def search_box(whole: Whole, raster: HeightRaster, box: Box, area_m2: float) -> list[np.ndarray]:
    """Return the volumes of each block of a box that holds so much of the outline."""
    cut = find_cheapest_cut(raster, box) if area_m2 > BLOCK_M2 else None
    halves = box.split(cut[0], find_step(whole, box, *cut, raster.pitch)) if cut else (box, box)
    areas = [clip_to_box(whole.outline, half).area for half in halves]
    if cut is None or min(areas) < LEAST_HALF_M2:
        return search_block(whole, box)
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


def search_block(whole: Whole, box: Box) -> list[np.ndarray]:
    """Return the volumes of a block, which end where it does, in a list.

    It is searched by itself, its own base first. The list is empty for hardly a point.
    """
    scene, full = open_window(whole, box, BLOCK_POINTS), open_window(whole, box, FULL_POINTS)
    if scene is None or full is None:
        return []
    volumes, _ = grow(scene, BLOCK)
    volumes, value = refit_volumes(volumes, full, compute_objective(volumes, full))
    volumes, _ = trim(volumes, full, value)
    is_alone = box == whole.box
    if not is_base_visible(volumes, full, count_points=not is_alone):
        volumes = volumes[1:]
    elif not is_alone:
        volumes[0, U0 : V1 + 1] = box
    return [volumes if is_alone else end_at_border(whole, volumes, box)]
