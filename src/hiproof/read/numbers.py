"""Numbers in columns that people and programs fill.

What is plain is read: a decimal comma, a unit of length. Codes such as -9999 stand for "unknown",
and some text is no number. What no building can have is left out, counted and named, so that one
cell spoils neither its building nor the run.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ..errors import warn
from .names import READING

# Metres of the units of length that may follow a number.
METRES_OF: dict[str, float] = READING["length_units"]

PLAIN_NUMBER = re.compile(
    r"([+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:e[+-]?\d+)?)\s*([a-z']*)", re.IGNORECASE
)
THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:,\d{3})+\D*")  # 1,234 may be either
PLAIN_YEAR = re.compile(
    r"(\d{4})(?:\.0+|-\d\d(?:-\d\d.*)?)?"
)  # alone, or a date that begins with it
FIRST_YEAR, LAST_YEAR = 1000, 2100  # years of construction that a register may hold

MOST_SHOWN_VALUES = 3  # values that a sentence shows


class NumberColumn(NamedTuple):
    """A column of numbers, what is expected, and what reads a value, None if unknown."""

    name: str
    expected: str
    read: Callable[[Any], float | None]


@dataclass
class SkippedValues:
    """Values that no building can have, by what was expected, as "VALUE of ID"."""

    source: str
    values: dict[str, list[str]] = field(default_factory=dict)

    def note(self, expected: str, value: Any, id: str) -> None:
        self.values.setdefault(expected, []).append(f"{str(value)[:20]} of {id}")

    def warn(self) -> None:
        """Warn once for each kind of values that were left out."""
        for expected, values in self.values.items():
            shown = values[:MOST_SHOWN_VALUES] + ["..."] * (len(values) > MOST_SHOWN_VALUES)
            warn(
                self.source,
                f"expected {expected}, left out {len(values)} of its values: {', '.join(shown)}",
            )


def warn_of_values(
    rows: Iterable[tuple[str, Mapping[str, Any]]], columns: list[NumberColumn], source: str
) -> None:
    """Warn of values of `rows` (ids, attributes) that columns leave out, but for empty ones."""
    skipped = SkippedValues(source)
    for id, attributes in rows if columns else ():
        for column in columns:
            value = attributes.get(column.name)
            if not is_empty(value) and column.read(value) is None:
                skipped.note(column.expected, value, id)
    skipped.warn()


def read_number(value: Any, least: float = -math.inf, greatest: float = math.inf) -> float | None:
    """Read a number as people write it, in metres where it has a unit of length.

    None for what is no plain number, or not from `least` to `greatest`.

    >>> [read_number(text) for text in ("12", "12 m", "12,5", "40 ft", "ca. 12", "1,234")]
    [12.0, 12.0, 12.5, 12.192, None, None]
    """
    if isinstance(value, str):
        match = PLAIN_NUMBER.fullmatch(value.strip())
        if not match or match[2].lower() not in METRES_OF or THOUSANDS.fullmatch(value.strip()):
            return None
        number = round(float(match[1].replace(",", ".")) * METRES_OF[match[2].lower()], 9)
    else:
        try:
            number = math.nan if isinstance(value, bool) else float(value)
        except (TypeError, ValueError, OverflowError):
            return None
    return number if math.isfinite(number) and least <= number <= greatest else None


def read_year(value: Any) -> int | None:
    """Read a year of construction, or that of a date; None for anything else.

    >>> [read_year(text) for text in (1950.0, "1950", "1950-03-01", "ca. 1950", 9999, "19th")]
    [1950, 1950, 1950, None, None, None]
    """
    match = PLAIN_YEAR.fullmatch(str(value).strip())
    year = int(match[1]) if match else 0
    return year if FIRST_YEAR <= year <= LAST_YEAR else None


def is_empty(value: Any) -> bool:
    """Return whether a cell is empty. A 0 is a value.

    >>> is_empty(0.0), is_empty(None), is_empty(" ")
    (False, True, True)
    """
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return True
    return isinstance(value, str) and not value.strip()
