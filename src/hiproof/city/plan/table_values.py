"""Values of columns, converted to those of an override.

Columns are a table's or the footprints'. What no building can have is left out and counted.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from ...errors import InputError
from ...read.numbers import (
    FIRST_YEAR,
    LAST_YEAR,
    NumberColumn,
    SkippedValues,
    is_empty,
    read_number,
    read_year,
    warn_of_values,
)
from ...read.plausible import HIGHEST_BUILDING_M
from ...settings import ReadSettings

if TYPE_CHECKING:
    from ...model import Footprint

YES_OR_NO = dict.fromkeys(("1", "1.0", "true", "yes", "t", "y"), True) | dict.fromkeys(
    ("0", "0.0", "false", "no", "f", "n", ""), False
)
"""What tables say for true and false."""


def check_number_columns(footprints: Iterable[Footprint], read: ReadSettings) -> None:
    """Warn of numbers in columns of the footprints that are left out.

    Raises InputError for a year of construction that no footprint has.
    """
    if read.year_column:
        subject = "the footprints"
        refuse_missing_column(footprints, read.year_column, subject, "the year of construction")
    rows = ((footprint.id, footprint.attributes) for footprint in footprints)
    warn_of_values(rows, list_number_columns(read), "columns of the footprints")


def list_number_columns(read: ReadSettings) -> list[NumberColumn]:
    """Return the columns of footprints whose numbers the settings name."""
    ranges = {read.raised_column: (0.0, HIGHEST_BUILDING_M)}
    if read.fallback_roof_height or read.fallback_ground_height:
        from ...parametric.fallback import find_fallback_ranges

        ranges |= find_fallback_ranges(read)
    columns = [
        NumberColumn(
            name,
            f"{name} from {least:g} to {greatest:g} m",
            functools.partial(read_number, least=least, greatest=greatest),
        )
        for name, (least, greatest) in ranges.items()
        if name
    ]
    if name := read.year_column:
        columns.append(
            NumberColumn(name, f"{name} as a year from {FIRST_YEAR} to {LAST_YEAR}", read_year)
        )
    return columns


def refuse_missing_column(
    features: Iterable[Footprint], column: str, subject: str, meaning: str
) -> None:
    """Raise InputError where no feature has a column."""
    columns = {name for feature in features for name in feature.attributes}
    if columns and column not in columns:
        raise InputError(
            f"expected a column {column} of {subject} ({', '.join(sorted(columns))}), got none; "
            f"name the one that holds {meaning}"
        )


def select_possible(record: Mapping[str, Any], id: str, skipped: SkippedValues) -> dict[str, Any]:
    """Return the record without empty and impossible values.

    The latter are noted in `skipped`.
    """
    result = {}
    for key, cell in record.items():
        value = convert_value(key, cell)
        if is_empty(value):
            continue
        if is_possible(key, value):
            result[key] = value
        else:
            lower, upper = find_range(key) or (0.0, 0.0)
            skipped.note(f"{key} from {lower:g} to {upper:g}", value, id)
    return result


def convert_value(key: str, value: Any) -> Any:
    """Convert a table's value to that of the override's key.

    >>> convert_value("z_ground", "0,5 m"), convert_value("leave_out", "0"), convert_value("id", 7)
    (0.5, False, '7')
    """
    if key == "leave_out":
        return YES_OR_NO.get(str(value).strip().lower(), value)
    if find_range(key) and isinstance(value, str):
        number = read_number(value)
        return value if number is None else number
    return str(value) if key == "id" else value


def is_possible(key: str, value: Any) -> bool:
    """Return whether a building can have the value.

    It is a number within the key's range; other keys have none.

    >>> is_possible("z_ground", -9999), is_possible("parts", 0), is_possible("parts",
    ...     [{}]), is_possible("note", -9999)
    (False, False, True, True)
    """
    bounds = find_range(key)
    if bounds is None or (key == "parts" and isinstance(value, list)):
        return True
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_number and bounds[0] <= value <= bounds[1]


def find_range(key: str) -> tuple[float, float] | None:
    """Return the least and largest possible value of a key, None without one.

    What checks overrides is imported only for runs that have some.
    """
    from ...parametric.override import RANGES

    return RANGES.get(key)
