"""Grow a roof from its base.

Volumes are added where they gain most. Then the first of them is taken out, and its place is grown
anew.
"""

from __future__ import annotations

import numpy as np

from ..prices import REGROWN_UNITS
from .add import (
    FEWEST_UNEXPLAINED,
    NOTHING_LEFT,
    GrowthGrid,
    add_candidates,
    find_unexplained,
)
from .candidates import (
    MOST_NEW_PLANES,
    MOST_PLANES,
    list_candidates,
    make_grids,
)
from .improve import improve
from .moves import MOST_TYPICAL_SLOPES, remove_volume
from .objective import compute_objective
from .plan import find_cells
from .scene import Scene
from .volumes import N_SIDES, OFFSET0, SLOPE0, make_base

MOST_ADDITIONS = 20  # Most additions tried for one building: a limit on time.
# Quantile of the heights at which the base lies: below all roofs but not below a stray point.
BASE_QUANTILE = 0.02
IMPROVING_ROUNDS = 2  # Most rounds of all moves where no volume is added.


def grow(scene: Scene) -> tuple[np.ndarray, float]:
    """Grow volumes (k, COLUMNS) from the base, and regrow the first one.

    Also returns their objective.
    """
    place = int(BASE_QUANTILE * (scene.n - 1))
    base = make_base(float(np.partition(scene.z[: scene.n], place)[place]))
    candidates = list_candidates(scene, np.arange(scene.n), MOST_PLANES)
    ground = prepare_growth(scene, candidates)
    volumes, value = grow_volumes(base, compute_objective(base, scene), ground, candidates)
    return regrow_volumes(volumes, value, ground, candidates)


def prepare_growth(scene: Scene, candidates: np.ndarray) -> GrowthGrid:
    """Return the growth grid of a scene and its first candidates."""
    grids = make_grids(scene)
    cell_u = np.array([find_cells(grid.u, u) for grid, u in zip(grids, scene.U, strict=True)])
    cell_v = np.array([find_cells(grid.v, v) for grid, v in zip(grids, scene.V, strict=True)])
    return GrowthGrid(scene, cell_u, cell_v, select_typical_slopes(candidates))


def regrow_volumes(
    volumes: np.ndarray, value: float, ground: GrowthGrid, candidates: np.ndarray
) -> tuple[np.ndarray, float]:
    """Take out the first volume, and grow anew what is missing.

    The change is kept if it is clearly better. The volume that gains most by itself comes first,
    and what follows fits in around it: two hips of one pitch begin as one volume over both. Without
    it, the others take their own places.
    """
    if len(volumes) < 3:
        return volumes, value
    trial, scene = remove_volume(volumes, 1), ground.scene
    trial, trial_value = improve(
        trial, scene, compute_objective(trial, scene), ground.slopes, IMPROVING_ROUNDS
    )
    trial, trial_value = grow_volumes(trial, trial_value, ground, candidates)
    is_better = trial_value < value - REGROWN_UNITS * scene.unit
    return (trial, trial_value) if is_better else (volumes, value)


def grow_volumes(
    volumes: np.ndarray,
    value: float,
    ground: GrowthGrid,
    candidates: np.ndarray,
) -> tuple[np.ndarray, float]:
    """Add volumes as long as that pays, and improve them.

    They are first those of the `candidates`, then those that the unexplained points suggest.
    """
    scene, remaining, is_new = ground.scene, MOST_ADDITIONS, False
    while remaining > 0:
        n_before = remaining
        volumes, value, end, remaining = add_candidates(
            volumes, value, ground, candidates, remaining
        )
        if end == NOTHING_LEFT or (is_new and remaining == n_before - 1):
            break
        volumes, value = improve(volumes, scene, value, ground.slopes, IMPROVING_ROUNDS)
        unexplained_points = find_unexplained(volumes, scene)
        if len(unexplained_points) < FEWEST_UNEXPLAINED:
            break
        candidates, is_new = (
            list_candidates(scene, unexplained_points, MOST_NEW_PLANES),
            True,
        )
    return improve(volumes, scene, value, ground.slopes, IMPROVING_ROUNDS)


def select_typical_slopes(candidates: np.ndarray) -> np.ndarray:
    """Select at most MOST_TYPICAL_SLOPES slopes (m,), spread over the candidates' own."""
    slopes = candidates[:, SLOPE0 : SLOPE0 + N_SIDES][
        np.isfinite(candidates[:, OFFSET0 : OFFSET0 + N_SIDES])
    ]
    slopes = np.unique(np.round(slopes, 2))
    return (
        slopes[np.linspace(0, len(slopes) - 1, MOST_TYPICAL_SLOPES).round().astype(int)]
        if len(slopes) > MOST_TYPICAL_SLOPES
        else slopes
    )
