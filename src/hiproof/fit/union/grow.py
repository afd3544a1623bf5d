"""From the base to a roof: volumes added one by one where they gain most, all of them improved after each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...compiled import compiled
from .candidates import best_rectangles, candidates_of
from .edges import EVERYWHERE, LEAST_GAIN, MIN_SIDE_M, move_edges
from .improve import improve
from .moves import without
from .objective import costs, objective
from .plan import MIN_STRUCTURE_POINTS, Plan, cells_of
from .planes import Grid
from .refit import refit
from .scene import Scene
from .volumes import DIRECTION, LEAN, OFFSET, REPLACES, SIDES, SLOPE, U0, U1, V0, V1, base_only, roof_heights

MOST_VOLUMES, MOST_ADDITIONS = 24, 20  # of one building, and additions tried: a bound on time
MOST_PLANES, MOST_NEW_PLANES = 16, 10  # candidate planes from all points at first, from unexplained ones later
TRIED_EACH_WAY = 2  # candidates of the largest gain that are tried in earnest
# of the highest misfit, from which on a point counts as unexplained; points worth a further volume
UNEXPLAINED, FEWEST_UNEXPLAINED = 0.98, 4
# of the highest misfit, from which on points count in a roof that leaves none unexplained but costs so many units: the base half way up a
# skirt lies within a quarter of a metre of it all
POORLY, WORTH_UNITS = 0.3, 5.0
BASE_QUANTILE = 0.02  # of the heights at which the base lies: below all roofs but not below a stray point
MOST_SLOPES = 5  # slopes tried for new ends and ties; they cover what the candidates have
FINAL_ROUNDS = 3  # of all moves at the end
STARTING_ROUNDS, REGROWN_UNITS = 2, 0.5  # less is gained by cutting finer, too
# roofs of as many volumes that cost so nearly the same are one; one whose last volume is not yet fitted in may cost so much more
SAME_UNITS, SAME_BEFORE_UNITS = 0.1, 2.0
MOST_REGROWN = 3  # volumes, those that grew first: of 40 that were better anew none had grown later
HOPELESS_AT_FIRST, HOPELESS_ONCE_MOVED = 6.0, 1.0  # units above the best: of 334 best additions 324 are still found
FREELY_UNITS = 8.0  # units that a new volume must gain besides, where a plane faces neither along an axis nor a wall
ALONG_WALL = 1e-6  # of a lean; numerically the same
CUT_LEAST_M, CUT_MOST_SHARE = 0.3, 0.6  # how much a neighbour may be cut back for a new volume


class Ground(NamedTuple):
    """What volumes grow on: the scene, the grid of each direction, in which cells (directions, n + g) along u and v the points and
    ghosts lie, and the slopes (m,) to try for a further plane."""

    scene: Scene
    grids: list[Grid]
    cell_u: np.ndarray
    cell_v: np.ndarray
    slopes: np.ndarray


def grow(scene: Scene, grids: list[Grid]) -> tuple[np.ndarray, float]:
    """Volumes (k, COLUMNS) and their objective: grown from the base, then each taken out in turn and its place grown anew."""
    quantile = BASE_QUANTILE if scene.n >= MIN_STRUCTURE_POINTS else 0.5
    base = base_only(float(np.quantile(scene.z[: scene.n], quantile, method="lower")))
    candidates = candidates_of(scene, np.arange(scene.n), grids, MOST_PLANES)
    ground = ground_of(scene, grids, candidates)
    volumes, value = grown(base, objective(base, scene, np.inf), ground, candidates)
    return regrown(volumes, value, ground, candidates)


def ground_of(scene: Scene, grids: list[Grid], candidates: np.ndarray) -> Ground:
    """The ground that a scene and the first candidates give."""
    cell_u = np.array([cells_of(grid.u, u) for grid, u in zip(grids, scene.U, strict=True)])
    cell_v = np.array([cells_of(grid.v, v) for grid, v in zip(grids, scene.V, strict=True)])
    return Ground(scene, grids, cell_u, cell_v, typical_slopes(candidates))


def regrown(volumes: np.ndarray, value: float, ground: Ground, candidates: np.ndarray) -> tuple[np.ndarray, float]:
    """The volumes with each of the first in turn taken out and what is missing grown anew, where that is clearly better.

    The volume that gains most by itself comes first, and what follows is fitted in around it: two hips of one pitch begin as one
    volume over both. Without it the others take the places that are theirs.
    """
    k, scene = min(len(volumes) - 1, MOST_REGROWN), ground.scene
    while k > 0 and len(volumes) > 2:
        trial = without(volumes, k)
        trial, found = improve(trial, scene, objective(trial, scene, np.inf), ground.slopes, STARTING_ROUNDS)
        trial, found = grown(trial, found, ground, candidates, (len(volumes), value))
        if found < value - REGROWN_UNITS * scene.evidence:
            volumes, value = trial, found
        k = min(k, len(volumes)) - 1
    return volumes, value


def grown(
    volumes: np.ndarray, value: float, ground: Ground, candidates: np.ndarray, known: tuple[int, float] | None = None
) -> tuple[np.ndarray, float]:
    """The volumes with more of them added one by one, as long as that pays, or until there are as many as in a `known` roof for
    as much: nothing can be added to that one, and it has come back."""
    scene, fresh = ground.scene, False
    for _ in range(MOST_ADDITIONS):
        far = unexplained(volumes, scene)
        if len(far) < FEWEST_UNEXPLAINED or len(volumes) >= MOST_VOLUMES:
            break
        found = best_addition(volumes, value, ground, candidates)
        if found is not None:
            if has_come_back(*found, known, scene, SAME_BEFORE_UNITS):
                return found
            (volumes, value), fresh = improve(found[0], scene, found[1], ground.slopes, 1), False
            if has_come_back(volumes, value, known, scene, SAME_UNITS):
                return volumes, value
        elif fresh:
            break
        else:
            volumes, value = improve(volumes, scene, value, ground.slopes, 2)
            far = unexplained(volumes, scene)
            if len(far) < FEWEST_UNEXPLAINED:
                break
            candidates, fresh = candidates_of(scene, far, ground.grids, MOST_NEW_PLANES), True
    return improve(volumes, scene, value, ground.slopes, FINAL_ROUNDS)


def has_come_back(
    volumes: np.ndarray, value: float, known: tuple[int, float] | None, scene: Scene, more_units: float
) -> bool:
    """Whether a `known` roof has as many volumes and costs as much, but for the `more_units` that fitting may still gain."""
    if known is None or len(volumes) != known[0]:
        return False
    return -min(more_units, REGROWN_UNITS) < (value - known[1]) / scene.evidence < more_units


def unexplained(volumes: np.ndarray, scene: Scene) -> np.ndarray:
    """Points (m,) that the roof leaves unexplained; where there are none, those that it explains poorly if that is dear."""
    z, _ = roof_heights(volumes, scene.U, scene.V)
    cost = costs(z, scene)[: scene.n]
    far = np.nonzero(cost > UNEXPLAINED)[0]
    if len(far) < FEWEST_UNEXPLAINED and cost.sum() > WORTH_UNITS * scene.evidence:
        return np.nonzero(cost > POORLY)[0]
    return far


def typical_slopes(candidates: np.ndarray) -> np.ndarray:
    """At most MOST_SLOPES slopes (m,) of the candidates, spread over all that they have."""
    slopes = candidates[:, SLOPE : SLOPE + SIDES][np.isfinite(candidates[:, OFFSET : OFFSET + SIDES])]
    slopes = np.unique(np.round(slopes, 2))
    return (
        slopes[np.linspace(0, len(slopes) - 1, MOST_SLOPES).round().astype(int)]
        if len(slopes) > MOST_SLOPES
        else slopes
    )


def grids_of(plan: Plan, scene: Scene) -> list[Grid]:
    """A grid of cells for each direction."""
    grids = [plan.grid]
    for lines in scene.lines[1:]:
        u, v = (axis[np.isfinite(axis)] for axis in lines)
        grids.append(Grid(u, v))
    return grids


def best_addition(
    volumes: np.ndarray, value: float, ground: Ground, candidates: np.ndarray
) -> tuple[np.ndarray, float] | None:
    """The volumes with the one more that lowers the objective most, and that objective; None where none does."""
    if len(candidates) == 0:
        return None
    scene, grids = ground.scene, ground.grids
    z_now, _ = roof_heights(volumes, scene.U, scene.V)
    cost_now = costs(z_now, scene)
    shape = np.array([(len(grid.u) - 1, len(grid.v) - 1) for grid in grids])
    best = None
    for replacing in (False, True):
        gains, cells = best_rectangles(
            scene, candidates, ground.cell_u, ground.cell_v, shape, cost_now, z_now, replacing
        )
        for m in np.argsort(-gains, kind="stable")[:TRIED_EACH_WAY]:
            if not gains[m] > 0.0:
                break
            volume, grid = candidates[m].copy(), grids[int(candidates[m, DIRECTION])]
            (i0, i1), (j0, j1) = cells[m, :2], cells[m, 2:]
            volume[U0 : V1 + 1] = grid.u[i0], grid.u[i1], grid.v[j0], grid.v[j1]
            least = FREELY_UNITS * scene.evidence if leans_freely(volume, scene) else 0.0
            for trial in ways_in(volumes, volume, replacing and len(volumes) > 1):
                trial, found = inserted(trial, scene, (value if best is None else best[1]) - least)
                if found < np.inf:
                    best = trial, found
    return best


def leans_freely(volume: np.ndarray, scene: Scene) -> bool:
    """Whether a plane of the volume faces neither along an axis nor a wall."""
    walls = scene.leans[int(volume[DIRECTION])]
    lean = np.abs(volume[LEAN : LEAN + SIDES].reshape(2, 2))
    return any(x > 0.0 and np.abs(np.abs(walls[axis]) - x).min() > ALONG_WALL for axis in (0, 1) for x in lean[axis])


def ways_in(volumes: np.ndarray, volume: np.ndarray, replacing: bool) -> list[np.ndarray]:
    """The volumes with one more: in the max, or replacing what it covers, or with a neighbour cut back to where it begins."""
    joined = np.vstack([volumes, volume])
    if not replacing:
        return [joined]
    replaced = joined.copy()
    replaced[-1, REPLACES] = 1.0
    ways = [replaced]
    for j in range(1, len(volumes)):
        if volumes[j, DIRECTION] != volume[DIRECTION] or not overlap(volumes[j], volume):
            continue
        for edge in range(4):
            low, high = volumes[j, U0 + (edge & 2)], volumes[j, U1 + (edge & 2)]
            stop = volume[U0 + (edge ^ 1)]
            over = stop - low if edge % 2 == 0 else high - stop
            if CUT_LEAST_M < over < CUT_MOST_SHARE * (high - low) and high - low - over >= MIN_SIDE_M:
                cut = joined.copy()
                cut[j, U0 + edge] = stop
                ways.append(cut)
    return ways


def overlap(one: np.ndarray, other: np.ndarray) -> bool:
    low = np.maximum(one[[U0, V0]], other[[U0, V0]])
    high = np.minimum(one[[U1, V1]], other[[U1, V1]])
    return bool((high - low > CUT_LEAST_M).all())


@compiled
def inserted(volumes, scene, value):
    """Volumes whose last one is new, that one fitted and its edges moved twice; infinite where that is not below `value`.

    One that begins too far above `value` to come below it is given up.
    """
    k, found = len(volumes) - 1, np.inf
    for units in HOPELESS_AT_FIRST, HOPELESS_ONCE_MOVED:
        refit(volumes, scene, k)
        found = objective(volumes, scene, value + units * scene.evidence)
        if found == np.inf:
            break
        found = move_edges(volumes, scene, k, found, EVERYWHERE)
    return volumes, found if found < value - LEAST_GAIN else np.inf
