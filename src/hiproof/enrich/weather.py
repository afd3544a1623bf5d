"""The irradiance of a typical year, from files of the formats that pvlib reads.

EPW and TMY3 have means over the hour that ends at the stamp, in local standard time: the sun stands
where it is in the middle of that hour. PVGIS has values of a moment near the stamp, in UTC.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..extras import import_extra

YEAR = "2023"  # of all hours: no leap year, and its sun is that of any year
HOURS = 8760  # of a year that is no leap year
FARTHEST_STATION_KM = 300.0  # distance (km) beyond which weather says nothing of a place
EARTH_RADIUS_KM = 6371.0  # mean radius
PVGIS_CSV = b"Latitude"  # beginning of PVGIS' tables; other tables are TMY3's


class Weather(NamedTuple):
    """A year of weather: when the sun is taken, and irradiance (W/m2) by name.

    `where` is the latitude and longitude of the station.
    """

    times: Any
    values: Any
    where: tuple[float, float]


def import_pvlib() -> Any:
    """Import pvlib. Raises InputError where it is missing."""
    return import_extra("pvlib", "sun", "--sun")


def make_clear_sky(place: Any) -> tuple[Any, Any]:
    """Return the middles of a year's hours (UTC) and the clear sky at a place.

    The turbidity is Linke's, from pvlib.
    """
    times = list_hours() + import_module("pandas").Timedelta(minutes=30)
    return times, place.get_clearsky(times)


def list_hours() -> Any:
    """Return the beginnings of the hours of YEAR (UTC)."""
    return import_module("pandas").date_range(f"{YEAR}-01-01", periods=HOURS, freq="h", tz="UTC")


def read_weather(path: str, place: Any) -> tuple[Any, Any]:
    """Read the weather of a typical year: its times, and their irradiance.

    Raises InputError for a file that cannot be read, and for a station too far away.
    """
    try:
        weather = choose_reader(Path(path))(Path(path))
        rows = weather.values[["ghi", "dhi", "dni"]].to_numpy(float)
    except (OSError, ValueError, KeyError, IndexError, TypeError, StopIteration) as error:
        raise InputError(
            f"expected weather of a typical year as EPW, TMY3 or PVGIS in {path}, got: "
            f"{error!s:.200}; check the file"
        ) from error
    if len(rows) != HOURS or not (np.isfinite(rows).all() and (rows >= 0).all()):
        raise InputError(
            f"expected {HOURS} hours of irradiance in {path}, got {len(rows)} or some that are no "
            "numbers; use another file"
        )
    distance = measure_distance(weather.where, (place.latitude, place.longitude))
    if distance > FARTHEST_STATION_KM:
        raise InputError(
            f"expected a weather station within {FARTHEST_STATION_KM:g} km of the buildings, got "
            f"one {distance:.0f} km away in {path}; use another file"
        )
    return weather.times, weather.values


def choose_reader(path: Path) -> Callable[[Path], Weather]:
    """Return the reader of a file by its ending, and by the beginning of a table."""
    ending = path.suffix.lower()
    if ending == ".json":
        return read_pvgis
    if ending != ".csv":
        return read_epw
    with path.open("rb") as file:
        return read_pvgis if file.readline().startswith(PVGIS_CSV) else read_tmy3


def read_epw(path: Path) -> Weather:
    """Read an EPW file. Its hours end at their stamps, where pvlib's begin."""
    values, station = import_pvlib().iotools.read_epw(path, coerce_year=int(YEAR))
    return Weather(shift_hours(values.index, 0.5), values, locate_station(station))


def read_tmy3(path: Path) -> Weather:
    """Read a TMY3 file."""
    values, station = import_pvlib().iotools.read_tmy3(path, coerce_year=int(YEAR))
    return Weather(shift_hours(values.index, -0.5), values, locate_station(station))


def read_pvgis(path: Path) -> Weather:
    """Read a typical year of PVGIS, as a table or JSON."""
    values, facts = import_pvlib().iotools.read_pvgis_tmy(path)
    station = facts["inputs"].get("location") or facts["inputs"]
    offset = {name.replace(" ", "_"): value for name, value in station.items()}
    delay = float(offset.get("irradiance_time_offset") or 0.0)
    # every month is of another year
    times = shift_hours(list_hours()[: len(values)], delay)
    return Weather(times, values.set_axis(times), locate_station(station))


def shift_hours(times: Any, hours: float) -> Any:
    """Return times that are later by some hours."""
    pandas = import_module("pandas")
    return pandas.DatetimeIndex(times) + pandas.Timedelta(hours=hours)


def locate_station(station: dict[str, Any]) -> tuple[float, float]:
    return float(station["latitude"]), float(station["longitude"])


def measure_distance(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Return the distance (km) of two places.

    These are given by latitude and longitude (degrees).

    >>> round(measure_distance((52.0, 4.4), (48.1, 11.6)))
    672
    """
    (a, b), (c, d) = np.radians(one), np.radians(other)
    half = np.sin((c - a) / 2) ** 2 + np.cos(a) * np.cos(c) * np.sin((d - b) / 2) ** 2
    return float(2 * EARTH_RADIUS_KM * np.arcsin(np.sqrt(half)))
