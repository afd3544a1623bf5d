"""Planes that show as slivers go: a strip at a volume's edge, however well it explains what a scanner saw of the wall there."""

from __future__ import annotations

import numpy as np

from .objective import objective
from .refit import refit
from .scene import Scene
from .trim import raster
from .volumes import DIRECTION, LEVEL, OFFSET, SLOPE, coefficients, lowest_plane, plane_count, roof_heights

NARROW_M = 0.45  # what shows of a plane is as wide at least, along its own fall
DEAREST_UNITS = 3.0  # what leaving a plane out may cost


def without_slivers(volumes: np.ndarray, scene: Scene) -> np.ndarray:
    """The volumes without inclined planes of which only a narrow strip shows, where that costs no more than a part would."""
    value = objective(volumes, scene, np.inf)
    U, V = raster(scene)
    for k in range(1, len(volumes)):
        for plane in narrow_planes(volumes, k, U, V):
            if plane_count(volumes[k]) < 2:
                break
            trial = volumes.copy()
            trial[k, OFFSET + plane], trial[k, SLOPE + plane] = np.inf, 0.0
            refit(trial, scene, k)
            found = objective(trial, scene, value + DEAREST_UNITS * scene.evidence)
            if np.isfinite(found):
                volumes, value = trial, min(value, found)
    return volumes


def narrow_planes(volumes: np.ndarray, k: int, U: np.ndarray, V: np.ndarray) -> list[int]:
    """Inclined planes of volume k that show at U, V (directions, n) nowhere, or over a strip narrower than NARROW_M."""
    _, top = roof_heights(volumes, U, V)
    direction, c = int(volumes[k, DIRECTION]), coefficients(volumes, k)
    uv = np.stack([U[direction], V[direction]])[:, top == k]
    lowest = np.array([lowest_plane(c, u, v)[1] for u, v in uv.T])
    there = [p for p in range(LEVEL) if volumes[k, OFFSET + p] < np.inf]
    return [p for p in there if width_of(uv[p // 2, lowest == p]) < NARROW_M] if len(lowest) else []


def width_of(x: np.ndarray) -> float:
    return float(np.ptp(x)) if len(x) else 0.0
