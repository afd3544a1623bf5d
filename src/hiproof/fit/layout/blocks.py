"""Cut a large roof into blocks that each grow as a house.

Cuts follow steps and narrow places. A cut costs the length over which the roof continues across it,
and more the less it halves the roof.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import shapely

from ...geometry.point_in_polygon import find_inside
from ..shapes.regions import list_polygons
from .depth import make_depth_raster
from .whole import Box, Whole, clip_to_box

# Largest area of outline in a block (m2). Blocks of 400 m2 cut saw-tooth halls through their teeth
# (17 of 20 right at 5 points/m2, all with 600), and Vienna has 81.8 % of its edges instead of 83.2.
BLOCK_M2 = 600.0
HEIGHT_CELL_M = 0.6  # Size (m) of a cell of the heights that cuts consider.
HEIGHT_CELL_SPACINGS = 1.2  # The cell's size in spacings of points, where these are larger.
LEAST_STEP_M = 0.3  # Lowest step (m) that makes a cut cheaper.
CHEAPEST_STEP_M = 1.0  # Lowest step (m) at which a cut is as cheap as it gets.
OVER_STEP = 0.1  # Share of a cut's price that remains at such a step.
FIXED_M = 1.0  # Price (m) of each cut besides.
LEAST_HALF_SHARE = 0.25  # Least share of a box's roof on either side of a cut.
UNEVEN = 2.0  # Factor of the price of a cut that does not halve the roof.
FEWEST_CUT_CELLS = 8  # A box with fewer cells along an axis is not cut.
LEAST_HALF_M2 = 1.0  # Least area (m2) of outline on either side of a cut.


def split_into_blocks(whole: Whole) -> list[Whole]:
    """Split a building into blocks, each as if it were a building: one if it is small enough."""
    outlines = split_outline(whole, HeightRaster(whole), whole.box, whole.outline.area)
    if len(outlines) == 1:
        return [whole]
    blocks = [cut_out(whole, outline) for outline in outlines]
    return [block for block in blocks if block.plan.uvz.shape[1] > 0]


def split_outline(
    whole: Whole, raster: HeightRaster, box: Box, area_m2: float
) -> list[shapely.Polygon]:
    """Return the outlines of the blocks of a box that holds so much of the outline."""
    cut = find_cheapest_cut(raster, box) if area_m2 > BLOCK_M2 else None
    halves = box.split(cut[0], find_step(whole, box, *cut, raster.pitch)) if cut else (box, box)
    areas = [clip_to_box(whole.outline, half).area for half in halves]
    if cut is None or min(areas) < LEAST_HALF_M2:
        return list_polygons(clip_to_box(whole.outline, box))
    return [
        outline
        for half, area in zip(halves, areas, strict=True)
        for outline in split_outline(whole, raster, half, area)
    ]


def cut_out(whole: Whole, outline: shapely.Polygon) -> Whole:
    """Return what lies in an `outline`, a part of a building's."""
    plan = whole.plan
    points, border = (xyz[:, find_inside(outline, *xyz[:2])] for xyz in (plan.uvz, plan.border))
    part = replace(plan, uvz=points, border=border)
    return replace(whole, plan=part, outline=outline, raster=make_depth_raster(outline))


def find_step(whole: Whole, box: Box, axis: int, place: float, pitch: float) -> float:
    """Return where within two cells of a cut, at a `place` of an axis, heights change most.

    The squares of heights about their means on both sides have the least sum there.
    """
    x, z = whole.plan.uvz[[axis, 2]][:, whole.find_points(box)]
    is_near = np.abs(x - place) <= 2 * pitch
    x, z = x[is_near], z[is_near]
    order = np.argsort(x, kind="stable")
    x, z = x[order], z[order]
    if len(x) < 2:
        return place
    before = np.arange(1, len(x))
    sums = np.cumsum(z)[:-1]
    spread = sums**2 / before + (z.sum() - sums) ** 2 / (len(x) - before)
    q = int(np.argmax(spread))
    return float(0.5 * (x[q] + x[q + 1]))


class HeightRaster:
    """Median heights `z` (a, b) of a roof's points by cell, from its box's corner on.

    Cells without points are NaN.
    """

    def __init__(self, whole: Whole):
        self.box = whole.box
        self.pitch = max(HEIGHT_CELL_M, HEIGHT_CELL_SPACINGS / math.sqrt(whole.plan.density))
        u, v, z = whole.plan.uvz
        i = ((u - self.box.u0) / self.pitch).astype(int)
        j = ((v - self.box.v0) / self.pitch).astype(int)
        rows, columns = max(int(i.max()), 0) + 1, max(int(j.max()), 0) + 1
        cell = i.clip(0) * columns + j.clip(0)
        order = np.lexsort((z, cell))
        first = np.flatnonzero(np.diff(cell[order], prepend=-1))
        last = np.append(first[1:], len(order))
        self.z = np.full((rows, columns), np.nan)
        self.z.ravel()[cell[order[first]]] = z[order[(first + last - 1) // 2]]

    def select_box(self, box: Box) -> tuple[np.ndarray, tuple[int, int]]:
        """Return the heights in a box, and their first row and column."""
        i0, j0 = int((box.u0 - self.box.u0) / self.pitch), int((box.v0 - self.box.v0) / self.pitch)
        i1 = math.ceil((box.u1 - self.box.u0) / self.pitch)
        j1 = math.ceil((box.v1 - self.box.v0) / self.pitch)
        return self.z[i0:i1, j0:j1], (i0, j0)


def find_cheapest_cut(raster: HeightRaster, box: Box) -> tuple[int, float] | None:
    """Return axis and place (m) of the cheapest cut of a box, None if it has none."""
    heights, first = raster.select_box(box)
    best, cheapest = None, math.inf
    for axis, z in enumerate((heights, heights.T)):
        if len(z) < FEWEST_CUT_CELLS:
            continue
        costs = price_cuts(z, raster.pitch)
        q = int(np.argmin(costs))
        if costs[q] < cheapest:
            start = raster.box.u0 if axis == 0 else raster.box.v0
            best, cheapest = (axis, start + (first[axis] + q) * raster.pitch), costs[q]
    return best


def price_cuts(z: np.ndarray, pitch: float) -> np.ndarray:
    """Return the price (m) of a cut before each of the rows of heights z (a, b).

    It is infinite where the cut leaves too little on one side.
    """
    is_seen = np.isfinite(z)
    shares = np.cumsum(is_seen.sum(axis=1)) / max(is_seen.sum(), 1)
    costs = np.full(len(z), np.inf)
    share = shares[1:-2]
    step = np.abs(z[3:] - z[:-3])  # between the rows one and a half cells to either side
    along = (step - LEAST_STEP_M) / (CHEAPEST_STEP_M - LEAST_STEP_M)
    unbroken = np.nansum(1.0 - np.clip(along, 0.0, 1.0 - OVER_STEP), axis=1) * pitch
    costs[2:-1] = (unbroken + FIXED_M) * (1.0 + UNEVEN * np.abs(share - 0.5))
    costs[2:-1][(share <= LEAST_HALF_SHARE) | (share >= 1.0 - LEAST_HALF_SHARE)] = np.inf
    return costs
