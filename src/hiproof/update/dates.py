"""The date of a survey.

It is named, or comes from the time of points, or from a file's header. Only days on which a survey
can have been made are used. A run of several surveys names them:
`--epoch 2014=a/ --epoch 2020-05-01=b/`.
"""

from __future__ import annotations

import datetime
import itertools
import re
import warnings
from collections.abc import Iterable, Sequence

import numpy as np

from ..errors import InputError, InputWarning
from ..masking import mask
from ..read.points.las import read_checked_facts
from ..read.points.las_header import LasFacts
from ..read.points.pointcloud import expand_paths
from ..read.remote import is_url

GPS_EPOCH = datetime.datetime(1980, 1, 6)  # when GPS time begins
ADJUSTED_S = 1e9  # seconds that adjusted standard GPS time leaves out
WEEK_S = 7 * 86400.0
"""Times (s) up to this are seconds of a GPS week, whatever the header says: nothing tells which."""

FIRST_DAY = datetime.date(1990, 1, 1)  # before airborne laser scanning; clocks not set say 1980
FIRST_POINTS = 1000  # whose time tells the day of a file


def find_survey_date(
    clouds: tuple[str, ...],
    named: str = "",
    earlier: str = "",
    earlier_clouds: tuple[str, ...] = (),
) -> str:
    """Return the date of a survey as 2014-02-09: the latest of its files.

    `earlier` is the date of the survey before, or its year, "" where it is unknown. Then a survey
    that is dated by headers has to be no older than those of the `earlier_clouds`. Raises
    InputError where `named` is no date, where nothing tells one, or where it is not after
    `earlier`. A `named` one may be the same day.
    """
    timed = "" if named else date_by_points(clouds)
    date = read_date(named) if named else timed or date_untimed(clouds)
    if not (earlier or named or timed):
        earlier = date_by_headers(earlier_clouds)
    is_same = timed and date == earlier
    if is_same or date[: len(earlier)] < earlier:
        raise InputError(
            f"expected a survey {'later' if is_same else 'no older'} than that of the run, "
            f"{earlier}, got {mask(clouds[0])} of {date}; update a run of the older survey with "
            "the newer one, or name the day of the survey with --date"
        )
    return date


def date_untimed(clouds: tuple[str, ...]) -> str:
    """Return the date of a survey by the headers of its files, with a warning."""
    date = date_by_headers(clouds)
    if not date:
        raise InputError(
            f"expected clouds that tell when they were surveyed, got {mask(clouds[0])} without a "
            "date; name the day of the survey with --date 2014-02-09"
        )
    warnings.warn(
        f"{mask(clouds[0])}: holds no time of its points that can be used; the survey is dated "
        f"{date}, when the file was written; name the day of the survey with --date",
        InputWarning,
    )
    return date


def read_date(text: str) -> str:
    """Return a date in its usual form. Raises InputError for anything else.

    One in the future is used with a warning, for surveys that are planned or simulated.
    """
    try:
        date = datetime.date.fromisoformat(text)
    except ValueError as error:
        raise InputError(
            f"expected a date as --date 2014-02-09, got {text!r:.40}; write year, month and day"
        ) from error
    if date < FIRST_DAY:
        raise InputError(f"expected a survey from 1990 on, got {date}; check its day")
    if date > datetime.date.today():
        warnings.warn(f"the survey of {date} is dated in the future; check its day", InputWarning)
    return date.isoformat()


def date_by_headers(clouds: tuple[str, ...]) -> str:
    """Return the last day on which LAS files were written, "" for none."""
    return find_latest(map(date_by_header, clouds))


def find_latest(days: Iterable[datetime.date | None]) -> str:
    known = list(filter(None, days))
    return max(known).isoformat() if known else ""


def date_by_header(path: str) -> datetime.date | None:
    """Return the day on which a LAS file was written, None where it names none."""
    facts = read_facts(path)
    if facts is None:
        return None
    day, year = facts.created
    if not (1 <= day <= 366 and FIRST_DAY.year <= year <= datetime.date.today().year):
        return None
    date = datetime.date(year, 1, 1) + datetime.timedelta(days=day - 1)
    return date if date <= datetime.date.today() else None


def date_by_points(clouds: tuple[str, ...]) -> str:
    """Return the last day on which points of LAS files were measured, "" for none."""
    return find_latest(map(date_by_first_points, clouds))


def date_by_first_points(path: str) -> datetime.date | None:
    """Return the last day on which the first points of a LAS file were measured.

    None where their times are no adjusted standard GPS time, or later than their file.
    """
    facts = read_facts(path)
    if facts is None or not facts.has_gps_time:
        return None
    import laspy

    try:
        with laspy.open(path) as file:
            points = next(file.chunk_iterator(FIRST_POINTS), None)
            times = np.asarray([] if points is None else points["gps_time"], float)
    except (OSError, ValueError, laspy.errors.LaspyException):
        return None  # the step that sorts points says what is wrong
    latest = last_second(date_by_header(path) or datetime.date.today())
    times = times[(times >= last_second(FIRST_DAY)) & (times <= latest) & (times != 0.0)]
    if not len(times) or 0.0 <= times.min() <= times.max() <= WEEK_S:
        return None
    return (GPS_EPOCH + datetime.timedelta(seconds=float(times.max()) + ADJUSTED_S)).date()


def last_second(date: datetime.date) -> float:
    """Return the end of a day, wherever it is, in adjusted standard GPS time (s)."""
    return float((date - GPS_EPOCH.date()).days + 2) * 86400.0 - ADJUSTED_S


def read_facts(path: str) -> LasFacts | None:
    """Return the header of a LAS file of this machine, None for another or a damaged one."""
    try:
        return None if is_url(path) else read_checked_facts(path)
    except InputError:
        return None  # the step that sorts points says what is wrong


FORM = "--epoch 2014=FOLDER, or --epoch 2014-05-01=FOLDER"


def choose_clouds(
    clouds: Sequence[str], epochs: Sequence[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return all clouds of a run, and the survey of each where `epochs` name surveys.

    Raises InputError for clouds beside `epochs`.
    """
    if not epochs:
        return tuple(map(str, expand_paths(tuple(clouds)))), ()
    if clouds:
        raise InputError(
            f"expected clouds or --epoch, got {clouds[0]} and {epochs[0]}; name the survey of "
            "every cloud with --epoch"
        )
    return read_epochs(epochs)


def read_epochs(texts: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the clouds of all surveys, and the name of the survey of each cloud.

    A name is a year or a date, and the newest survey comes first. Raises InputError, one sentence,
    for anything else.

    >>> read_epochs(["first=a/"])
    Traceback (most recent call last):
    ...
    hiproof.errors.InputError: expected --epoch 2014=FOLDER, or --epoch 2014-05-01=FOLDER, got \
'first=a/'; name each survey by its year or day, from 1990 on
    """
    pairs = sorted(read_epoch(text) for text in texts)
    for (earlier, _), (later, _) in itertools.pairwise(pairs):
        if later.startswith(earlier):
            raise InputError(
                f"expected every --epoch once, got {earlier} and {later}; put its clouds into one "
                "folder, or name surveys by their day"
            )
    clouds: dict[str, str] = {}
    for name, path in reversed(pairs):
        for cloud in map(str, expand_paths((path,))):
            if cloud in clouds:
                raise InputError(
                    f"expected other clouds in each --epoch, got {cloud} in {clouds[cloud]} and "
                    f"{name}; name each of them once"
                )
            clouds[cloud] = name
    return tuple(clouds), tuple(clouds.values())


def read_epoch(text: str) -> tuple[str, str]:
    """Read one survey: its name, and the path of its clouds."""
    name, _, path = text.partition("=")
    try:
        day = f"{name}-01-01" if re.fullmatch(r"\d{4}", name) else name
        is_name = read_date(day) == day
    except InputError:
        is_name = False
    if not is_name or not path:
        raise InputError(
            f"expected {FORM}, got {text!r:.60}; name each survey by its year or day, from 1990 on"
        )
    return name, path
