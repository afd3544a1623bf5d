"""Storeys and floor areas, as intervals: nobody sees floors from above."""

from __future__ import annotations

import math

import numpy as np

from ..model import ROOF, Solid
from ..write.roof_figures import make_triangles

RESIDENTIAL_STOREY_M, OTHER_STOREY_M = (2.5, 3.3), (3.0, 5.0)
"""Least and greatest height (m) of a storey, floor to floor: of dwellings from the least ceiling
that building codes allow to that of old town houses; of other uses up to that of shops and halls.
"""
HIGHEST_PLINTH_M = 0.6  # height (m) of a ground floor over the ground that houses seldom exceed
HEADROOM_M = 1.5  # height (m) below the roof from which a floor counts as area


def storey_heights(is_residential: bool) -> tuple[float, float]:
    return RESIDENTIAL_STOREY_M if is_residential else OTHER_STOREY_M


def count_storeys(eave_m: float, heights: tuple[float, float]) -> tuple[int, int]:
    """Return the least and the greatest number of full storeys below the eaves.

    `eave_m` is the height of the eaves over the ground, `heights` those of a storey. An attic is
    none of them.

    >>> count_storeys(5.6, RESIDENTIAL_STOREY_M), count_storeys(2.0, RESIDENTIAL_STOREY_M)
    ((2, 2), (1, 1))
    """
    low, high = heights
    least = max(1, math.ceil((eave_m - HIGHEST_PLINTH_M) / high - 1e-9))
    return least, max(least, math.floor(eave_m / low + 1e-9))


def measure_floors(
    solid: Solid, z_ground: float, heights: tuple[float, float]
) -> tuple[float, float]:
    """Return the least and the greatest gross floor area (m2), attics included.

    A floor is as large as the plan in which the roof is at least HEADROOM_M above it.
    """
    low, high = heights
    levels = RoofLevels(solid)
    return (
        sum_floors(levels, z_ground + HIGHEST_PLINTH_M, high),
        sum_floors(levels, z_ground, low),
    )


def sum_floors(levels: RoofLevels, z_first: float, storey_m: float) -> float:
    """Return the area (m2) of floors, the first at height `z_first` (m)."""
    floors = np.arange(z_first + HEADROOM_M, levels.z_top, storey_m)
    lowest = min(z_first + HEADROOM_M, levels.z_top)
    return float(sum(map(levels.measure_above, floors))) or levels.measure_above(lowest)


class RoofLevels:
    """The plan areas of a roof above any height."""

    def __init__(self, solid: Solid) -> None:
        triangles = make_triangles(solid, solid.vertices.mean(axis=0))
        roof = np.array([face.kind == ROOF for face in solid.faces])[triangles.face_of]
        self.plan = triangles.vectors[roof, 2]
        self.z = np.sort(solid.vertices[triangles.fan[roof], 2], axis=1)
        self.z_top = float(self.z.max())

    def measure_above(self, z: float) -> float:
        """Return the plan area (m2) where the roof is at least as high as `z`."""
        low, middle, high = self.z.T
        with np.errstate(divide="ignore", invalid="ignore"):
            tip = (high - z) ** 2 / ((high - low) * (high - middle))
            base = (z - low) ** 2 / ((high - low) * (middle - low))
        share = np.where(z > middle, tip, 1.0 - base)
        share = np.where(z <= low, 1.0, np.where(z > high, 0.0, share))
        return float(self.plan @ share)
