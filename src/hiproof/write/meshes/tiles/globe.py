"""Places on the globe: world metres to Earth-centred ones, and back.

Earth-centred coordinates are EPSG:4978.

The plan goes through pyproj's best transformation at hand. Heights of 3D Tiles are above the
ellipsoid, those of clouds mostly above the geoid, some tens of metres away: between them stands a
grid that pyproj may not have, and `Globe.heights` says what was done.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ....errors import InputError
from ....frames import Units
from ....read.crs import (
    describe_crs,
    find_best_transformer,
    find_units,
    has_heights,
    horizontal_crs,
    parse_crs,
    vertical_crs,
)

GEOGRAPHIC_CRS, GEOCENTRIC_CRS = "EPSG:4979", "EPSG:4978"
# m that a place may move on its way to the globe and back; more is a CRS used outside its area
SAME_PLACE_M = 0.005


@dataclass(frozen=True)
class Globe:
    """How world metres of a CRS become Earth-centred coordinates.

    `transformer` takes the CRS's own coordinates to longitude, latitude (degrees) and, where
    `is_3d`, height above the ellipsoid; else that is the height plus `geoid_height_m`. `heights`
    says so in a sentence; `is_known` is False where it is a guess. `accuracy_m` is what pyproj
    states, None where it does not.
    """

    name: str
    units: Units
    transformer: Any
    is_3d: bool
    geoid_height_m: float
    heights: str
    is_known: bool
    accuracy_m: float | None
    to_centre: Any = field(repr=False)

    @classmethod
    def of(cls, crs: Any, geoid_height_m: float | None = None) -> Globe:
        """Return the globe as seen from `crs` (anything pyproj understands).

        A `geoid_height_m` given is added to all heights. Raises InputError where there is no CRS,
        or none of a place on the Earth.

        >>> globe = Globe.of("EPSG:7415", geoid_height_m=43.2)
        >>> globe.geographic(np.array([[85000.0, 446000.0, 2.0]]))[0].round(3).tolist()
        [4.368, 51.998, 45.2]
        """
        from pyproj import Transformer

        crs = parse_crs(crs)
        if crs is None:
            raise InputError(
                "expected a CRS, to place the buildings on the globe, got none; say which with "
                "--crs EPSG:..."
            )
        units = find_units(crs, "the models")
        to_centre = Transformer.from_crs(GEOGRAPHIC_CRS, GEOCENTRIC_CRS, always_xy=True)
        exact = None  # where the way to heights would be a guess
        if geoid_height_m is None and has_heights(crs):
            exact = find_best_transformer(crs, GEOGRAPHIC_CRS, allow_ballpark=False)
        transformer = exact or find_best_transformer(horizontal_crs(crs), "EPSG:4326")
        if transformer is None:
            raise InputError(
                f"expected a CRS that pyproj can place on the globe, got {describe_crs(crs)}; name "
                "another with --crs"
            )
        heights, is_known = explain_heights(crs, exact, geoid_height_m)
        accuracy = transformer.accuracy if transformer.accuracy >= 0 else None
        return cls(
            describe_crs(crs),
            units,
            transformer,
            exact is not None,
            geoid_height_m or 0.0,
            heights,
            is_known,
            accuracy,
            to_centre,
        )

    def geographic(self, world: np.ndarray) -> np.ndarray:
        """Return longitude, latitude (degrees), ellipsoidal height (n, 3) of world metres."""
        x, y, z = self.units.from_metres(world).T
        if self.is_3d:
            return np.column_stack(self.transformer.transform(x, y, z))
        return np.column_stack(
            [*self.transformer.transform(x, y), np.asarray(world)[:, 2] + self.geoid_height_m]
        )

    def to_earth(self, world: np.ndarray) -> np.ndarray:
        """Return Earth-centred coordinates (n, 3) of world metres; InputError without any."""
        earth = np.column_stack(self.to_centre.transform(*self.geographic(world).T))
        # Projections answer for places beyond their own, but do not find the way back.
        if not np.allclose(self.from_earth(earth), world, rtol=0, atol=SAME_PLACE_M):
            raise InputError(
                f"expected coordinates in {self.name}, got some that are no place there; say the "
                "right CRS with --crs"
            )
        return earth

    def from_earth(self, earth: np.ndarray) -> np.ndarray:
        """Return world metres (n, 3) of Earth-centred coordinates (n, 3)."""
        longitude, latitude, height = self.to_centre.transform(
            *np.asarray(earth).T, direction="INVERSE"
        )
        if self.is_3d:
            coordinates = self.transformer.transform(
                longitude, latitude, height, direction="INVERSE"
            )
            return self.units.to_metres(np.column_stack(coordinates))
        xy = np.column_stack(self.transformer.transform(longitude, latitude, direction="INVERSE"))
        return np.column_stack([self.units.to_metres(xy), height - self.geoid_height_m])


def explain_heights(crs: Any, exact: Any, geoid_height_m: float | None) -> tuple[str, bool]:
    """Describe what was done with heights, and whether they are right."""
    if geoid_height_m is not None:
        return (
            f"heights above the ellipsoid are those of the models plus {geoid_height_m} m, as "
            "--geoid-height says",
            True,
        )
    if exact is not None:
        return f"heights above the ellipsoid by pyproj: {exact.description}", True
    height_crs = vertical_crs(crs)
    advice = "say the geoid's height there with --geoid-height METRES"
    if height_crs is None:
        return (
            f"{describe_crs(crs)} names no heights, so these are taken to be above the ellipsoid; "
            f"{advice}",
            False,
        )
    return (
        f"pyproj has no grid here for {height_crs.name}, so heights are taken to be above the "
        "ellipsoid and the buildings may stand some tens of metres too low or high; install it "
        f"(`projsync`, or PROJ_NETWORK=ON) or {advice}"
    ), False


def make_local_frame(longitude: float, latitude: float, origin: np.ndarray) -> np.ndarray:
    """Return the transform (4, 4) from east, north, up to Earth-centred.

    The local frame is about `origin` (3,), Earth-centred.

    >>> make_local_frame(0.0, 0.0, np.array([6378137.0, 0.0, 0.0]))[:3,
    ...     2].tolist()  # up is away from the centre
    [1.0, 0.0, 0.0]
    """
    (sl, cl), (sp, cp) = (
        (math.sin(a), math.cos(a)) for a in (math.radians(longitude), math.radians(latitude))
    )
    transform = np.eye(4)
    transform[:3, 0] = -sl, cl, 0.0
    transform[:3, 1] = -sp * cl, -sp * sl, cp
    transform[:3, 2] = cp * cl, cp * sl, sp
    transform[:3, 3] = origin
    return transform
