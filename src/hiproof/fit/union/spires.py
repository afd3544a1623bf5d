"""Measure how near points lie to spires of equal sides."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ...primitives.cone import BROACH_SIDES, HEXAGON_SIDES

SIDES_OF_SPIRES = {"broach": BROACH_SIDES, "hexagonal_spire": HEXAGON_SIDES}
ROTATIONS = 6  # Rotations of a spire that are tried within one of its facets.
LEAST_SLOPE = 0.1  # Facets that rise less do not show where their middle is.


@dataclass(frozen=True)
class Spire:
    """A spire by its middle (2,) and the direction `facing` (rad) of a facet."""

    middle: np.ndarray
    facing: float
    sides: int


def fit_spire(points: np.ndarray, start: Spire) -> tuple[Spire, np.ndarray]:
    """Fit a spire to points (n, 3) by one step from a start.

    Returns it with the distance (m) of each point in height (n,).
    """
    way, facet = points[:, :2] - start.middle, 2.0 * math.pi / start.sides
    r, turns = np.hypot(*way.T), np.arctan2(way[:, 1], way[:, 0])
    aside = (turns - start.facing + 0.5 * facet) % facet - 0.5 * facet
    ahead = turns - aside  # the way that the facet under a point faces
    # A turn and a shift of the middle change heights by the slope times these columns.
    moves = r * np.sin(aside), -np.cos(ahead), -np.sin(ahead)
    design = np.column_stack([r * np.cos(aside), *moves, np.ones_like(r)])
    solution = np.linalg.lstsq(design, points[:, 2], rcond=None)[0]
    distances = np.abs(points[:, 2] - design @ solution)
    slope = solution[0]
    if slope > -LEAST_SLOPE:
        return start, distances
    turn, *shift = solution[1:4] / slope
    turn, shift = np.clip(turn, -0.5 * facet, 0.5 * facet), np.clip(shift, -r.max(), r.max())
    return replace(start, middle=start.middle + shift, facing=start.facing + turn), distances


def measure_spires(points: np.ndarray, middle: np.ndarray, cap_m: float) -> float:
    """Measure how far (m, mean) points (n, 3) lie from a spire around a middle (2,).

    It is the spire nearest to them, and each counts up to `cap_m`.
    """

    def step(start: Spire) -> tuple[float, Spire]:
        spire, distances = fit_spire(points, start)
        return float(np.minimum(distances, cap_m).mean()), spire

    starts = [
        Spire(middle, 2.0 * math.pi * k / (ROTATIONS * sides), sides)
        for sides in SIDES_OF_SPIRES.values()
        for k in range(ROTATIONS)
    ]
    left, spire = min((step(start) for start in starts), key=lambda one: one[0])
    return min(left, step(spire)[0])
