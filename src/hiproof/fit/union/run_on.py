"""Volumes that end a little short of where they die in a neighbour, or a little beyond, end there: a wing's ridge ends in the roof it meets.

What stands out of the neighbour at such an end is a small triangle, narrower than the places at which the search looks at edges lie
apart, and no points tell.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from ...compiled import compiled
from .objective import compute_objective
from .scene import Scene
from .steps import STEP_DEPTH_M
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
)

END_SAMPLE_M, MOST_END_SAMPLES = (
    0.1,
    400,
)  # m between the places at which an end is looked at, and how many at most
LOWEST_END_M, HIGHEST_END_M, WIDEST_END_M = (
    0.01,
    0.6,
    1.2,
)  # an end that stands out; by more, in height or along the edge, it is meant
END_STEP_M, FARTHEST_END_M = 0.1, 1.5  # m by which it is moved on, and how far at most
COVER_M = 0.25  # m to either side that it lies hidden then: planes are fitted once more
BESIDE_EDGE_M = 0.001  # m from the edge, on either side


def extend_ends(volumes: np.ndarray, scene: Scene, value: float) -> tuple[np.ndarray, float]:
    """The volumes with ends that stand out a little moved to where they lie hidden, where that costs less than a step; the objective."""
    for k in range(1, len(volumes)):
        for edge in range(N_SIDES):
            places, highest = measure_protrusion(volumes, k, edge, scene)
            if places == 0 or places * END_SAMPLE_M > WIDEST_END_M or highest > HIGHEST_END_M:
                continue
            limit = value + scene.edge_prices.any_step * scene.evidence
            for trial in list_end_moves(volumes, k, edge, scene):
                trial_value = compute_objective(trial, scene, limit)
                if trial_value < np.inf:
                    volumes, value = trial, trial_value
                    break
    return volumes, value


def list_end_moves(volumes: np.ndarray, k: int, edge: int, scene: Scene) -> Iterator[np.ndarray]:
    """The volumes with other ends of volume k, the best first: safely hidden, as a neighbour's, or just hidden."""
    yield from hide_end(volumes, k, edge, scene, COVER_M)
    yield from share_neighbour_plane(volumes, k, edge)
    yield from hide_end(volumes, k, edge, scene, 0.0)


def share_neighbour_plane(volumes: np.ndarray, k: int, edge: int) -> Iterator[np.ndarray]:
    """The volumes with volume k sloping at an edge as one does that lies around it there, and ending where that does: a hip goes through
    both."""
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
    """The volumes with an edge of volume k moved, no further than it must be, to where it is below the others, and `cover_m` to either
    side; none where it never is."""
    lower, upper = volumes[k, U0 + (edge & 2)], volumes[k, U0 + (edge | 1)]
    for step, sign in product(range(1, round(FARTHEST_END_M / END_STEP_M) + 1), (1.0, -1.0)):
        trial, target = volumes.copy(), volumes[k, U0 + edge] + sign * step * END_STEP_M
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
    """At how many places along an edge of volume k, inside the outline, it stands out there, and by how much (m) at most."""
    axis, across = edge // 2, V0 - 2 * (edge // 2)
    outwards = BESIDE_EDGE_M if edge % 2 else -BESIDE_EDGE_M
    start, length = volumes[k, across], volumes[k, across + 1] - volumes[k, across]
    count = min(max(round(length / END_SAMPLE_M), 1), MOST_END_SAMPLES) + 1
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
    z, top = compute_roof_heights(volumes, U, V)
    places, highest = 0, 0.0
    for q in range(count):
        gap = abs(z[q] - z[count + q])
        if gap > LOWEST_END_M and top[q] == k and is_deep_inside(U[0, q], V[0, q], scene):
            places, highest = places + 1, max(highest, gap)
    return places, highest


@compiled
def is_deep_inside(u, v, scene):
    """Whether a place in the first direction's axes lies so far inside the outline that steps show there."""
    i, j = round((u - scene.corner_u) / scene.pitch), round((v - scene.corner_v) / scene.pitch)
    rows, columns = scene.depth.shape
    return 0 <= i < rows and 0 <= j < columns and scene.depth[i, j] >= STEP_DEPTH_M
