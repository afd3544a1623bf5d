"""Repeat volumes found once: equal dormers stand in rows.

The search pays for every volume in full, so of a row of small dormers it finds only those with
enough points. A copy of one of them is moved along its axes, and added where points suggest it.
"""

from __future__ import annotations

import numpy as np

from .moves import settle_volume
from .objective import compute_costs, compute_objective
from .prices import COPY_UNITS
from .scene import Scene, select_points
from .volumes import (
    DIRECTION,
    LEAN0,
    N_SIDES,
    OFFSET0,
    REPLACES,
    ROW_NUMBER,
    SETTLED,
    SLOPE0,
    U0,
    U1,
    V0,
    V1,
    compute_roof_heights,
    list_movable,
)

LEAST_COPY_M2 = 1.0  # Smallest volume (m2) that may stand in a row.
MOST_COPY_M2 = 16.0  # Largest volume (m2) that may stand in a row: a dormer, a bay, a box.
COPY_STEP_M = 0.2  # Distance (m) between the places tried.
COPY_REACH_M = 0.4  # Distance (m) that the edges of a copy may move.


def repeat_volumes(volumes: np.ndarray, scene: Scene) -> np.ndarray:
    """Return the volumes (k, COLUMNS) and, after them, copies of small ones.

    Copies are added where points suggest them.
    """
    for k in list_movable(volumes):
        if is_repeatable(volumes[k]):
            for axis in (0, 1):
                volumes = repeat_along(volumes, k, axis, scene)
    return volumes


def is_repeatable(volume: np.ndarray) -> bool:
    area = (volume[U1] - volume[U0]) * (volume[V1] - volume[V0])
    return bool(LEAST_COPY_M2 <= area <= MOST_COPY_M2 and not volume[REPLACES])


def repeat_along(volumes: np.ndarray, k: int, axis: int, scene: Scene) -> np.ndarray:
    """Add copies of volume k along an axis, the best first, while one saves enough."""
    y = (scene.V, scene.U)[axis][int(volumes[k, DIRECTION])]
    lower, upper = volumes[k, V0 - 2 * axis], volumes[k, V1 - 2 * axis]
    strip = select_points(scene, np.flatnonzero((lower <= y) & (y <= upper)))
    while len(strip.z) and (copy := find_copy(volumes, k, axis, strip, scene.evidence)) is not None:
        volumes = add_copy(volumes, copy, strip, scene)
    return volumes


def add_copy(volumes: np.ndarray, copy: np.ndarray, strip: Scene, scene: Scene) -> np.ndarray:
    """Add a copy, refitted and with its edges moved.

    It is added as it is if it saves too little then. So every copy saves something, and their
    number is bounded.
    """
    with_copy = np.vstack([volumes, copy])
    last = len(volumes)
    value = compute_objective(with_copy, scene, np.inf)
    settled, _ = settle_volume(with_copy, scene, value, last, COPY_REACH_M)
    saved = sum_costs(volumes, strip) - sum_costs(settled, strip)
    return settled if saved > COPY_UNITS * scene.evidence else with_copy


def compute_strip_costs(volumes: np.ndarray, strip: Scene) -> np.ndarray:
    """Return what each point and unobserved cell (n,) of a strip costs."""
    return compute_costs(compute_roof_heights(volumes, strip.U, strip.V, strip.order)[0], strip)


def sum_costs(volumes: np.ndarray, scene: Scene) -> float:
    """Sum up what all points and unobserved cells cost."""
    return float(compute_strip_costs(volumes, scene).sum())


def find_copy(
    volumes: np.ndarray, k: int, axis: int, strip: Scene, evidence: float
) -> np.ndarray | None:
    """Return the copy of volume k along an axis that saves most.

    Returns None if none saves enough. `strip` holds the points and unobserved cells that a copy may
    reach.
    """
    x = (strip.U, strip.V)[axis][int(volumes[k, DIRECTION])]
    lower, upper = volumes[k, U0 + 2 * axis : U0 + 2 * axis + 2]
    cost = compute_strip_costs(volumes, strip)
    best, most_saved = None, COPY_UNITS * evidence
    if cost.sum() <= most_saved:
        return None
    order = np.argsort(x, kind="stable")
    total, x = np.concatenate([[0.0], np.cumsum(cost[order])]), x[order]
    back = np.arange(lower - upper, x[0] - lower, -COPY_STEP_M)
    steps = np.concatenate([back, np.arange(upper - lower, x[-1] - upper, COPY_STEP_M)])
    first, last = np.searchsorted(x, lower + steps), np.searchsorted(x, upper + steps, "right")
    with_copy = np.concatenate([volumes, volumes[k : k + 1]])
    for n in np.flatnonzero(total[last] - total[first] > most_saved):
        part = select_points(strip, np.sort(order[first[n] : last[n]]))
        with_copy[-1] = copy = move_volume(volumes[k], axis, steps[n])
        cost_after = compute_strip_costs(with_copy, part).sum()
        saved = total[last[n]] - total[first[n]] - cost_after
        if saved > most_saved:
            best, most_saved = copy, saved
    return best


def move_volume(volume: np.ndarray, axis: int, step_m: float) -> np.ndarray:
    """Return a volume moved along an axis, with its planes."""
    moved = volume.copy()
    moved[[U0 + 2 * axis, U1 + 2 * axis]] += step_m
    moved[[SETTLED, ROW_NUMBER]] = 0.0
    for plane in range(N_SIDES):
        sign = 1.0 if plane % 2 == 0 else -1.0
        rise = sign if plane // 2 == axis else volume[LEAN0 + plane]
        moved[OFFSET0 + plane] -= volume[SLOPE0 + plane] * rise * step_m
    return moved
