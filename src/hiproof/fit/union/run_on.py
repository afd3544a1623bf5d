"""Move ends of volumes that stop short of a neighbour, or beyond.

A wing's ridge ends in the roof that it meets. What stands out of the neighbour at such an end is a
small triangle. It is narrower than the distance of the places at which the search samples edges,
and no points lie on it.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from ...compiled import compiled
from .objective import compute_objective
from .prices import EDGE_PRICES
from .scene import Scene
from .steps import STEP_DEPTH_M
from .trim import COVER_M
from .volumes import (
    DIRECTION,
    FREE,
    LEAN0,
    N_SIDES,
    OFFSET0,
    SLOPE0,
    TIE,
    U0,
    V0,
    compute_roof_heights,
    list_movable,
)

# Distance (m) between the places at which an end is sampled, and by which it is moved on.
END_SAMPLE_M = 0.1
LOWEST_END_M = 0.01  # An end that stands out by less (m) does not.
HIGHEST_END_M = 0.6  # An end that is higher (m) is intended.
WIDEST_END_M = 1.2  # An end that is wider (m) along the edge is intended.
FARTHEST_END_M = 1.5  # Furthest (m) that it is moved.
BESIDE_EDGE_M = 0.001  # Distance (m) of samples from the edge, on either side.


def extend_ends(volumes: np.ndarray, scene: Scene, value: float) -> tuple[np.ndarray, float]:
    """Move ends that stand out a little to where they are hidden.

    They move if that costs less than a step. Also returns the objective.
    """
    for k in list_movable(volumes):
        for edge in range(N_SIDES):
            places, highest = measure_protrusion(volumes, k, edge, scene)
            if places == 0 or places * END_SAMPLE_M > WIDEST_END_M or highest > HIGHEST_END_M:
                continue
            limit = value + EDGE_PRICES.any_step * scene.evidence
            for trial in list_end_moves(volumes, k, edge, scene):
                trial_value = compute_objective(trial, scene, limit)
                if trial_value < np.inf:
                    volumes, value = trial, trial_value
                    break
    return volumes, value


def list_end_moves(volumes: np.ndarray, k: int, edge: int, scene: Scene) -> Iterator[np.ndarray]:
    """Yield the volumes with other ends of volume k, the best first.

    An end is safely hidden, as a neighbour's, or just hidden.
    """
    # So far to either side it is hidden then: planes are fitted once more.
    yield from hide_end(volumes, k, edge, scene, COVER_M)
    yield from share_neighbour_plane(volumes, k, edge)
    yield from hide_end(volumes, k, edge, scene, 0.0)


def share_neighbour_plane(volumes: np.ndarray, k: int, edge: int) -> Iterator[np.ndarray]:
    """Yield the volumes with volume k ending like a neighbour around it.

    It slopes at this edge as the neighbour does: a hip goes through both.
    """
    outwards = 1.0 if edge % 2 else -1.0
    for other in volumes[1:]:
        further = outwards * (other[U0 + edge] - volumes[k, U0 + edge]) > 0.0
        if (
            further
            and other[DIRECTION] == volumes[k, DIRECTION]
            and other[OFFSET0 + edge] < np.inf == volumes[k, OFFSET0 + edge]
        ):
            trial = volumes.copy()
            for column in (U0 + edge, OFFSET0 + edge, SLOPE0 + edge, LEAN0 + edge):
                trial[k, column] = other[column]
            trial[k, TIE] = FREE
            yield trial


def hide_end(
    volumes: np.ndarray, k: int, edge: int, scene: Scene, cover_m: float
) -> Iterator[np.ndarray]:
    """Yield the volumes with an edge of volume k moved to where it is hidden.

    It is below the others there. It moves no further than necessary, and is below for `cover_m` to
    either side. Yields nothing if it never is.
    """
    lower, upper = volumes[k, U0 + (edge & 2)], volumes[k, U0 + (edge | 1)]
    for step, sign in product(range(1, round(FARTHEST_END_M / END_SAMPLE_M) + 1), (1.0, -1.0)):
        trial, target = volumes.copy(), volumes[k, U0 + edge] + sign * step * END_SAMPLE_M
        for place in (target - cover_m, target + cover_m, target):
            trial[k, U0 + edge] = place
            if (
                (edge % 2 == 0 and place >= upper)
                or (edge % 2 and place <= lower)
                or measure_protrusion(trial, k, edge, scene)[0]
            ):
                break
        else:
            yield trial
            return


@compiled
def measure_protrusion(volumes, k, edge, scene):
    """Count the places along an edge of volume k at which it stands out.

    They are inside the outline. Also returns by how much (m) it stands out at most.
    """
    axis, across = edge // 2, V0 - 2 * (edge // 2)
    outwards = BESIDE_EDGE_M if edge % 2 else -BESIDE_EDGE_M
    start, length = volumes[k, across], volumes[k, across + 1] - volumes[k, across]
    count = max(round(length / END_SAMPLE_M), 1) + 1
    shape = len(scene.turn), 2 * count  # inside, then outside
    U, V = np.empty(shape), np.empty(shape)
    direction = int(volumes[k, DIRECTION])
    for d in range(len(scene.turn)):
        c = (
            scene.turn[d, 0] * scene.turn[direction, 0]
            + scene.turn[d, 1] * scene.turn[direction, 1]
        )
        s = (
            scene.turn[d, 1] * scene.turn[direction, 0]
            - scene.turn[d, 0] * scene.turn[direction, 1]
        )
        for q in range(2 * count):
            x = volumes[k, U0 + edge] + (-outwards if q < count else outwards)
            y = start + length * (q % count) / (count - 1)
            u, v = (x, y) if axis == 0 else (y, x)
            U[d, q], V[d, q] = c * u + s * v, c * v - s * u
    z, top = compute_roof_heights(volumes, U, V, np.zeros((1, 2, 0), np.int64))
    places, highest = 0, 0.0
    for q in range(count):
        gap = abs(z[q] - z[count + q])
        if gap > LOWEST_END_M and top[q] == k and is_deep_inside(U[0, q], V[0, q], scene):
            places, highest = places + 1, max(highest, gap)
    return places, highest


@compiled
def is_deep_inside(u, v, scene):
    """Return whether a place lies so deep inside the outline that steps are visible.

    It is in the first direction's axes.
    """
    i, j = round((u - scene.corner_u) / scene.pitch), round((v - scene.corner_v) / scene.pitch)
    rows, columns = scene.depth.shape
    return 0 <= i < rows and 0 <= j < columns and scene.depth[i, j] >= STEP_DEPTH_M
