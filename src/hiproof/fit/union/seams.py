"""Sew the volumes of two blocks together where these meet.

Volumes that are one become one, and the others are improved. Every step happens in a window around
the volumes that it touches, and is kept if it lowers the objective there.
"""

from __future__ import annotations

import numpy as np

from .box import Box, enclose_boxes
from .edges import EVERYWHERE, NO_GAIN
from .moves import remove_volume, settle_volume
from .objective import compute_objective
from .prices import LEFT_OUT_SHARE, LEFT_OUT_UNITS
from .scene import Scene
from .volumes import (
    DIRECTION,
    ROW_NUMBER,
    SETTLED,
    U0,
    U1,
    UNSORTED,
    V0,
    V1,
    compute_roof_heights,
    is_fixed,
)
from .whole import POSITION, Whole
from .window import change_in_window

# Distance (m) to either side of a cut. Volumes that reach into this strip are improved.
SEAM_STRIP_M = 0.8
SEAM_MARGIN_M = 1.0  # Distance (m) around volumes that a window shows.
LARGE_VOLUME_MARGIN_M = 5.0  # Distance (m) around a volume whose neighbours reach too far.
MOST_WINDOW_M2 = 1200.0  # Largest window (m2) over a volume and all its neighbours.
WINDOW_POINTS = 1200  # Most points of a window.
NEIGHBOUR_GAP_M = 0.6  # Distance (m) between volumes that touch, or may be one.
SAME_ROOF_M = 0.6  # Height (m) between planes that may be one.
SAME_ROOF_SHARE = 0.4  # Share of a volume over which they must be so near.
SAMPLES = 4  # Samples a side of a volume at which its planes are compared with another's.
NEXT_TO_M = 0.5  # Distance (m) beyond a volume within which others are its neighbours.
LEFT_OUT_ROUNDS = 2  # Rounds in which neighbours take the place of a volume that is left out.


def sew(whole: Whole, box: Box, axis: int, cut_place: float) -> None:
    """Sew the volumes of a box together along the cut across an axis."""
    strip = box.split(axis, cut_place + SEAM_STRIP_M)[0].split(axis, cut_place - SEAM_STRIP_M)[1]
    if len(whole.list_volumes(strip)) < 2:
        return
    merge_pairs(whole, strip)
    for place in [whole.volumes[k, POSITION].tobytes() for k in whole.list_volumes(strip)]:
        improve_volume(whole, place)


def merge_pairs(whole: Whole, strip: Box) -> None:
    """Merge pairs of volumes in a strip that are nearly one.

    A merger is kept if it lowers the objective.
    """
    tried_pairs: set[bytes] = set()
    has_merged = True
    while has_merged:
        has_merged = False
        for j, k in list_pairs(whole, strip):
            key = whole.volumes[[j, k], :SETTLED].tobytes()
            if key not in tried_pairs:
                tried_pairs.add(key)
                if is_same_roof(whole, j, k) and merge_pair(whole, j, k):
                    has_merged = True
                    break


def list_pairs(whole: Whole, strip: Box) -> list[tuple[int, int]]:
    """List ordered pairs of volumes of one direction that reach into a strip.

    They lie beside each other, or overlap.
    """
    numbers = whole.list_volumes(strip)
    return [
        (j, k)
        for j in numbers
        for k in numbers
        if j != k and is_beside(whole.volumes[j], whole.volumes[k])
    ]


def is_beside(row: np.ndarray, other: np.ndarray) -> bool:
    gap_u = max(row[U0], other[U0]) - min(row[U1], other[U1])
    gap_v = max(row[V0], other[V0]) - min(row[V1], other[V1])
    return bool(row[DIRECTION] == other[DIRECTION] and max(gap_u, gap_v) < NEIGHBOUR_GAP_M)


def is_same_roof(whole: Whole, j: int, k: int) -> bool:
    """Return whether volume k, were it everywhere, has nearly volume j's heights.

    It must over much of volume j.
    """
    e = whole.boxes[j]
    if not e[0] <= e[1]:
        return False
    steps = (np.arange(SAMPLES) + 0.5) / SAMPLES
    u, v = np.meshgrid(e[0] + steps * (e[1] - e[0]), e[2] + steps * (e[3] - e[2]))
    c, s = whole.scene.turn[:, :1], whole.scene.turn[:, 1:]
    U, V = c * u.ravel() + s * v.ravel(), c * v.ravel() - s * u.ravel()
    wide = whole.volumes[[j, k]].copy()
    wide[:, U0 : V1 + 1] = whole.volumes[0, U0 : V1 + 1]
    heights, other_heights = (compute_roof_heights(row[None], U, V, UNSORTED)[0] for row in wide)
    return bool(np.mean(np.abs(heights - other_heights) < SAME_ROOF_M) >= SAME_ROOF_SHARE)


def merge_pair(whole: Whole, j: int, k: int) -> bool:
    """Draw volume k over volume j, which is dropped, if that lowers the objective.

    Returns whether it did.
    """

    def merge_rows(rows: np.ndarray, scene: Scene, value: float) -> tuple[np.ndarray, float]:
        at_j, at_k = (find_row(rows, number) for number in (j, k))
        trial = rows.copy()
        lower, upper = [U0, V0], [U1, V1]
        trial[at_k, lower] = np.minimum(rows[at_j, lower], rows[at_k, lower])
        trial[at_k, upper] = np.maximum(rows[at_j, upper], rows[at_k, upper])
        trial = remove_volume(trial, at_j)
        trial_value = compute_objective(trial, scene, np.inf)
        at_k -= at_j < at_k
        trial, trial_value = settle_volume(trial, scene, trial_value, at_k, EVERYWHERE)
        return (trial, trial_value) if trial_value < value else (rows, value)

    box = enclose_boxes([Box(*whole.boxes[j]), Box(*whole.boxes[k])]).widen(SEAM_MARGIN_M)
    return change_in_window(whole, box, WINDOW_POINTS, merge_rows, {j, k})


def find_row(rows: np.ndarray, number: int) -> int:
    """Return which of the rows has a number, 0 (the base) if it is gone."""
    matches = np.flatnonzero(rows[1:, ROW_NUMBER] == number)
    return int(matches[0]) + 1 if len(matches) else 0


def improve_volume(whole: Whole, place: bytes) -> None:
    """Improve the volume at a place, or leave it out.

    The window shows the points around it and its neighbours. A volume too large for a window stays.
    """
    k = whole.find(place)
    if k is None:
        return
    extent = Box(*whole.boxes[k])
    if not extent.u0 <= extent.u1:  # nothing of it lies inside the outline any more
        whole.replace([k], whole.volumes[:0])
        return
    if extent.area > MOST_WINDOW_M2:
        return

    def improve_row(rows: np.ndarray, scene: Scene, value: float) -> tuple[np.ndarray, float]:
        row = find_row(rows, k)
        rows, value = settle_volume(rows, scene, value, row, EVERYWHERE)
        return leave_out(whole, rows, scene, value, row)

    change_in_window(whole, frame_neighbours(whole, k), WINDOW_POINTS, improve_row)


def leave_out(
    whole: Whole, rows: np.ndarray, scene: Scene, value: float, k: int
) -> tuple[np.ndarray, float]:
    """Leave the k-th volume out, if that lowers the objective.

    If necessary, volumes beside the place where it is visible are drawn over it.
    """
    trial = remove_volume(rows, k)
    limit = value + LEFT_OUT_UNITS * scene.evidence + LEFT_OUT_SHARE * scene.n
    trial_value = compute_objective(trial, scene, limit)
    if trial_value == np.inf or trial_value < value - NO_GAIN:
        return (trial, trial_value) if trial_value < value - NO_GAIN else (rows, value)
    shows = compute_roof_heights(rows, scene.U, scene.V, scene.order)[1] == k
    u, v = scene.U[0][shows], scene.V[0][shows]
    neighbours = [q for q in range(1, len(trial)) if not is_fixed(trial, q)]
    neighbours = [
        q
        for q in neighbours
        if whole.find_extent(trial[q]).widen(NEIGHBOUR_GAP_M).find_inside(u, v).any()
    ]
    for _ in range(LEFT_OUT_ROUNDS):
        for q in neighbours:
            trial, trial_value = settle_volume(trial, scene, trial_value, q, EVERYWHERE)
        if trial_value < value - NO_GAIN:
            return trial, trial_value
    return rows, value


def frame_neighbours(whole: Whole, k: int) -> Box:
    """Return the window over a volume and all that touch it.

    It is smaller if that would be more than two blocks.
    """
    extent = Box(*whole.boxes[k])
    neighbours = whole.list_volumes(extent.widen(NEXT_TO_M))
    window = enclose_boxes([extent, *(Box(*whole.boxes[j]) for j in neighbours)])
    if window.area > MOST_WINDOW_M2:
        window = extent.widen(LARGE_VOLUME_MARGIN_M)
    return window.widen(SEAM_MARGIN_M)
