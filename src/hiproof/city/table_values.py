"""Values of columns, converted to those of an override.

Columns are a table's or the footprints'.

Columns are filled by people and programs: text stands where numbers should, and codes such as
-9999, or a block height of 0, stand for "unknown". What no building can have is left out and
counted, so that one cell spoils neither its building nor the run.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ..errors import InputWarning

MOST_SHOWN_VALUES = 3  # values that a sentence shows

YES_OR_NO = dict.fromkeys(("1", "1.0", "true", "yes", "t", "y"), True) | dict.fromkeys(
    ("0", "0.0", "false", "no", "f", "n", ""), False
)
"""What tables say for true and false."""


@dataclass
class SkippedValues:
    """Values that no building can have, by key, as "VALUE of ID"."""

    source: str
    values: dict[str, list[str]] = field(default_factory=dict)

    def possible(self, record: Mapping[str, Any], id: str) -> dict[str, Any]:
        """Return the record without empty and impossible values.

        The latter are noted.
        """
        result = {}
        for key, value in record.items():
            value = convert_value(key, value)
            if is_empty(value):
                continue
            if is_possible(key, value):
                result[key] = value
            else:
                self.values.setdefault(key, []).append(f"{str(value)[:20]} of {id}")
        return result

    def warn(self) -> None:
        """Warn once for each key of which values were left out."""
        for key, values in self.values.items():
            lower, upper = find_range(key) or (0.0, 0.0)
            subset = ", ".join(values[:MOST_SHOWN_VALUES]) + (
                ", ..." if len(values) > MOST_SHOWN_VALUES else ""
            )
            warnings.warn(
                f"{self.source}: expected {key} from {lower:g} to {upper:g}, left out "
                f"{len(values)} of "
                f"its values: {subset}",
                InputWarning,
            )


def convert_value(key: str, value: Any) -> Any:
    """Convert a table's value to that of the override's key.

    >>> convert_value("z_ground", "0"), convert_value("leave_out", "0"), convert_value("id", 7)
    (0.0, False, '7')
    """
    if key == "leave_out":
        return YES_OR_NO.get(str(value).strip().lower(), value)
    if find_range(key) and isinstance(value, str):
        try:
            return float(value) if value.strip() else None
        except ValueError:
            return value
    return str(value) if key == "id" else value


def is_empty(value: Any) -> bool:
    """Return whether a cell is empty. A 0 is a value.

    >>> is_empty(0.0), is_empty(None), is_empty(" ")
    (False, True, True)
    """
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return True
    return isinstance(value, str) and not value.strip()


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
    from ..parametric.override import possible_range

    return possible_range(key)
