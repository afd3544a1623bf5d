"""The sun and the sky of a year at a place, from pvlib.

A weather file is one of a typical year; without one the sky is clear. Values are means over an
hour, and the sun stands where it is in the middle of that hour.
"""

from __future__ import annotations

import functools
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..extras import import_extra
from .horizon import SECTORS

FARTHEST_STATION_KM = 300.0  # distance (km) beyond which weather says nothing of a place
EARTH_RADIUS_KM = 6371.0  # mean radius, for distances to weather stations
LEAST_COS_ZENITH = 0.01745  # pvlib's bound of the circumsolar ratio: 89 degrees
YEAR = "2023"  # of the clear sky: no leap year, and its sun is that of any year
HOURS = 8760  # of a year that is no leap year


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


def import_pvlib() -> Any:
    """Import pvlib. Raises InputError where it is missing."""
    return import_extra("pvlib", "sun", "--sun")


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


def make_clear_sky(place: Any) -> tuple[Any, Any]:
    """Return the middles of a year's hours (UTC) and the clear sky at a place.

    The turbidity is Linke's, from pvlib.
    """
    pandas = import_module("pandas")

    times = pandas.date_range(f"{YEAR}-01-01 00:30", periods=HOURS, freq="h", tz="UTC")
    return times, place.get_clearsky(times)


def read_weather(path: str, place: Any) -> tuple[Any, Any]:
    """Read an EPW file: the middles of its hours, and their irradiance.

    Raises InputError for a file that cannot be read, and for a station too far away.
    """
    pandas = import_module("pandas")

    pvlib = import_pvlib()
    try:
        values, station = pvlib.iotools.read_epw(Path(path), coerce_year=int(YEAR))
        where = float(station["latitude"]), float(station["longitude"])
        rows = values[["ghi", "dhi", "dni"]].to_numpy(float)
    except (OSError, ValueError, KeyError, IndexError, TypeError, StopIteration) as error:
        raise InputError(
            f"expected weather of a typical year as EPW in {path}, got: {error!s:.200}; check the "
            "file"
        ) from error
    if len(rows) != HOURS or not (np.isfinite(rows).all() and (rows >= 0).all()):
        raise InputError(
            f"expected {HOURS} hours of irradiance in {path}, got {len(rows)} or some that are no "
            "numbers; use another file"
        )
    distance = measure_distance(where, (place.latitude, place.longitude))
    if distance > FARTHEST_STATION_KM:
        raise InputError(
            f"expected a weather station within {FARTHEST_STATION_KM:g} km of the buildings, got "
            f"one {distance:.0f} km away in {path}; use another file"
        )
    # pvlib's stamps begin the hours that EPW's end
    return pandas.DatetimeIndex(values.index) + pandas.Timedelta(minutes=30), values


def measure_distance(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Return the distance (km) of two places.

    These are given by latitude and longitude (degrees).

    >>> round(measure_distance((52.0, 4.4), (48.1, 11.6)))
    672
    """
    (a, b), (c, d) = np.radians(one), np.radians(other)
    half = np.sin((c - a) / 2) ** 2 + np.cos(a) * np.cos(c) * np.sin((d - b) / 2) ** 2
    return float(2 * EARTH_RADIUS_KM * np.arcsin(np.sqrt(half)))
