"""Where a large roof is cut into blocks that are each searched as a house: along steps, and where it is narrow.

A cut costs the length over which the roof runs on across it unbroken, and more the less it halves the roof.
"""

from __future__ import annotations

import math

import numpy as np

from .box import Box
from .whole import Whole

# Outline in a block at most (m2). Blocks of 400 m2 cut saw-tooth halls through their teeth (17 of 20
# right at 5 points/m2, all with 600), and Vienna has 81.8 % of its edges in place of 83.2.
BLOCK_M2 = 600.0
HEIGHT_CELL_M, HEIGHT_CELL_SPACINGS = (
    0.6,
    1.2,
)  # m of a cell of the heights that cuts look at, and spacings of points
LEAST_STEP_M, CHEAPEST_STEP_M, OVER_STEP = (
    0.3,
    1.0,
    0.1,
)  # a step that counts; one that makes a cut as cheap as it gets
FIXED_M = 1.0  # metres that each cut costs besides
LEAST_HALF_SHARE = 0.25  # of a box's roof on either side of a cut
UNEVEN = 2.0  # how much dearer a cut is the less it halves the roof
FEWEST_CUT_CELLS = 8  # along an axis; a shorter one is not cut


class HeightRaster:
    """Median heights `z` (a, b) of a roof's points by cell, NaN where there are none, from the corner of its box on."""

    def __init__(self, whole: Whole):
        self.box = whole.box
        self.pitch = max(HEIGHT_CELL_M, HEIGHT_CELL_SPACINGS / math.sqrt(whole.plan.density))
        i = ((whole.u - self.box.u0) / self.pitch).astype(int)
        j = ((whole.v - self.box.v0) / self.pitch).astype(int)
        rows, columns = max(int(i.max()), 0) + 1, max(int(j.max()), 0) + 1
        cell = i.clip(0) * columns + j.clip(0)
        order = np.lexsort((whole.z, cell))
        first = np.flatnonzero(np.diff(cell[order], prepend=-1))
        last = np.append(first[1:], len(order))
        self.z = np.full((rows, columns), np.nan)
        self.z.ravel()[cell[order[first]]] = whole.z[order[(first + last - 1) // 2]]

    def select_box(self, box: Box) -> tuple[np.ndarray, tuple[int, int]]:
        """The heights in a box, and the first row and column of them."""
        i0, j0 = int((box.u0 - self.box.u0) / self.pitch), int((box.v0 - self.box.v0) / self.pitch)
        i1 = math.ceil((box.u1 - self.box.u0) / self.pitch)
        j1 = math.ceil((box.v1 - self.box.v0) / self.pitch)
        return self.z[i0:i1, j0:j1], (i0, j0)


def find_cheapest_cut(raster: HeightRaster, box: Box) -> tuple[int, float] | None:
    """Axis and place (m) of the cheapest cut of a box; None where it cannot be cut."""
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
    """What a cut before each of the rows of heights z (a, b) costs (m), infinite where it leaves too little on one side."""
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
