"""From the base to a roof: volumes added where they gain most, and the first of them taken out in turn and their places grown anew."""

from __future__ import annotations

import numpy as np

from .add import (
    COME_BACK,
    ENOUGH,
    FEWEST_UNEXPLAINED,
    Ground,
    add_volumes,
    unexplained,
)
from .candidates import HOUSE, Effort, candidates_of, grids_of
from .improve import improve
from .moves import without
from .objective import objective
from .plan import MIN_STRUCTURE_POINTS, cells_of
from .prices import REGROWN_UNITS
from .scene import Scene
from .volumes import OFFSET, SIDES, SLOPE, base_only

MOST_ADDITIONS = 20  # tried for one building: a bound on time
BASE_QUANTILE = 0.02  # of the heights at which the base lies: below all roofs but not below a stray point
MOST_SLOPES = 5  # slopes tried for new ends and ties; they cover what the candidates have
# of all moves: before a place is grown anew, where no candidate helps, at the end
STARTING_ROUNDS, STUCK_ROUNDS, FINAL_ROUNDS = 2, 2, 3


def grow(scene: Scene, effort: Effort = HOUSE) -> tuple[np.ndarray, float]:
    """Volumes (k, COLUMNS) and their objective: grown from the base, then each taken out in turn and its place grown anew."""
    quantile = BASE_QUANTILE if scene.n >= MIN_STRUCTURE_POINTS else 0.5
    base = base_only(float(np.quantile(scene.z[: scene.n], quantile, method="lower")))
    candidates = candidates_of(scene, np.arange(scene.n), effort.planes, effort)
    ground = ground_of(scene, candidates)
    volumes, value = grown(base, objective(base, scene, np.inf), ground, candidates, effort)
    return regrown(volumes, value, ground, candidates, effort)


def ground_of(scene: Scene, candidates: np.ndarray) -> Ground:
    """The ground that a scene and the first candidates give."""
    grids = grids_of(scene)
    cell_u = np.array([cells_of(grid.u, u) for grid, u in zip(grids, scene.U, strict=True)])
    cell_v = np.array([cells_of(grid.v, v) for grid, v in zip(grids, scene.V, strict=True)])
    return Ground(scene, cell_u, cell_v, typical_slopes(candidates))


def regrown(
    volumes: np.ndarray, value: float, ground: Ground, candidates: np.ndarray, effort: Effort = HOUSE
) -> tuple[np.ndarray, float]:
    """The volumes with each of the first in turn taken out and what is missing grown anew, where that is clearly better.

    The volume that gains most by itself comes first, and what follows is fitted in around it: two hips of one pitch begin as one
    volume over both. Without it the others take the places that are theirs.
    """
    k, scene = min(len(volumes) - 1, effort.regrown), ground.scene
    while k > 0 and len(volumes) > 2:
        trial = without(volumes, k)
        trial, found = improve(trial, scene, objective(trial, scene, np.inf), ground.slopes, STARTING_ROUNDS)
        trial, found = grown(trial, found, ground, candidates, effort, (len(volumes), value))
        if found < value - REGROWN_UNITS * scene.evidence:
            volumes, value = trial, found
        k = min(k, len(volumes)) - 1
    return volumes, value


def grown(
    volumes: np.ndarray,
    value: float,
    ground: Ground,
    candidates: np.ndarray,
    effort: Effort,
    known: tuple[int, float] = (0, 0.0),
) -> tuple[np.ndarray, float]:
    """The volumes with more of them added, first of the `candidates`, then of what the points left unexplained speak for, as long as
    that pays, or until there are as many as in a `known` roof for as much."""
    scene, left, fresh = ground.scene, MOST_ADDITIONS, False
    while left > 0:
        before = left
        volumes, value, end, left = add_volumes(volumes, value, ground, candidates, left, *known)
        if end == COME_BACK:
            return volumes, value
        if end == ENOUGH or (fresh and left == before - 1):
            break
        volumes, value = improve(volumes, scene, value, ground.slopes, STUCK_ROUNDS)
        far = unexplained(volumes, scene)
        if len(far) < FEWEST_UNEXPLAINED:
            break
        candidates, fresh = candidates_of(scene, far, effort.new_planes, effort), True
    return improve(volumes, scene, value, ground.slopes, FINAL_ROUNDS)


def typical_slopes(candidates: np.ndarray) -> np.ndarray:
    """At most MOST_SLOPES slopes (m,) of the candidates, spread over all that they have."""
    slopes = candidates[:, SLOPE : SLOPE + SIDES][np.isfinite(candidates[:, OFFSET : OFFSET + SIDES])]
    slopes = np.unique(np.round(slopes, 2))
    return (
        slopes[np.linspace(0, len(slopes) - 1, MOST_SLOPES).round().astype(int)]
        if len(slopes) > MOST_SLOPES
        else slopes
    )
