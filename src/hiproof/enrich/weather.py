"""The irradiance of a typical year, from files of the formats that pvlib reads.

EPW and TMY3 have means over the hour that ends at the stamp, in local standard time: the sun stands
where it is in the middle of that hour. PVGIS has values of a moment near the stamp, in UTC.

No year is used that the sun over its station cannot have made.
"""

from __future__ import annotations

import functools
import io
import re
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pyproj import Geod

from ..errors import InputError, explain_fault, warn
from ..extras import import_extra
from ..log import count_things

YEAR = "2023"  # of all hours: no leap year, and its sun is that of any year
HOURS = 8760  # of a year that is no leap year
LEAP_DAY = re.compile(r"^\d+, *0?2, *29,.*\n", re.MULTILINE)  # its rows in EPW
FARTHEST_STATION_KM = 300.0  # distance (km) beyond which weather says nothing of a place
EARTH_RADIUS_KM = 6371.0  # mean radius
PVGIS_CSV = "Latitude"  # beginning of PVGIS' tables; other tables are TMY3's
MISSING_WM2 = 9999.0  # irradiance (W/m2) from which EPW calls a value missing; others use negatives
SUN_MINUTES = range(-120, 121, 20)  # any three in a row give the mean sun of an hour
MOVED, LEAST_MOVED = 0.6, 0.02
"""Share of the gap between global radiation and its parts that is left with the sun of another time
(from 13 minutes on) or with direct radiation on level ground, below which that is what the file
holds, and the least such gap, as a share of half a year: 0.004 in pvlib's TMY3 files.
"""
SUMMER_DAYS = (90, 273)  # days of the year with clocks put forward (north) or not (south)
GREATEST_EXCESS = 0.007
"""Share of a year's global radiation that may exceed what reaches the top of the atmosphere.

It is 0.0001 in pvlib's TMY3 files, at most 0.004 where stamps name the middle of an hour, and 0.012
or more where hours are one off.
"""
GREATEST_GAP = 0.15
"""Sum of the hours' differences between global radiation and its diffuse and direct parts, as a
share of the year: 0.003 in pvlib's TMY3 files, 0.06 where hours are half of one off.
"""
GREATEST_GAP_WM2 = 300.0  # of either in one hour (W/m2); up to 250 where hours are one off
LEAST_CLEARNESS = 0.1  # of the radiation above the atmosphere: 0.3 in the dullest climates on Earth
LEAST_DIRECT = 0.02  # of a month's global radiation, where it is high: 0 in no climate
BRIGHT_MONTH = 0.06  # of a year's global radiation: a month of summer, or any near the equator
BRIGHTEST, USUAL_BRIGHTNESS = 0.99, (0.5, 0.9)
"""Quantile of the hours with a high sun, and the shares of the radiation above the atmosphere that
it has to reach: clear skies let 0.7 to 0.8 pass, and every climate has clear hours.
"""
LEAST_STUCK_WM2 = 50.0  # W/m2; in whole ones, winter days of the north have less in equal hours
FEWEST_EQUAL = 8  # hours with sun from which on two days that are alike in all are copies
DAYLIGHT_RISE = 0.25  # sine of the sun's elevation (15 degrees) from which no hour is dark


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


def name_sky(weather: str) -> str:
    """Return the name of the sky that a weather file makes, or none.

    >>> name_sky("data/delft.epw"), name_sky("")
    ('delft.epw', 'clear sky')
    """
    return Path(weather).name if weather else "clear sky"


def make_clear_sky(place: Any) -> tuple[Any, Any]:
    """Return the middles of a year's hours (UTC) and the clear sky at a place.

    The turbidity is Linke's, from pvlib.
    """
    times = shift_hours(list_hours(), 0.5)
    return times, place.get_clearsky(times)


def list_hours(zone: Any = "UTC") -> Any:
    """Return the beginnings of the hours of YEAR in a time zone."""
    return import_module("pandas").date_range(f"{YEAR}-01-01", periods=HOURS, freq="h", tz=zone)


def read_weather(path: str, place: Any) -> tuple[Any, Any]:
    """Read the weather of a typical year: its times, and their irradiance.

    Raises InputError for a file that cannot be read, for radiation that its sun cannot have made,
    and for a station too far away.
    """
    weather = read_year(path)
    where = weather.where[::-1], (place.longitude, place.latitude)
    radius_m = 1000.0 * EARTH_RADIUS_KM
    distance = Geod(a=radius_m, b=radius_m).inv(*where[0], *where[1])[2] / 1000.0
    if not distance <= FARTHEST_STATION_KM:
        raise InputError(
            f"expected a weather station within {FARTHEST_STATION_KM:g} km of the buildings, got "
            f"one {distance:.0f} km away in {path}; use another file"
        )
    return weather.times, weather.values


@functools.lru_cache(1)
def read_year(path: str) -> Weather:
    """Read a file of weather and check it against the sun over its station."""
    try:
        weather = parse_weather(Path(path))
        weather = weather._replace(values=weather.values[["ghi", "dhi", "dni"]].astype(float))
    except (OSError, ValueError, KeyError, IndexError, TypeError, StopIteration) as error:
        raise InputError(
            f"expected weather of a typical year as EPW, TMY3 or PVGIS in {path}, got "
            f"{explain_fault(path) or explain(error)}; check the file"
        ) from error
    refuse_other_hours(weather, path)
    refuse_missing_hours(weather, path)
    refuse_other_sun(weather, path)
    return weather


def explain(error: Exception) -> str:
    """Say why weather could not be read, without what libraries advise their callers."""
    if isinstance(error, KeyError):
        return f"a file without {error.args[0]!s:.80}"
    if isinstance(error, ValueError):
        return f"a file of another form: {str(error).splitlines()[0].split('. ')[0]:.120}"
    return "a file that ends early"


def parse_weather(path: Path) -> Weather:
    """Read a file by its ending, and by the beginning of a table.

    Its text is UTF-8, or Latin-1 as in files with names of towns.
    """
    data = path.read_bytes()
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    ending, tools = path.suffix.lower(), import_pvlib().iotools
    if ending == ".json":
        return parse_pvgis(io.StringIO(text), "json")
    if text.startswith(PVGIS_CSV) and ending == ".csv":
        return parse_pvgis(io.BytesIO(text.encode()), "csv")
    # hours end at their stamps, but those of EPW begin there in pvlib
    read, delay = (tools.read_tmy3, -0.5) if ending == ".csv" else (tools.read_epw, 0.5)
    text = text if ending == ".csv" else LEAP_DAY.sub("", text)
    values, station = read(io.StringIO(text), coerce_year=int(YEAR))
    return Weather(shift_hours(values.index, delay), values, locate_station(station))


def parse_pvgis(file: io.StringIO | io.BytesIO, form: str) -> Weather:
    """Read a typical year of PVGIS, as a table or JSON."""
    values, facts = import_pvlib().iotools.read_pvgis_tmy(file, pvgis_format=form)
    station = facts["inputs"].get("location") or facts["inputs"]
    offset = {name.replace(" ", "_"): value for name, value in station.items()}
    delay = float(offset.get("irradiance_time_offset") or 0.0)
    # every month is of another year
    stamps = values.index.map(lambda stamp: stamp.replace(year=int(YEAR)))
    times = shift_hours(stamps, delay)
    return Weather(times, values.set_axis(times), locate_station(station))


def refuse_other_hours(weather: Weather, path: str) -> None:
    """Raise InputError unless each hour of a year is there once, in order."""
    times = weather.times
    if len(times) != HOURS:
        raise InputError(
            f"expected the {HOURS} hours of a year in {path}, got {len(times)}; use another file"
        )
    hours = list_hours(times.tz)
    late = np.abs((times - hours).total_seconds().to_numpy() / 3600.0 - 0.5) > 0.75
    if late.any():
        raise InputError(
            f"expected each hour of a year once in {path}, in order, got row "
            f"{int(late.argmax()) + 1} at {times[late.argmax()]:%d %B, %H:%M}; use another file"
        )


def refuse_missing_hours(weather: Weather, path: str) -> None:
    """Raise InputError where radiation is missing."""
    rows = weather.values.to_numpy()
    is_missing = ~((rows >= 0) & (rows < MISSING_WM2)).all(axis=1)
    if is_missing.any():
        raise InputError(
            f"expected global, diffuse and direct radiation in every hour of {path}, got "
            f"{count_things(int(is_missing.sum()), 'hour')} in which one is missing (9999, or "
            f"below 0), the first on {weather.times[is_missing.argmax()]:%d %B, %H:%M}; use "
            "another file"
        )


def refuse_other_sun(weather: Weather, path: str) -> None:
    """Raise InputError for radiation that does not fit the sun over the station."""
    ghi, dhi, dni = weather.values.to_numpy().T
    rises = measure_rises(weather)
    rise = rises[len(rises) // 2]
    ceiling = import_pvlib().irradiance.get_extra_radiation(weather.times).to_numpy()
    got, total = "", max(float(ghi.sum()), 1.0)
    gaps, excess = np.abs(ghi - dhi - dni * rise), np.maximum(ghi - ceiling * rise, 0.0)
    share = total / float((ceiling * rise).sum())
    is_high = rise > DAYLIGHT_RISE
    is_dark = find_gaps(ghi.reshape(-1, 24) > 0.0).ravel() & is_high
    worst = int(np.maximum(np.maximum(gaps, excess), np.maximum(dni - ceiling, 0.0)).argmax())
    if excess.sum() > GREATEST_EXCESS * total or excess[worst] > GREATEST_GAP_WM2:
        got = (
            f"{excess.sum() / total:.1%} of the year's radiation beyond what reaches the "
            "atmosphere at its hours: values, hours, time zone or place are wrong"
        )
    elif gaps[worst] > GREATEST_GAP_WM2 or (dni > ceiling).any():
        got = (
            f"global radiation of {ghi[worst]:g} W/m2 beside {dhi[worst]:g} diffuse and "
            f"{dni[worst]:g} direct on {weather.times[worst]:%d %B, %H:%M}"
        )
    elif np.abs(ghi - dhi - dni).sum() < MOVED * gaps.sum() and gaps.sum() > LEAST_MOVED * total:
        got = "direct radiation on level ground in place of that towards the sun"
    elif gaps.sum() > GREATEST_GAP * total:
        got = f"diffuse and direct radiation {gaps.sum() / total:.0%} off the global"
    elif share < LEAST_CLEARNESS:
        got = f"only {share:.1%} of what reaches the atmosphere in a year"
    elif is_dark.any():
        got = (
            f"{count_things(int(is_dark.sum()), 'hour')} without radiation under a high sun, the "
            f"first on {weather.times[is_dark.argmax()]:%d %B, %H:%M}"
        )
    if got:
        raise InputError(
            f"expected radiation in {path} that fits the sun over its station, got {got}; use "
            "another file"
        )
    brightness = float(np.quantile((ghi / ceiling)[is_high] / rise[is_high], BRIGHTEST))
    warn_of_unusual_sun(path, brightness, weather)
    warn_of_moved_sun(weather, rises, path)
    warn_of_repeated_hours(weather, path)


def find_gaps(is_lit: np.ndarray) -> np.ndarray:
    """Return the hours (days, 24) without light between lit ones, or of days without any."""
    before, after = (np.logical_or.accumulate(x, axis=1) for x in (is_lit, is_lit[:, ::-1]))
    is_between = before & after[:, ::-1]
    return ~is_lit & (is_between | ~is_lit.any(axis=1, keepdims=True))


def warn_of_unusual_sun(path: str, brightness: float, weather: Weather) -> None:
    """Warn of bright months without direct radiation, and of hours too dull or too bright."""
    ghi, dhi, _ = weather.values.groupby(weather.times.month).sum().to_numpy().T
    is_dull = (dhi > (1 - LEAST_DIRECT) * ghi) & (ghi > BRIGHT_MONTH * ghi.sum())
    low, high = USUAL_BRIGHTNESS
    if is_dull.any():
        warn(
            path,
            f"has hardly any direct radiation in {count_things(int(is_dull.sum()), 'month')} with "
            "much sun, which no climate has, so slopes that face the sun get too little; use a "
            "file with direct radiation",
        )
    elif not low <= brightness <= high:
        warn(
            path,
            f"has {brightness:.0%} of what reaches the atmosphere in its brightest hours, and 70 % "
            f"are usual, so all sun may be too {'low' if brightness < low else 'high'}; check that "
            "the unit is W/m2",
        )


def warn_of_repeated_hours(weather: Weather, path: str) -> None:
    """Warn of days with the radiation of an earlier one, and of hours with that of the last."""
    hours = weather.values.to_numpy()
    days = hours.reshape(-1, 24, 3)
    _, first, kind = np.unique(
        days.reshape(len(days), -1), axis=0, return_index=True, return_inverse=True
    )
    is_lit = (days[:, :, 0] > 0).sum(axis=1) >= FEWEST_EQUAL
    copies = np.flatnonzero(is_lit & (first[kind.ravel()] < np.arange(len(days))))
    if len(copies):
        copy, source = (
            f"{weather.times[24 * k]:%d %B}" for k in (copies[0], first[kind[copies[0]]])
        )
        warn(
            path,
            f"repeats the radiation of an earlier day on {count_things(len(copies), 'day')}, first "
            f"that of {source} on {copy}; check that days were not copied, and use another file if "
            "they were",
        )
    is_same = (hours[1:] == hours[:-1]).all(axis=1) & (hours[1:, 0] >= LEAST_STUCK_WM2)
    is_stuck = is_same[:-2] & is_same[1:-1] & is_same[2:]
    if is_stuck.any():
        warn(
            path,
            f"holds the same radiation for four hours or more, first on "
            f"{weather.times[is_stuck.argmax()]:%d %B, %H:%M}; check that its instrument did not "
            "stand still, and use another file if it did",
        )


def warn_of_moved_sun(weather: Weather, rises: np.ndarray, path: str) -> None:
    """Warn of direct radiation that fits the sun of another time better (`rises` as measured).

    Clocks put forward are off in a half of the year.
    """
    ghi, dhi, dni = weather.values.to_numpy().T
    first, last = SUMMER_DAYS
    day = weather.times.day_of_year.to_numpy()
    is_summer = (day > first) & (day <= last)
    moved: dict[str, list[str]] = {}
    for months, is_part in (("April to September", is_summer), ("October to March", ~is_summer)):
        gaps = np.abs(ghi - dhi - dni * rises)[:, is_part].sum(axis=1)
        best, gap = int(gaps.argmin()), gaps[len(gaps) // 2]
        if gaps[best] < MOVED * gap and gap > LEAST_MOVED * ghi[is_part].sum():
            minutes = SUN_MINUTES[best + 1]
            text = f"about {abs(minutes)} minutes {'before' if minutes < 0 else 'after'} its times"
            moved.setdefault(text, []).append(f" from {months}")
    if moved:
        parts = [text + (months[0] if len(months) == 1 else "") for text, months in moved.items()]
        warn(
            path,
            "has diffuse and direct radiation that fit the sun "
            f"{' and '.join(parts)}; check the longitude and time zone of its station, its clock "
            "in summer, and that its stamps end their hours",
        )


def measure_rises(weather: Weather) -> np.ndarray:
    """Return sines (k, n) of the sun's elevation at the times and up to 100 minutes beside them.

    Each is the mean around its time, and 0 below the horizon.
    """
    place = import_pvlib().location.Location(*weather.where)
    zeniths = [
        place.get_solarposition(shift_hours(weather.times, minutes / 60))["zenith"].to_numpy()
        for minutes in SUN_MINUTES
    ]
    rises = np.maximum(np.cos(np.radians(zeniths)), 0.0)
    return (rises[:-2] + rises[1:-1] + rises[2:]) / 3.0


def shift_hours(times: Any, hours: float) -> Any:
    """Return times that are later by some hours."""
    pandas = import_module("pandas")
    return pandas.DatetimeIndex(times) + pandas.Timedelta(hours=hours)


def locate_station(station: dict[str, Any]) -> tuple[float, float]:
    """Read the latitude and longitude of a station.

    Raises ValueError for no place on Earth.
    """
    latitude, longitude = float(station["latitude"]), float(station["longitude"])
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        raise ValueError(f"a station at latitude {latitude:g} and longitude {longitude:g}")
    return latitude, longitude
