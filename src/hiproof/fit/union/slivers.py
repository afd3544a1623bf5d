"""Drop what is visible as a speck or a sliver.

Such are a volume of a point or two, and a plane that is a strip at its volume's edge. They are
dropped even if they explain a little of what a scanner saw of the wall there.
"""

from __future__ import annotations

import numpy as np

from .moves import refit_volumes, remove_volume
from .objective import compute_objective
from .prices import SLIVER_UNITS
from .run_on import measure_protrusion
from .scene import Scene, list_nodes
from .volumes import (
    DIRECTION,
    LEAN0,
    LEVEL,
    N_PLANES,
    N_SIDES,
    OFFSET0,
    SLOPE0,
    UNSORTED,
    compute_roof_heights,
    list_movable,
    measure_runs,
)

# Fewest points at which a volume of several is the highest: two on a wall at one height are chance.
FEWEST_SEEN = 3
NARROW_M = 0.45  # Least visible width (m) of a plane along its own fall.
SAME_STEEPNESS = 0.05  # Planes of a hip differ less in slope (rise over run).


def drop_specks(volumes: np.ndarray, scene: Scene) -> np.ndarray:
    """Drop volumes that are visible at hardly any point.

    They stay if dropping them costs more than a part would. A single volume stays, too: it is all
    there is of its roof.
    """
    specks = list_specks(volumes, scene)
    value = compute_objective(volumes, scene, np.inf) if specks else 0.0
    while specks and len(volumes) > 2:
        k = specks.pop()
        trial = remove_volume(volumes, k)
        trial, trial_value = refit_volumes(trial, scene, compute_objective(trial, scene, np.inf))
        if trial_value < value + SLIVER_UNITS * scene.evidence:
            volumes, value = trial, min(value, trial_value)
            specks = [j for j in list_specks(volumes, scene) if j < k]
    return volumes


def list_specks(volumes: np.ndarray, scene: Scene) -> list[int]:
    """List the volumes that are visible at hardly any point."""
    _, top = compute_roof_heights(volumes, scene.U, scene.V, scene.order)
    n_seen = np.bincount(top[: scene.n], minlength=len(volumes))
    return [k for k in list_movable(volumes).tolist() if n_seen[k] < FEWEST_SEEN]


def drop_slivers(volumes: np.ndarray, scene: Scene) -> np.ndarray:
    """Drop inclined planes of which only a narrow strip is visible.

    They stay if dropping them costs more than a part would.
    """
    value = compute_objective(volumes, scene, np.inf)
    U, V = list_nodes(scene)
    _, top = compute_roof_heights(volumes, U, V, UNSORTED)
    for k in list_movable(volumes):
        for plane in list_narrow_planes(volumes, k, U, V, top):
            if np.isfinite(volumes[k, OFFSET0 : OFFSET0 + N_PLANES]).sum() < 2:
                break
            trial = volumes.copy()
            trial[k, OFFSET0 + plane] = np.inf
            trial[k, [SLOPE0 + plane, LEAN0 + plane]] = 0.0
            trial, trial_value = refit_volumes(
                trial, scene, compute_objective(trial, scene, np.inf)
            )
            if trial_value < value + SLIVER_UNITS * scene.evidence and not is_hip_end(
                volumes, trial, k, plane, scene
            ):
                volumes, value = trial, min(value, trial_value)
                _, top = compute_roof_heights(volumes, U, V, UNSORTED)
    return volumes


def is_hip_end(volumes: np.ndarray, trial: np.ndarray, k: int, plane: int, scene: Scene) -> bool:
    """Return whether `plane` of volume k is the end of a hip.

    No wall stands for such a plane: it falls as others of the volume do, and ends it. `trial` are
    the volumes without it.
    """
    other_planes = [p for p in range(N_SIDES) if p != plane and volumes[k, OFFSET0 + p] < np.inf]
    as_others = (
        min(abs(volumes[k, SLOPE0 + p] - volumes[k, SLOPE0 + plane]) for p in other_planes)
        if other_planes
        else np.inf
    )
    return (
        as_others < SAME_STEEPNESS
        and measure_protrusion(trial, k, plane, scene)[0]
        > measure_protrusion(volumes, k, plane, scene)[0]
    )


def list_narrow_planes(
    volumes: np.ndarray, k: int, U: np.ndarray, V: np.ndarray, top: np.ndarray
) -> list[int]:
    """List inclined planes of volume k that are visible over a strip or nowhere.

    The strip is below NARROW_M. `top` (n,) are the volumes visible at U, V.
    """
    row, shown, direction = volumes[k], top == k, int(volumes[k, DIRECTION])
    offsets, slopes = row[OFFSET0 : OFFSET0 + N_SIDES], row[SLOPE0 : SLOPE0 + N_SIDES]
    if offsets.min() == np.inf or not shown.any():
        return []
    runs = measure_runs(row, U[direction, shown], V[direction, shown])
    heights = offsets[:, None] + slopes[:, None] * runs
    lowest = np.where(heights.min(axis=0) <= row[OFFSET0 + LEVEL], heights.argmin(axis=0), LEVEL)
    visible_runs = [runs[p, lowest == p] for p in range(N_SIDES)]
    return [
        p
        for p, run in enumerate(visible_runs)
        if offsets[p] < np.inf and (not len(run) or run.max() - run.min() < NARROW_M)
    ]
