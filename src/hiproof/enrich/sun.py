"""The sun on a face: irradiation by month, shaded by buildings and terrain.

The sun and the sky of a year at a place come from pvlib.

The sky is Hay and Davies': light from the sun's direction, circumsolar light included, is shaded
where the sun stands below the horizon of a place; the isotropic light is weighted by the part of
the sky that a place sees; light reflected by the ground is not shaded.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
import shapely

from ..model import Solid
from .far import LIFT_M, SECTORS, find_horizon, measure_share
from .walls import Wall
from .weather import import_pvlib, make_clear_sky, read_weather

MIDDLES = (np.arange(SECTORS) + 0.5) * (2 * np.pi / SECTORS)
SPACING_M = 1.0  # distance (m) of sample points: on a roof face in plan, on a wall along it
MOST_SAMPLES = 64  # of a face; larger faces have points farther apart


class Irradiation(NamedTuple):
    """What a face gets in a year; `shaded_share` is the direct light that others take away."""

    by_month: np.ndarray
    shaded_share: float


def irradiate(
    normal: np.ndarray,
    places: np.ndarray,
    edges: np.ndarray,
    sky: Sky,
    albedo: float,
    far: np.ndarray | float = 0.0,
) -> Irradiation:
    """Return the irradiation of a face with a unit `normal` (3,).

    `places` (n, 3) are sample points on it, `edges` (m, 2, 3) the roof edges that may shade them,
    `far` (SECTORS,) the tangents of the far horizon.
    """
    horizon = np.maximum(find_horizon(places + (0.0, 0.0, LIFT_M), edges), far)
    facing = np.maximum(sky.sun @ normal, 0.0)
    seen = measure_share(horizon, sky.sector, sky.tangent)
    direct = facing * sky.direct
    total = float(direct.sum())
    visible = measure_sky(normal, horizon) / measure_sky(normal, np.zeros((1, SECTORS)))
    by_month = (
        np.bincount(sky.month, facing * sky.beam * seen, 12)
        + sky.isotropic * visible * (1.0 + normal[2]) / 2.0
        + sky.horizontal * albedo * (1.0 - normal[2]) / 2.0
    )
    return Irradiation(by_month, 1.0 - float(direct @ seen) / total if total > 0 else 0.0)


def measure_sky(normal: np.ndarray, horizon: np.ndarray) -> float:
    """Return the view factor of the sky above a plane, and horizons (n, SECTORS), mean."""
    side = normal[0] * np.sin(MIDDLES) + normal[1] * np.cos(MIDDLES)
    plane = np.arctan2(np.maximum(-side, 0.0), normal[2])
    low = np.maximum(np.arctan(horizon), plane)
    upright = normal[2] * (1.0 - np.sin(low) ** 2) / 2.0
    level = side * (np.pi / 4.0 - low / 2.0 - np.sin(2.0 * low) / 4.0)
    return float((upright + level).mean() * 2.0)


def sample_face(solid: Solid, face: int, normal: np.ndarray) -> np.ndarray:
    """Return sample points (n, 3) on a roof face, a grid in plan."""
    xy = sample_area(solid.project_face(solid.faces[face]))
    corner = solid.vertices[solid.faces[face].rings[0][0]]
    return np.column_stack([xy, corner[2] - (xy - corner[:2]) @ normal[:2] / normal[2]])


def sample_wall(wall: Wall, normal: np.ndarray) -> np.ndarray:
    """Return sample points (n, 3) just outside a wall with a unit `normal` (3,)."""
    return wall.lift(sample_area(wall.polygon)) + LIFT_M * normal


def sample_area(area: shapely.Geometry) -> np.ndarray:
    """Return sample points (n, 2) of an area, a grid at most SPACING_M apart."""
    low_x, low_y, high_x, high_y = area.bounds
    step = max(SPACING_M, float(np.sqrt(area.area / MOST_SAMPLES)))
    x, y = (
        np.linspace(low, high, 2 * count + 1)[1::2]
        for low, high, count in (
            (low_x, high_x, int(np.ceil((high_x - low_x) / step))),
            (low_y, high_y, int(np.ceil((high_y - low_y) / step))),
        )
    )
    xy = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    xy = xy[shapely.contains_xy(area, xy)]
    return xy if len(xy) else shapely.get_coordinates(shapely.point_on_surface(area))


LEAST_COS_ZENITH = 0.01745  # pvlib's bound of the circumsolar ratio: 89 degrees


class Sky(NamedTuple):
    """The hours of a year with the sun above the horizon.

    `sun` (t, 3) points to it: east, north, up along the axes of the run. `sector` (t,) and
    `tangent` (t,) say where it stands over a horizon. `beam` (t,) is the irradiance (kWh/m2 in the
    hour) that comes from the sun's direction, circumsolar light included, on a plane that faces it;
    `month` (t,) counts from 0. `isotropic` (12,) and `horizontal` (12,) are what comes from all of
    the sky and what a level plane gets, by month, in kWh/m2.
    """

    sun: np.ndarray
    sector: np.ndarray
    tangent: np.ndarray
    beam: np.ndarray
    direct: np.ndarray
    month: np.ndarray
    isotropic: np.ndarray
    horizontal: np.ndarray


@functools.lru_cache(16)
def make_sky(
    latitude: float, longitude: float, altitude: float, convergence: float, weather: str = ""
) -> Sky:
    """Make the sky of a place (degrees, m); grid north is `convergence` off true north."""
    pvlib = import_pvlib()
    place = pvlib.location.Location(latitude, longitude, altitude=altitude)
    times, values = read_weather(weather, place) if weather else make_clear_sky(place)
    position = place.get_solarposition(times)
    zenith = np.radians(position["zenith"].to_numpy())
    azimuth = np.radians(position["azimuth"].to_numpy() - convergence) % (2 * np.pi)
    extra = pvlib.irradiance.get_extra_radiation(times).to_numpy()
    ghi, dhi, dni = (values[name].to_numpy(float) / 1000.0 for name in ("ghi", "dhi", "dni"))
    anisotropy = 1000.0 * dni / extra
    month = times.month.to_numpy() - 1
    up = np.cos(zenith) > 0
    circumsolar = dhi * anisotropy / np.maximum(np.cos(zenith), LEAST_COS_ZENITH)
    sun = np.column_stack(
        [np.sin(zenith) * np.sin(azimuth), np.sin(zenith) * np.cos(azimuth), np.cos(zenith)]
    )
    return Sky(
        sun[up],
        (azimuth[up] / (2 * np.pi / SECTORS)).astype(np.int64) % SECTORS,
        1.0 / np.tan(zenith[up]),
        (dni + circumsolar)[up],
        dni[up],
        month[up],
        np.bincount(month, dhi * (1.0 - anisotropy), 12),
        np.bincount(month, ghi, 12),
    )
