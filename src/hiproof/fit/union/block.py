"""Search one block of a large roof as a house, and add its volumes to the roof."""

from __future__ import annotations

import numpy as np

from .box import Box
from .candidates import Effort
from .edges import SETTLE_REACH_M
from .grow import grow
from .moves import refit_volumes, settle_volume
from .objective import BASE_SHARE, compute_objective
from .scene import Scene
from .volumes import U0, V1, compute_roof_heights
from .whole import Whole
from .window import end_at_border, forget_digests, open_window

# Points of a block in which structure is searched: 2.7 per square metre of the largest block. With
# a house's 600 points, dormers and annexes of blocks stay unseen.
BLOCK_POINTS = 1600
# Points of a block that settle its structure: 5 per square metre of the largest block.
SETTLE_POINTS = 3000
# Growing more than one volume anew gains nothing in blocks and costs a quarter of the time
# (Vienna's even places at 5 points/m2).
BLOCK = Effort(pool_points=1200, seeds=200, regrown=1)


def search_block(whole: Whole, box: Box) -> None:
    """Add the volumes of a block to the roof, none if it holds hardly a point."""
    volumes, settling = find_in_block(whole, box)
    if settling is None:
        return
    rows = volumes[1:]
    if is_base_bare(volumes, settling):
        base = volumes[:1].copy()
        base[0, U0 : V1 + 1] = box
        rows = np.concatenate([base, rows])
    whole.replace([], forget_digests(end_at_border(whole, rows.copy(), box)))


def find_in_block(whole: Whole, box: Box) -> tuple[np.ndarray, Scene | None]:
    """Find the volumes of a block by itself, its own base first.

    Also returns the scene that settled them, None for hardly a point.
    """
    scene, settling = open_window(whole, box, BLOCK_POINTS), open_window(whole, box, SETTLE_POINTS)
    if scene is None or settling is None:
        return whole.volumes, None
    volumes, _ = grow(scene, BLOCK)
    return settle_volumes(volumes, settling)[0], settling


def settle_volumes(volumes: np.ndarray, scene: Scene) -> tuple[np.ndarray, float]:
    """Refit the volumes and move their edges a little on every point of `scene`."""
    volumes, value = refit_volumes(volumes, scene, compute_objective(volumes, scene, np.inf))
    for k in range(1, len(volumes)):
        volumes, value = settle_volume(volumes, scene, value, k, SETTLE_REACH_M)
    return volumes, value


def is_base_bare(volumes: np.ndarray, scene: Scene) -> bool:
    """Return whether so much of the base is visible that it becomes a level volume."""
    _, top = compute_roof_heights(volumes, scene.U, scene.V, scene.order)
    cells = scene.weight[scene.n :][top[scene.n :] == 0].sum()
    return bool(max(cells, 0.5 * (top[: scene.n] == 0).sum()) > BASE_SHARE * scene.n)
