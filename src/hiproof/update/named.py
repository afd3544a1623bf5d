"""Surveys as the user names them: `--epoch 2014=a/ --epoch 2020-05-01=b/`."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

from ..errors import InputError
from ..read.pointcloud import expand_paths
from .dates import read_date

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
'first=a/'; name each survey by its year or day
    """
    pairs = [read_epoch(text) for text in texts]
    counts = Counter(name for name, _ in pairs)
    name, count = counts.most_common(1)[0]
    if count > 1:
        raise InputError(
            f"expected every --epoch once, got {name} {count} times; put its clouds into one "
            "folder, or name surveys by their day"
        )
    clouds: dict[str, str] = {}
    for name, path in sorted(pairs, reverse=True):
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
        is_name = bool(re.fullmatch(r"[12]\d{3}", name)) or read_date(name) == name
    except InputError:
        is_name = False
    if not is_name or not path:
        raise InputError(f"expected {FORM}, got {text!r:.60}; name each survey by its year or day")
    return name, path
