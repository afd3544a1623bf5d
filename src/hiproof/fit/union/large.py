"""Search a large roof in windows.

Blocks are searched as houses and sewn together, more is grown where points are unexplained, and all
is settled. The time follows the roof's area. No limit depends on the whole roof. The remaining
limits bound the time of one window, and finer structure stays unseen beyond them.
"""

from __future__ import annotations

import numpy as np
import shapely

from .block import SETTLE_POINTS, find_in_block, search_block
from .blocks import BLOCK_M2, HeightRaster, find_cheapest_cut
from .box import Box, clip_to_box
from .edges import SETTLE_REACH_M
from .moves import settle_volume
from .places import grow_at_places
from .plan import Plan
from .scene import Scene
from .seams import SEAM_MARGIN_M, find_row, sew
from .whole import POSITION, Whole
from .window import change_in_window, forget_digests

LEAST_HALF_M2 = 1.0  # Least area (m2) of outline on either side of a cut.


def find_in_windows(plan: Plan, outline: shapely.Polygon, scene: Scene) -> np.ndarray:
    """Find the volumes (k, COLUMNS) of a large roof.

    Its points and outline are those of `scene`.
    """
    whole = Whole(scene, plan, outline)
    if whole.area <= BLOCK_M2:  # a roof of one block is searched as a house, and keeps its base
        return forget_digests(find_in_block(whole, whole.box)[0])
    search_box(whole, HeightRaster(whole), whole.box, whole.area)
    grow_at_places(whole)
    settle_in_windows(whole)
    return forget_digests(whole.volumes)


def search_box(whole: Whole, raster: HeightRaster, box: Box, area_m2: float) -> None:
    """Search a box that holds so much of the outline.

    It is one block, or halves sewn together along the cut.
    """
    cut = find_cheapest_cut(raster, box) if area_m2 > BLOCK_M2 else None
    halves = box.split(*cut) if cut else (box, box)
    areas = [clip_to_box(whole.outline, half).area for half in halves]
    if cut is None or min(areas) < LEAST_HALF_M2:
        search_block(whole, box)
        return
    for half, area in zip(halves, areas, strict=True):
        search_box(whole, raster, half, area)
    sew(whole, box, *cut)


def settle_in_windows(whole: Whole) -> None:
    """Refit every volume, and move its edges a little, on the points around it."""
    for place in [row[POSITION].tobytes() for row in whole.volumes[1:]]:
        k = whole.find(place)
        if k is not None:
            settle_in_window(whole, k)


def settle_in_window(whole: Whole, k: int) -> None:
    """Refit volume k, and move its edges a little, on the points around it."""
    extent = Box(*whole.boxes[k])
    if not extent.u0 <= extent.u1:
        return

    def settle_row(rows: np.ndarray, scene: Scene, value: float) -> tuple[np.ndarray, float]:
        return settle_volume(rows, scene, value, find_row(rows, k), SETTLE_REACH_M)

    change_in_window(whole, extent.widen(SEAM_MARGIN_M), SETTLE_POINTS, settle_row, {k})
