"""The date of a survey.

It is named, or comes from the time of points, or from a file's header.
"""

from __future__ import annotations

import datetime
import struct
import warnings
from pathlib import Path

import numpy as np

from ..errors import InputError, InputWarning
from ..masking import mask
from ..read.remote import is_url

GPS_EPOCH = datetime.datetime(1980, 1, 6)  # when GPS time begins
ADJUSTED_S = 1e9  # seconds that adjusted standard GPS time leaves out
LAS_HEAD_BYTES = 94  # of a LAS file, up to the date
FIRST_POINTS = 1000  # whose time tells the day of a file


def find_survey_date(clouds: tuple[str, ...], named: str = "") -> str:
    """Return the date of a survey as 2014-02-09: the latest of its files.

    Raises InputError where `named` is no date, or where nothing tells one.
    """
    if named:
        return read_date(named)
    timed = [date for date in map(date_by_points, clouds) if date]
    if timed:
        return max(timed).isoformat()
    headed = [date for date in map(date_by_header, clouds) if date]
    if not headed:
        raise InputError(
            f"expected clouds that tell when they were surveyed, got {mask(clouds[0])} without a "
            "date; name the day of the survey with --date 2014-02-09"
        )
    date = max(headed).isoformat()
    warnings.warn(
        f"{mask(clouds[0])}: holds no time of its points; the survey is dated {date}, when the "
        "file was written; name the day of the survey with --date",
        InputWarning,
    )
    return date


def read_date(text: str) -> str:
    """Return a date in its usual form. Raises InputError for anything else."""
    try:
        return datetime.date.fromisoformat(text).isoformat()
    except ValueError as error:
        raise InputError(
            f"expected a date as --date 2014-02-09, got {text!r:.40}; write year, month and day"
        ) from error


def date_by_header(path: str) -> datetime.date | None:
    """Return the day on which a LAS file was written, None where it names none."""
    head = read_head(path)
    if head is None:
        return None
    day, year = struct.unpack_from("<HH", head, 90)
    if not (1 <= day <= 366 and year >= 1980):
        return None
    return datetime.date(year, 1, 1) + datetime.timedelta(days=day - 1)


def date_by_points(path: str) -> datetime.date | None:
    """Return the last day on which the first points of a LAS file were measured.

    None where their times are not adjusted standard GPS time.
    """
    head = read_head(path)
    if head is None or not struct.unpack_from("<H", head, 6)[0] & 1:
        return None
    import laspy

    try:
        with laspy.open(path) as file:
            points = next(file.chunk_iterator(FIRST_POINTS), None)
            times = np.asarray([] if points is None else points["gps_time"], float)
    except (OSError, ValueError, laspy.errors.LaspyException):
        return None  # the step that sorts points says what is wrong
    if not len(times) or not times.any():
        return None
    return (GPS_EPOCH + datetime.timedelta(seconds=float(times.max()) + ADJUSTED_S)).date()


def read_head(path: str) -> bytes | None:
    """Return the first bytes of a LAS file of this machine, None for another."""
    if is_url(path) or not Path(path).is_file():
        return None
    with open(path, "rb") as file:
        head = file.read(LAS_HEAD_BYTES)
    return head if len(head) == LAS_HEAD_BYTES and head.startswith(b"LASF") else None
