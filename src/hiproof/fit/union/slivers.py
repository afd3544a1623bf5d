"""What shows as a speck or a sliver goes, however well it explains what a scanner saw of the wall there.

That is a volume of a point or two, and a plane that is a strip at its volume's edge.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from .moves import refit_each, without
from .objective import objective
from .prices import SLIVER_UNITS
from .run_on import stands_out
from .scene import Scene, nodes
from .volumes import (
    DIRECTION,
    LEAN,
    LEVEL,
    OFFSET,
    PLANES,
    SIDES,
    SLOPE,
    coefficients,
    distance_up,
    lowest_plane,
    roof_heights,
)

FEWEST_SEEN = 3  # points over which a volume of several is the highest: two on a wall at one height are chance
NARROW_M = 0.45  # what shows of a plane is as wide at least, along its own fall
ALIKE = 0.05  # rise over run; planes of a hip are equally steep


def without_specks(volumes: np.ndarray, scene: Scene) -> np.ndarray:
    """The volumes without those that hardly any point shows, the fewest first. One alone is all there is of its roof."""
    while len(volumes) > 2:
        _, top = roof_heights(volumes, scene.U, scene.V)
        seen = np.bincount(top[: scene.n], minlength=len(volumes))[1:]
        if seen.min() >= FEWEST_SEEN:
            break
        trial = without(volumes, 1 + int(np.argmin(seen)))
        volumes, _ = refit_each(trial, scene, objective(trial, scene, np.inf))
    return volumes


def without_slivers(volumes: np.ndarray, scene: Scene) -> np.ndarray:
    """The volumes without inclined planes of which only a narrow strip shows, where that costs no more than a part would."""
    value = objective(volumes, scene, np.inf)
    U, V = nodes(scene)
    _, top = roof_heights(volumes, U, V)
    for k in range(1, len(volumes)):
        for plane in narrow_planes(volumes, k, U, V, top):
            if np.isfinite(volumes[k, OFFSET : OFFSET + PLANES]).sum() < 2:
                break
            trial = volumes.copy()
            trial[k, OFFSET + plane] = np.inf
            trial[k, [SLOPE + plane, LEAN + plane]] = 0.0
            trial, found = refit_each(trial, scene, objective(trial, scene, np.inf))
            if found < value + SLIVER_UNITS * scene.evidence and not opens_a_hip(volumes, trial, k, plane, scene):
                volumes, value = trial, min(value, found)
                _, top = roof_heights(volumes, U, V)
    return volumes


def opens_a_hip(volumes: np.ndarray, trial: np.ndarray, k: int, plane: int, scene: Scene) -> bool:
    """Whether `plane`, without which volume k is a `trial`, falls as others of the volume do and ends it: no wall does."""
    others = [p for p in range(SIDES) if p != plane and volumes[k, OFFSET + p] < np.inf]
    as_others = min(abs(volumes[k, SLOPE + p] - volumes[k, SLOPE + plane]) for p in others) if others else np.inf
    return as_others < ALIKE and stands_out(trial, k, plane, scene)[0] > stands_out(volumes, k, plane, scene)[0]


def narrow_planes(volumes: np.ndarray, k: int, U: np.ndarray, V: np.ndarray, top: np.ndarray) -> list[int]:
    """Inclined planes of volume k that show nowhere, or over a strip narrower than NARROW_M; `top` (n,) is what shows at U, V."""
    if not (top == k).any():
        return []
    widths = widths_of_planes(volumes, k, U, V, top)
    return [p for p in range(SIDES) if volumes[k, OFFSET + p] < np.inf and widths[p] < NARROW_M]


@compiled
def widths_of_planes(volumes, k, U, V, top):
    """How wide, along its own fall, each inclined plane (4,) of volume k shows at those of U, V (directions, n) where it is the `top`."""
    u, v, c = U[int(volumes[k, DIRECTION])], V[int(volumes[k, DIRECTION])], coefficients(volumes, k)
    low, high = np.full(SIDES, np.inf), np.full(SIDES, -np.inf)
    for i in range(len(top)):
        if top[i] == k:
            _, plane = lowest_plane(c, u[i], v[i])
            if plane < LEVEL:
                x = distance_up(volumes[k], plane, u[i], v[i])
                low[plane], high[plane] = min(low[plane], x), max(high[plane], x)
    return np.maximum(high - low, 0.0)
