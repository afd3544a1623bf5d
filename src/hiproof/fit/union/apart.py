"""Split volumes that are visible in several places.

They are houses of one height on both sides of another, or dormers on both slopes. One long volume
under what stands between them explains them as well and more cheaply, but a person sees two, if
each pays by itself. A wing that crosses the main roof stays one: it stands out of it on both sides.
"""

from __future__ import annotations

import numpy as np

from .moves import remove_volume
from .objective import compute_objective
from .scene import VISIBLE_DEPTH_M, Scene, list_nodes
from .trim import COVER_M, find_runs
from .volumes import (
    DIRECTION,
    LEVEL,
    OFFSET0,
    U0,
    U1,
    UNSORTED,
    V0,
    V1,
    compute_roof_heights,
    list_movable,
)

LEAST_SHOWN_M2 = 1.0  # Least area (m2) of each of the places in which a volume is visible.
ROW_DEPTH_M = 0.5  # Difference in depth (m) within which volumes of a row are equally deep.
STRIP_M = 0.8  # A volume narrower than this (m) is a strip: dormers are wider.
NEAR_EDGE_M = 0.5  # An edge of another volume within this distance (m) is where a volume ends.
END_DEPTH_M = 0.4  # Depth (m) inside the outline at which a volume's end must be visible.


def split_volumes(volumes: np.ndarray, scene: Scene) -> np.ndarray:
    """Split each volume that is visible in several places of a row or under a roof."""
    U, V = list_nodes(scene, VISIBLE_DEPTH_M)
    heights, top = compute_roof_heights(volumes, U, V, UNSORTED)
    for k in reversed(list_movable(volumes)):
        for axis in (0, 1):
            pieces = find_pieces(volumes, k, axis, U, V, top, scene)
            if len(pieces) > 1:
                trial = insert_pieces(volumes, k, pieces)
                if np.array_equal(compute_roof_heights(trial, U, V, UNSORTED)[0], heights):
                    volumes = drop_strips(trial, k, len(pieces), scene)
                    heights, top = compute_roof_heights(volumes, U, V, UNSORTED)
                    break
    return volumes


def drop_strips(volumes: np.ndarray, first: int, count: int, scene: Scene) -> np.ndarray:
    """Drop those of `count` volumes from `first` on that are strips and do not pay.

    Their volume ran too far beyond what hides it.
    """
    value = compute_objective(volumes, scene, np.inf)
    for k in range(first + count - 1, first - 1, -1):
        wide = volumes[k, [U1, V1]] - volumes[k, [U0, V0]]
        trial = remove_volume(volumes, k)
        trial_value = compute_objective(trial, scene, value) if wide.min() < STRIP_M else np.inf
        if trial_value < np.inf:
            volumes, value = trial, trial_value
    return volumes


def find_pieces(
    volumes: np.ndarray,
    k: int,
    axis: int,
    U: np.ndarray,
    V: np.ndarray,
    top: np.ndarray,
    scene: Scene,
) -> np.ndarray:
    """Cut volume k along an axis where others hide it.

    Returns the pieces (m, COLUMNS), none if it stays one. `top` (n,) are the volumes visible at U,
    V.
    """
    row = volumes[k]
    column, cross = U0 + 2 * axis, U0 + 2 * (1 - axis)
    if np.isfinite(row[[OFFSET0 + LEVEL, OFFSET0 + 2 * axis, OFFSET0 + 2 * axis + 1]]).all():
        return volumes[:0]  # on a top between two slopes stands the upper part of a gambrel
    x, y = (U, V)[axis][int(row[DIRECTION])], (U, V)[1 - axis][int(row[DIRECTION])]
    visible = x[top == k]
    starts, ends, counts = (
        find_runs(visible, scene.pitch) if len(visible) else (visible, visible, visible)
    )
    if len(starts) < 2:
        return volumes[:0]
    is_inside = (
        (x >= row[column]) & (x <= row[column + 1]) & (y >= row[cross]) & (y <= row[cross + 1])
    )
    is_between = is_inside & np.any(
        [(x > a) & (x < b) for a, b in zip(ends[:-1], starts[1:], strict=True)], axis=0
    )
    covers = volumes[np.unique(top[is_between])]
    is_clear = is_in_row(row, covers, cross, y) or has_ends_inside(row, column, cross, scene)
    if counts.min() * scene.pitch**2 < LEAST_SHOWN_M2 or not (
        is_clear or is_under_one_roof(row, covers, column)
    ):
        return volumes[:0]
    pieces = np.repeat(row[None], len(starts), axis=0)
    for n, (a, b) in enumerate(zip(starts, ends, strict=True)):
        if n > 0:
            pieces[n, column] = max(row[column], find_near_edge(covers, row, column, a, -COVER_M))
        if n < len(starts) - 1:
            pieces[n, column + 1] = min(
                row[column + 1], find_near_edge(covers, row, column, b, COVER_M)
            )
    return (
        pieces
        if is_clear or is_each_worthwhile(insert_pieces(volumes, k, pieces), k, len(pieces), scene)
        else volumes[:0]
    )


def insert_pieces(volumes: np.ndarray, k: int, pieces: np.ndarray) -> np.ndarray:
    """Return the volumes with `pieces` (m, COLUMNS) instead of volume k."""
    return np.concatenate([volumes[:k], pieces, volumes[k + 1 :]])


def is_each_worthwhile(volumes: np.ndarray, first: int, count: int, scene: Scene) -> bool:
    """Return whether each of the `count` volumes from `first` on pays by itself."""
    value = compute_objective(volumes, scene, np.inf)
    return all(
        compute_objective(remove_volume(volumes, first + n), scene, value) == np.inf
        for n in range(count)
    )


def is_in_row(row: np.ndarray, covers: np.ndarray, cross: int, y: np.ndarray) -> bool:
    """Return whether the volumes that hide another lie in a row with it.

    They have its direction and are no deeper where the outline is: at places `y` (n,) across it.
    """
    (start, end), ends = (
        row[cross : cross + 2],
        np.clip(covers[:, cross : cross + 2], y.min(), y.max()),
    )
    deeper = (ends[:, 0] < start - ROW_DEPTH_M) | (ends[:, 1] > end + ROW_DEPTH_M)
    return bool((is_aligned(row, covers) & ~deeper).all())


def is_aligned(row: np.ndarray, covers: np.ndarray) -> np.ndarray:
    """Return which of `covers` (n,) have the volume's direction; the base has none."""
    return (covers[:, DIRECTION] == row[DIRECTION]) & (covers[:, U0] > -1e3)


def has_ends_inside(row: np.ndarray, column: int, cross: int, scene: Scene) -> bool:
    """Return whether both ends of a volume along an axis lie inside the outline."""
    middle = 0.5 * (row[cross] + row[cross + 1])
    c, s = scene.turn[int(row[DIRECTION])]
    for end in (row[column], row[column + 1]):
        u, v = (end, middle) if column == U0 else (middle, end)
        i = round((c * u - s * v - scene.corner_u) / scene.pitch)
        j = round((s * u + c * v - scene.corner_v) / scene.pitch)
        is_on_raster = 0 <= i < scene.depth.shape[0] and 0 <= j < scene.depth.shape[1]
        if not is_on_raster or scene.depth[i, j] < END_DEPTH_M:
            return False
    return True


def is_under_one_roof(row: np.ndarray, covers: np.ndarray, column: int) -> bool:
    """Return whether one roof hides the middle of a volume and reaches as far.

    A wing that crosses it would stand out.
    """
    reach = (covers[:, column] < row[column] + ROW_DEPTH_M) & (
        covers[:, column + 1] > row[column + 1] - ROW_DEPTH_M
    )
    return len(covers) == 1 and bool((is_aligned(row, covers) & reach).all())


def find_near_edge(
    covers: np.ndarray, row: np.ndarray, column: int, seen_to: float, margin: float
) -> float:
    """Return the edge of one of `covers` near the end of what is visible.

    Without one, it is a place as far `margin` beyond that end as hidden edges reach.
    """
    edges = covers[covers[:, DIRECTION] == row[DIRECTION]][:, [column, column + 1]].ravel()
    near_edges = edges[np.abs(edges - seen_to) < NEAR_EDGE_M]
    return (
        float(near_edges[np.argmin(np.abs(near_edges - seen_to))])
        if len(near_edges)
        else seen_to + margin
    )
