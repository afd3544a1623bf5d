"""Put planes back that rise above other volumes.

They are those of the search. They return where the others explain the points better.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from .finish import Planes, read_volume_planes
from .objective import compute_misfits
from .planes import find_lowest_row
from .scene import Scene
from .volumes import (
    DIRECTION,
    REPLACES,
    compute_roof_heights,
    find_strip,
    is_within,
    read_rectangle,
)

RISEN_SHARE = 0.1  # Share by which the points of one volume may cost more under its fitted planes.


def measure_misfits(
    volumes: np.ndarray, planes: list[Planes], scene: Scene
) -> tuple[np.ndarray, np.ndarray]:
    """Return what each point costs under `planes`, and the volume visible there.

    Both are arrays (n,).
    """
    rows = np.full((len(planes), max(len(fitted.rows) for fitted in planes), 3), np.nan)
    for volume_rows, fitted in zip(rows, planes, strict=True):
        volume_rows[: len(fitted.rows)] = fitted.rows
    heights, top = compute_plane_heights(volumes, rows, scene.U, scene.V, scene.order)
    return compute_misfits(scene.z[: scene.n], heights[: scene.n], scene), top[: scene.n]


@compiled
def compute_plane_heights(volumes, rows, U, V, order):
    """Return the heights (n,) of volumes with planes `rows` (k, m, 3).

    Also returns which is visible (n,). U, V (directions, n) and `order` are those of a scene.
    """
    n = U.shape[1]
    z, top = np.full(n, -np.inf), np.zeros(n, np.int64)
    for k in range(len(volumes)):
        direction, ends = int(volumes[k, DIRECTION]), read_rectangle(volumes, k)
        axis, first, last = find_strip(volumes, k, U, V, order)
        for q in range(first, last):
            i = order[direction, axis, q] if last - first < n else q
            if is_within(ends, U[direction, i], V[direction, i]):
                h, _ = find_lowest_row(rows[k], U[direction, i], V[direction, i])
                if volumes[k, REPLACES] > 0.0 or h > z[i]:
                    z[i], top[i] = h, k
    return z, top


def restore_risen_planes(
    volumes: np.ndarray, planes: list[Planes], scene: Scene
) -> tuple[list[Planes], np.ndarray]:
    """Return the planes, as the search left them where a volume rises above others.

    Planes are fitted to the points over which their volume is visible. Where it is hidden, such as
    one of two gables of nearly the same slopes, they may come out above the other and fit less.
    They go back where points that others explained cost a unit more, or where all points cost more
    by RISEN_SHARE. Also returns what each point costs (n,).
    """
    planes, risen = list(planes), np.zeros(len(planes), bool)
    heights, visible = compute_roof_heights(volumes, scene.U, scene.V, scene.order)
    search_misfits = compute_misfits(scene.z[: scene.n], heights[: scene.n], scene)
    while True:
        misfits, top = measure_misfits(volumes, planes, scene)
        extra = misfits - search_misfits
        over_others = np.bincount(top, extra * (top != visible[: scene.n]), len(planes))
        over_all = np.bincount(top, extra - RISEN_SHARE, len(planes))
        excess = np.maximum(over_others - scene.evidence, over_all)
        excess[risen] = 0.0
        k = int(np.argmax(excess))
        if excess[k] <= 0.0:
            return planes, misfits
        planes[k], risen[k] = read_volume_planes(volumes[k], scene), True
