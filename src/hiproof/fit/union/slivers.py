"""What shows as a speck or a sliver goes, however well it explains what a scanner saw of the wall there.

That is a volume of a point or two, and a plane that is a strip at its volume's edge.
"""

from __future__ import annotations

import numpy as np

from .moves import refit_each, without
from .objective import objective
from .scene import Scene, nodes
from .volumes import DIRECTION, LEAN, OFFSET, PLANES, SIDES, SLOPE, distances_up, roof_heights

FEWEST_SEEN = 3  # points over which a volume of several is the highest: two on a wall at one height are chance
NARROW_M = 0.45  # what shows of a plane is as wide at least, along its own fall
DEAREST_UNITS = 3.0  # what leaving a plane out may cost


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
        direction, seen = int(volumes[k, DIRECTION]), top == k
        for plane in narrow_planes(volumes[k], U[direction, seen], V[direction, seen]):
            if np.isfinite(volumes[k, OFFSET : OFFSET + PLANES]).sum() < 2:
                break
            trial = volumes.copy()
            trial[k, OFFSET + plane] = np.inf
            trial[k, [SLOPE + plane, LEAN + plane]] = 0.0
            trial, found = refit_each(trial, scene, objective(trial, scene, np.inf))
            if found < value + DEAREST_UNITS * scene.evidence:
                volumes, value = trial, min(value, found)
                _, top = roof_heights(volumes, U, V)
    return volumes


def narrow_planes(volume: np.ndarray, u: np.ndarray, v: np.ndarray) -> list[int]:
    """Inclined planes of a volume that show nowhere, or over a strip narrower than NARROW_M; it shows at `u`, `v` (n,)."""
    there = [p for p in range(SIDES) if volume[OFFSET + p] < np.inf]
    if len(u) == 0 or not there:
        return []
    slopes = np.append(volume[SLOPE : SLOPE + SIDES], 0.0)
    falls = np.stack([*distances_up(volume, u, v), np.zeros_like(u)])
    lowest = np.argmin(volume[OFFSET : OFFSET + PLANES, None] + slopes[:, None] * falls, axis=0)
    return [p for p in there if width_of(falls[p, lowest == p]) < NARROW_M]


def width_of(x: np.ndarray) -> float:
    return float(np.ptp(x)) if len(x) else 0.0
