"""The treatment of damaged buildings in a file of many.

A reader refuses the file, or leaves the building out with a remark.

Readers call `damaged(error)` with one sentence for each building that they cannot read, and go on
with the next one when that returns.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from ...errors import InputError
from ...log import LOGGER, count_things

T = TypeVar("T")
Damaged = Callable[[InputError], None]

MOST_TOLD = 20  # sentences on damaged buildings; a ruined file may have a million
# NUL and halves of characters, which files and databases refuse.
UNREADABLE = re.compile("[\0\ud800-\udfff]")


def refuse(error: InputError) -> None:
    """Refuse the whole file because of one damaged building."""
    raise error


class SkippedBuildings:
    """Counts a file's damaged buildings, and reports the first MOST_TOLD in full."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self, error: InputError) -> None:
        self.count += 1
        if self.count <= MOST_TOLD:
            LOGGER.warning("left out: %s", error)

    def iterate_sound(self, buildings: Iterator[T]) -> Iterator[T]:
        """Yield the `buildings` that could be read; raises InputError where there are none."""
        is_empty = True
        for building in buildings:
            is_empty = False
            yield building
        self.refuse_all([is_empty])

    def refuse_all(self, are_damaged: Iterable[bool]) -> None:
        """Raise InputError where every building is damaged."""
        if self.count and all(are_damaged):
            raise InputError(
                "expected a building that can be read, got "
                f"{count_things(self.count, 'damaged one')} and no other; make the files anew with "
                "`hiproof build` or `hiproof reconstruct`"
            )

    @property
    def exit_code(self) -> int:
        """0 if every building could be read, else 2."""
        return 2 if self.count else 0

    def describe(self) -> str:
        """Say how many are left out, to complete a summary; empty if none is."""
        return f", {count_things(self.count, 'damaged building')} left out" if self.count else ""


def readable(value: Any) -> Any:
    r"""Replace NUL and halves of characters in a JSON value by U+FFFD.

    >>> ascii(readable(["a\ud800"]))
    "['a\\ufffd']"
    """
    if isinstance(value, str):
        return UNREADABLE.sub("\ufffd", value)
    if isinstance(value, dict):
        return {readable(name): readable(inner) for name, inner in value.items()}
    return [readable(inner) for inner in value] if isinstance(value, list) else value


def explain_unreadable(path: Any, expected: str, error: Exception) -> InputError:
    """Make the error for a text file that is missing, or whose bytes are no text."""
    if isinstance(error, UnicodeDecodeError):
        got = "one that is not in UTF-8; save it as UTF-8"
    elif isinstance(error, FileNotFoundError):
        got = "none; check the path"
    else:
        got = f"{error}; check the path"
    return InputError(f"expected {expected} at {path}, got {got}")


def finite(value: Any) -> Any:
    """Replace NaN and infinities in a JSON value by null: JSON does not know them."""
    if isinstance(value, dict):
        return {name: finite(inner) for name, inner in value.items()}
    if isinstance(value, list):
        return [finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def excerpt(value: Any) -> str:
    """Write a value as briefly as a sentence can hold it."""
    text = "null" if value is None else repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
