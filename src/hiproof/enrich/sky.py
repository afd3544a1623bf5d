"""The sun and the sky of a year at a place, from pvlib.

A weather file is one of a typical year; without one the sky is clear.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from .horizon import SECTORS
from .weather import import_pvlib, make_clear_sky, read_weather

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
    """Make the sky of a place (degrees, m).

    `convergence` (degrees) is the direction of the run's grid north, clockwise from true north.
    """
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
