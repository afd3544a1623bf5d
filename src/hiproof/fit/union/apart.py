"""Volumes that show in several places told apart: houses of one height on both sides of another, dormers on both slopes.

One long volume under what stands between explains them as well, and more cheaply; a person sees two, where each pays by itself. A wing
that crosses the main roof stays one: it stands out of it on both sides.
"""

from __future__ import annotations

import numpy as np

from .moves import without
from .objective import objective
from .scene import BORDER_M, Scene, nodes
from .trim import COVER_M, runs_of
from .volumes import DIRECTION, LEVEL, OFFSET, U0, U1, V0, V1, roof_heights

LEAST_M2 = 1.0  # of each of the places in which a volume shows
IN_LINE_M = 0.5  # what stands in a row is as deep as its neighbours
STRIP_M = 0.8  # narrower than dormers are
# m within which an edge of another volume is taken for that at which one ends; m inside the outline at which it must show
NEAR_EDGE_M, INSIDE_M = 0.5, 0.4


def told_apart(volumes: np.ndarray, scene: Scene) -> np.ndarray:
    """The volumes with each that shows in several places of a row, or of a roof that it stands out of, as several."""
    U, V = nodes(scene, BORDER_M)
    heights, top = roof_heights(volumes, U, V)
    for k in range(len(volumes) - 1, 0, -1):
        for axis in (0, 1):
            pieces = pieces_of(volumes, k, axis, U, V, top, scene)
            if len(pieces) > 1:
                trial = cut_apart(volumes, k, pieces)
                if np.array_equal(roof_heights(trial, U, V)[0], heights):
                    volumes = without_strips(trial, k, len(pieces), scene)
                    heights, top = roof_heights(volumes, U, V)
                    break
    return volumes


def without_strips(volumes: np.ndarray, first: int, count: int, scene: Scene) -> np.ndarray:
    """The volumes without those of the `count` from `first` on that are strips, and do not pay: one ran too far beyond what hides it."""
    value = objective(volumes, scene, np.inf)
    for k in range(first + count - 1, first - 1, -1):
        wide = volumes[k, [U1, V1]] - volumes[k, [U0, V0]]
        trial = without(volumes, k)
        found = objective(trial, scene, value) if wide.min() < STRIP_M else np.inf
        if found < np.inf:
            volumes, value = trial, found
    return volumes


def pieces_of(
    volumes: np.ndarray, k: int, axis: int, U: np.ndarray, V: np.ndarray, top: np.ndarray, scene: Scene
) -> np.ndarray:
    """Volume k cut along an axis where others hide it: (m, COLUMNS); none where it is one. `top` (n,) is what shows at U, V."""
    own = volumes[k]
    low, cross = U0 + 2 * axis, U0 + 2 * (1 - axis)
    if np.isfinite(own[[OFFSET + LEVEL, OFFSET + 2 * axis, OFFSET + 2 * axis + 1]]).all():
        return volumes[:0]  # what stands on a top between two slopes is the upper part of a gambrel
    x, y = (U, V)[axis][int(own[DIRECTION])], (U, V)[1 - axis][int(own[DIRECTION])]
    seen = x[top == k]
    starts, ends, counts = runs_of(seen, scene.pitch) if len(seen) else (seen, seen, seen)
    if len(starts) < 2:
        return volumes[:0]
    within = (x >= own[low]) & (x <= own[low + 1]) & (y >= own[cross]) & (y <= own[cross + 1])
    between = within & np.any([(x > a) & (x < b) for a, b in zip(ends[:-1], starts[1:], strict=True)], axis=0)
    covers = volumes[np.unique(top[between])]
    told = in_a_row(own, covers, cross, y) or inside(own, low, cross, scene)
    if counts.min() * scene.pitch**2 < LEAST_M2 or not (told or under_one_roof(own, covers, low)):
        return volumes[:0]
    pieces = np.repeat(own[None], len(starts), axis=0)
    for n, (a, b) in enumerate(zip(starts, ends, strict=True)):
        if n > 0:
            pieces[n, low] = max(own[low], edge_near(covers, own, low, a, -COVER_M))
        if n < len(starts) - 1:
            pieces[n, low + 1] = min(own[low + 1], edge_near(covers, own, low, b, COVER_M))
    return pieces if told or all_pay(cut_apart(volumes, k, pieces), k, len(pieces), scene) else volumes[:0]


def cut_apart(volumes: np.ndarray, k: int, pieces: np.ndarray) -> np.ndarray:
    """The volumes with `pieces` (m, COLUMNS) in place of volume k."""
    return np.concatenate([volumes[:k], pieces, volumes[k + 1 :]])


def all_pay(volumes: np.ndarray, first: int, count: int, scene: Scene) -> bool:
    """Whether each of the `count` volumes from `first` on pays as one of its own."""
    value = objective(volumes, scene, np.inf)
    return all(objective(without(volumes, first + n), scene, value) == np.inf for n in range(count))


def in_a_row(own: np.ndarray, covers: np.ndarray, cross: int, y: np.ndarray) -> bool:
    """Whether what hides a volume lies along its direction and is no deeper where the outline is: at places `y` (n,) across it."""
    (low, high), ends = own[cross : cross + 2], np.clip(covers[:, cross : cross + 2], y.min(), y.max())
    deeper = (ends[:, 0] < low - IN_LINE_M) | (ends[:, 1] > high + IN_LINE_M)
    return bool((lie_along(own, covers) & ~deeper).all())


def lie_along(own: np.ndarray, covers: np.ndarray) -> np.ndarray:
    """Which of `covers` (n,) have the volume's direction; the base has none."""
    return (covers[:, DIRECTION] == own[DIRECTION]) & (covers[:, U0] > -1e3)


def inside(own: np.ndarray, low: int, cross: int, scene: Scene) -> bool:
    """Whether both ends of a volume along an axis lie inside the outline."""
    middle = 0.5 * (own[cross] + own[cross + 1])
    c, s = scene.turn[int(own[DIRECTION])]
    for end in (own[low], own[low + 1]):
        u, v = (end, middle) if low == U0 else (middle, end)
        i = round((c * u - s * v - scene.corner_u) / scene.pitch)
        j = round((s * u + c * v - scene.corner_v) / scene.pitch)
        on = 0 <= i < scene.depth.shape[0] and 0 <= j < scene.depth.shape[1]
        if not on or scene.depth[i, j] < INSIDE_M:
            return False
    return True


def under_one_roof(own: np.ndarray, covers: np.ndarray, low: int) -> bool:
    """Whether one roof hides the middle of a volume along an axis and reaches as far: a wing that crosses it would stand out."""
    reach = (covers[:, low] < own[low] + IN_LINE_M) & (covers[:, low + 1] > own[low + 1] - IN_LINE_M)
    return len(covers) == 1 and bool((lie_along(own, covers) & reach).all())


def edge_near(covers: np.ndarray, own: np.ndarray, low: int, seen_to: float, beyond: float) -> float:
    """The edge of one of `covers` near the end of what shows, or a place as far `beyond` it as hidden edges reach."""
    edges = covers[covers[:, DIRECTION] == own[DIRECTION]][:, [low, low + 1]].ravel()
    near = edges[np.abs(edges - seen_to) < NEAR_EDGE_M]
    return float(near[np.argmin(np.abs(near - seen_to))]) if len(near) else seen_to + beyond
