"""Where two blocks meet, their volumes are sewn together: those that are one become one, the others are improved.

Every step is taken in a window around the volumes that it touches, and kept where it lowers the objective there.
"""

from __future__ import annotations

import numpy as np

from .around import look_around
from .box import Box, box_around
from .edges import EVERYWHERE, LEAST_GAIN, move_edges
from .grow import typical_slopes
from .improve import change_planes
from .joins import settled_anew
from .moves import refitted, without
from .objective import objective
from .prices import LEFT_OUT_SHARE, LEFT_OUT_UNITS
from .scene import Scene
from .volumes import DIRECTION, NUMBER, SETTLED, U0, U1, V0, V1, is_fixed, roof_heights
from .whole import PLACE, Whole
from .window import change_in_window

SEAM_M = 0.8  # m to either side of a cut: volumes that reach into this strip are looked at
AROUND_M, FAR_M = 1.0, 5.0  # m around volumes that a window shows, and around one whose neighbours reach too far
MOST_WINDOW_M2, MOST_TIMES = 1200.0, 1.5  # of a window over a volume and all its neighbours; times its own box
WINDOW_POINTS = 1200  # of a window of seams at most
BESIDE_M = 0.6  # m between volumes that may be one
ALIKE_M, ALIKE_SHARE = 0.6, 0.4  # m between planes that may be one, over at least such a share of a volume
SAMPLES = 4  # a side of a volume at which its planes are compared with another's
TOUCH_M = 0.6  # m between volumes that touch
NEXT_TO_M = 0.5  # m beyond a volume within which others are its neighbours
LEFT_OUT_ROUNDS = 2  # in which neighbours take the place of a volume that is left out


def sew(whole: Whole, box: Box, axis: int, at: float) -> None:
    """Sew the volumes of a box together along the cut across an axis."""
    strip = box.split(axis, at + SEAM_M)[0].split(axis, at - SEAM_M)[1]
    if len(whole.volumes_in(strip)) < 2:
        return
    merge_pairs(whole, strip)
    for place in [whole.volumes[k, PLACE].tobytes() for k in whole.volumes_in(strip)]:
        improve_one(whole, place)


def merge_pairs(whole: Whole, strip: Box) -> None:
    """Make one of every two volumes in a strip that are all but one, where that lowers the objective."""
    tried: set[bytes] = set()
    again = True
    while again:
        again = False
        for j, k in pairs_in(whole, strip):
            key = whole.volumes[[j, k], :SETTLED].tobytes()
            if key not in tried:
                tried.add(key)
                if is_alike(whole, j, k) and merge(whole, j, k):
                    again = True
                    break


def pairs_in(whole: Whole, strip: Box) -> list[tuple[int, int]]:
    """Ordered pairs of volumes of one direction that reach into a strip and lie beside each other, or overlap."""
    numbers = whole.volumes_in(strip)
    return [(j, k) for j in numbers for k in numbers if j != k and is_beside(whole.volumes[j], whole.volumes[k])]


def is_beside(one: np.ndarray, other: np.ndarray) -> bool:
    gap_u = max(one[U0], other[U0]) - min(one[U1], other[U1])
    gap_v = max(one[V0], other[V0]) - min(one[V1], other[V1])
    return bool(one[DIRECTION] == other[DIRECTION] and max(gap_u, gap_v) < BESIDE_M)


def is_alike(whole: Whole, j: int, k: int) -> bool:
    """Whether volume k, were it everywhere, would be all but as high as volume j over much of it."""
    e = whole.boxes[j]
    if not e[0] <= e[1]:
        return False
    steps = (np.arange(SAMPLES) + 0.5) / SAMPLES
    u, v = np.meshgrid(e[0] + steps * (e[1] - e[0]), e[2] + steps * (e[3] - e[2]))
    c, s = whole.scene.turn[:, :1], whole.scene.turn[:, 1:]
    U, V = c * u.ravel() + s * v.ravel(), c * v.ravel() - s * u.ravel()
    wide = whole.volumes[[j, k]].copy()
    wide[:, U0 : V1 + 1] = whole.volumes[0, U0 : V1 + 1]
    one, other = (roof_heights(row[None], U, V)[0] for row in wide)
    return bool(np.mean(np.abs(one - other) < ALIKE_M) >= ALIKE_SHARE)


def merge(whole: Whole, j: int, k: int) -> bool:
    """Draw volume k over volume j, which goes, where that lowers the objective; tell whether it did."""

    def draw_over(rows: np.ndarray, scene: Scene, value: float) -> tuple[np.ndarray, float]:
        at_j, at_k = (row_of(rows, number) for number in (j, k))
        trial = rows.copy()
        low, high = [U0, V0], [U1, V1]
        trial[at_k, low] = np.minimum(rows[at_j, low], rows[at_k, low])
        trial[at_k, high] = np.maximum(rows[at_j, high], rows[at_k, high])
        trial = without(trial, at_j)
        trial, found = settled_anew(trial, scene, at_k - (at_j < at_k), value)
        return (trial, found) if found < value else (rows, value)

    box = box_around([Box(*whole.boxes[j]), Box(*whole.boxes[k])]).widen(AROUND_M)
    return change_in_window(whole, box, WINDOW_POINTS, draw_over, {j, k})


def row_of(rows: np.ndarray, number: int) -> int:
    """Which of the rows has a number; 0, the base, where it is gone."""
    at = np.flatnonzero(rows[1:, NUMBER] == number)
    return int(at[0]) + 1 if len(at) else 0


def improve_one(whole: Whole, place: bytes) -> None:
    """Improve the volume at a place, or leave it out, on the points around it and its neighbours."""
    k = whole.find(place)
    if k is None:
        return
    extent = Box(*whole.boxes[k])
    if not extent.u0 <= extent.u1:  # nothing of it lies inside the outline any more
        whole.replace([k], whole.volumes[:0])
        return

    def improve_row(rows: np.ndarray, scene: Scene, value: float) -> tuple[np.ndarray, float]:
        own = row_of(rows, k)
        rows, value = refitted(rows, scene, value, own)
        around = look_around(rows, scene.U, scene.V, own)
        value = move_edges(rows, scene, own, value, EVERYWHERE, around)
        rows, value = leave_out(whole, rows, scene, value, own)
        own = row_of(rows, k)
        return change_planes(rows, scene, value, own, slopes_of(rows)) if own else (rows, value)

    change_in_window(whole, window_around(whole, k), WINDOW_POINTS, improve_row)


def leave_out(whole: Whole, rows: np.ndarray, scene: Scene, value: float, k: int) -> tuple[np.ndarray, float]:
    """The volumes without the k-th, those beside where it shows drawn over its place if need be, where
    that lowers the objective."""
    trial = without(rows, k)
    limit = value + LEFT_OUT_UNITS * scene.evidence + LEFT_OUT_SHARE * scene.n
    found = objective(trial, scene, limit)
    if found == np.inf or found < value - LEAST_GAIN:
        return (trial, found) if found < value - LEAST_GAIN else (rows, value)
    shows = roof_heights(rows, scene.U, scene.V)[1] == k
    u, v = scene.U[0][shows], scene.V[0][shows]
    near = [q for q in range(1, len(trial)) if not is_fixed(trial, q)]
    near = [q for q in near if whole.extent_of(trial[q]).widen(TOUCH_M).holds(u, v).any()]
    for _ in range(LEFT_OUT_ROUNDS):
        for q in near:
            around = look_around(trial, scene.U, scene.V, q)
            found = move_edges(trial, scene, q, found, EVERYWHERE, around)
        for q in near:
            trial, found = refitted(trial, scene, found, q)
        if found < value - LEAST_GAIN:
            return trial, found
    return rows, value


def slopes_of(rows: np.ndarray) -> np.ndarray:
    """Slopes that the volumes but the base have."""
    return typical_slopes(rows[1:]) if len(rows) > 1 else np.zeros(0)


def window_around(whole: Whole, k: int) -> Box:
    """The window over a volume and all that touch it; less where that would be more than a few blocks."""
    extent = Box(*whole.boxes[k])
    near = whole.volumes_in(extent.widen(NEXT_TO_M))
    window = box_around([extent, *(Box(*whole.boxes[j]) for j in near)])
    if window.area > max(MOST_WINDOW_M2, MOST_TIMES * extent.area):
        window = extent.widen(FAR_M)
    return window.widen(AROUND_M)
