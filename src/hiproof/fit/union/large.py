"""Search a large roof block by block.

Each block is searched as a house. The loop over moves makes one roof of what meets along the cuts.
"""

from __future__ import annotations

import numpy as np

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
# Largest area of outline in a block (m2). Blocks of 400 m2 cut saw-tooth halls through their teeth
# (17 of 20 right at 5 points/m2, all with 600), and Vienna has 81.8 % of its edges instead of 83.2.
BLOCK_M2 = 600.0
LEAST_HALF_SHARE = 0.3  # Least share of the side of a roof on either side of a cut.
LEAST_SIDE_SHARE = 0.5  # Least length of a side that is cut, as a share of the longer one.


def search_box(whole: Whole, box: Box) -> list[np.ndarray]:
    """Return the volumes of each block of a box."""
    part = clip_to_box(whole.outline, box)
    if part.area <= BLOCK_M2:
        return search_block(whole, box)
    halves = box.split(*find_step(whole, box, part.bounds))
    return [block for half in halves for block in search_box(whole, half)]


def find_step(
    whole: Whole, box: Box, bounds: tuple[float, float, float, float]
) -> tuple[int, float]:
    """Return the axis across which a box is cut, and where.

    Heights change most there, within the middle of the `bounds` of its roof: the squares of heights
    about their means on both sides fall most. Its shorter side is not cut if it is much shorter.
    """
    west, south, east, north = bounds
    ranges, longest = ((west, east), (south, north)), max(east - west, north - south)
    best, steepest = (int(north - south > east - west), 0.0), -1.0
    for axis, (low, high) in enumerate(ranges):
        margin = LEAST_HALF_SHARE * (high - low)
        strip = box.split(axis, high - margin)[0].split(axis, low + margin)[1]
        numbers = whole.find_points(strip)
        x = (whole.u, whole.v)[axis][numbers]
        order = np.argsort(x, kind="stable")
        x, z = x[order], whole.z[numbers[order]]
        if high - low < LEAST_SIDE_SHARE * longest or len(x) < 2:
            continue
        z = z - z.mean()
        before = np.arange(1, len(x))
        fall = np.cumsum(z)[:-1] ** 2 * (1.0 / before + 1.0 / (len(x) - before))
        q = int(np.argmax(fall))
        if fall[q] > steepest * len(x):
            best, steepest = (axis, float(0.5 * (x[q] + x[q + 1]))), fall[q] / len(x)
    return best if steepest >= 0.0 else (best[0], 0.5 * sum(ranges[best[0]]))


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
