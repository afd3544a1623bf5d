"""Grow more at the places of a large roof where most points are still unexplained."""

from __future__ import annotations

import numpy as np

from .add import FEWEST_UNEXPLAINED, find_unexplained
from .block import BLOCK
from .blocks import BLOCK_M2
from .box import Box
from .candidates import MOST_NEW_PLANES, list_candidates
from .grow import grow_volumes, prepare_growth
from .prices import PLACE_UNITS
from .scene import Scene
from .seams import WINDOW_POINTS
from .whole import Whole
from .window import change_in_window

COUNT_SQUARE_M = 3.0  # Size (m) of a square in which unexplained points are counted.
SQUARES_AROUND = 2  # Squares around one that count, too.
PLACES_A_BLOCK = 3.0  # Most places tried for each block's area: a limit on time.
WINDOW_M = 20.0  # Size (m) of a place's window.


def grow_at_places(whole: Whole) -> None:
    """Grow more volumes where most points are unexplained, at each place once."""
    scene, box = whole.scene, whole.box
    is_far = np.abs(whole.compute_heights() - whole.z) > scene.dead + scene.width
    i = ((whole.u - box.u0) / COUNT_SQUARE_M).astype(int)
    j = ((whole.v - box.v0) / COUNT_SQUARE_M).astype(int)
    counts = np.zeros((i.max() + 1, j.max() + 1))
    np.add.at(counts, (i[is_far], j[is_far]), 1.0)
    for _ in range(max(1, round(PLACES_A_BLOCK * whole.area / BLOCK_M2))):
        sums = sum_squares(counts)
        a, b = np.unravel_index(int(np.argmax(sums)), sums.shape)
        if sums[a, b] < PLACE_UNITS * scene.evidence:
            break
        u, v = box.u0 + (a + 0.5) * COUNT_SQUARE_M, box.v0 + (b + 0.5) * COUNT_SQUARE_M
        change_in_window(
            whole, Box(u, u, v, v).widen(0.5 * WINDOW_M), WINDOW_POINTS, grow_in_window
        )
        counts[
            max(a - SQUARES_AROUND, 0) : a + SQUARES_AROUND + 1,
            max(b - SQUARES_AROUND, 0) : b + SQUARES_AROUND + 1,
        ] = 0.0


def sum_squares(counts: np.ndarray) -> np.ndarray:
    """Sum up the counts (a, b) over each square and those around it."""
    padded = np.pad(counts, SQUARES_AROUND)
    steps = range(2 * SQUARES_AROUND + 1)
    rows, columns = counts.shape
    return np.sum([padded[p : p + rows, q : q + columns] for p in steps for q in steps], axis=0)


def grow_in_window(volumes: np.ndarray, scene: Scene, value: float) -> tuple[np.ndarray, float]:
    """Grow more volumes in a window where points are unexplained."""
    unexplained_points = find_unexplained(volumes, scene)
    if len(unexplained_points) < FEWEST_UNEXPLAINED:
        return volumes, value
    candidates = list_candidates(scene, unexplained_points, MOST_NEW_PLANES, BLOCK)
    return grow_volumes(volumes, value, prepare_growth(scene, candidates), candidates, BLOCK)
