"""Storeys and floor areas, as intervals: nobody sees floors from above."""

from __future__ import annotations

import math

import numpy as np

from ..model import ROOF, Solid
from ..model.roof_figures import make_triangles

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
    none of them. Where no number of storeys fills a height, both are the most that fit below it.

    >>> count_storeys(5.6, RESIDENTIAL_STOREY_M), count_storeys(4.5, RESIDENTIAL_STOREY_M)
    ((2, 2), (1, 1))
    """
    low, high = heights
    greatest = max(1, math.floor(eave_m / low + 1e-9))
    least = max(1, math.ceil((eave_m - HIGHEST_PLINTH_M) / high - 1e-9))
    return min(least, greatest), greatest


def measure_floors(
    solid: Solid, z_ground: float, eave_m: float, heights: tuple[float, float]
) -> tuple[float, float]:
    """Return the least and the greatest gross floor area (m2), attics included.

    They are those of the least and the greatest number of storeys. A floor is as large as the plan
    in which the roof is at least HEADROOM_M above it.
    """
    low, high = heights
    least, greatest = count_storeys(eave_m, heights)
    height = min(max((eave_m - HIGHEST_PLINTH_M) / least, low), high)
    levels = RoofLevels(solid)
    z_eave = z_ground + eave_m
    return (
        sum_floors(
            levels, z_ground + HIGHEST_PLINTH_M + height * np.arange(least + 1), z_eave, high
        ),
        sum_floors(levels, z_ground + low * np.arange(greatest + 1), z_eave, low),
    )


def sum_floors(levels: RoofLevels, z_floors: np.ndarray, z_eave: float, storey_m: float) -> float:
    """Return the area (m2) of full storeys and of the attics above them.

    `z_floors` are the heights of the storeys' floors and of the last one's ceiling.
    """
    attics = np.arange(max(z_eave, z_floors[-1]), levels.z_top, storey_m)
    floors = np.concatenate([z_floors[:-1], attics]) + HEADROOM_M
    floors[0] = min(floors[0], z_eave, levels.z_top)  # low sheds, too, have a floor
    return float(sum(map(levels.measure_above, floors)))


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
