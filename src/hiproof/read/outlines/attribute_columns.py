"""Attributes of a vector file in the types that its columns declare.

pyogrio makes decimals of whole numbers and of booleans where a feature has none. A year became
1950.0, a yes 1.0, and an id of 17 digits its neighbour's.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

LARGEST_EXACT = 2.0**53  # whole numbers below it are themselves as decimals


def restore_declared_type(
    declared: str, column: np.ndarray, read_text: Callable[[], np.ndarray]
) -> np.ndarray:
    """Return a `column` (n,) of whole numbers or booleans in its declared type, None for no value.

    `read_text` reads it again as text (n,), for numbers that decimals do not hold.
    """
    is_whole = declared.startswith(("int", "uint", "bool"))
    if not (is_whole and np.issubdtype(column.dtype, np.floating)):
        return shortest(column) if column.dtype == np.float32 else column
    is_known = np.isfinite(column)
    values = column[is_known].tolist()
    if (np.abs(values) >= LARGEST_EXACT).any():
        values = [text or value for text, value in zip(read_text()[is_known], values, strict=True)]
    result = np.full(len(column), None, dtype=object)
    result[is_known] = [bool(v) if declared == "bool" else int(v) for v in values]
    return result


def shortest(column: np.ndarray) -> np.ndarray:
    """Return single precision (n,) as the decimals that it is written by.

    Doubling the digits of 0.2 would make 0.20000000298.

    >>> shortest(np.array([0.2, np.nan], np.float32)).tolist()
    [0.2, nan]
    """
    return np.array([float(str(value)) for value in column])


def attribute_rows(names: list[str], columns: list[np.ndarray], count: int) -> list[dict[str, Any]]:
    """Return a dictionary of plain values a feature, without None and NaN."""
    values = [[plain_value(value) for value in column.tolist()] for column in columns]
    return [
        {
            name: column[row]
            for name, column in zip(names, values, strict=True)
            if column[row] is not None
        }
        for row in range(count)
    ]


def plain_value(value: Any) -> Any:
    """Convert a value to JSON's: NaN to None, dates and bytes (hex) to text, arrays to lists."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, float) and not np.isfinite(value):
        return None
    if hasattr(value, "isoformat"):
        return value.isoformat()
    return value.hex() if isinstance(value, bytes) else value


def quote(name: str) -> str:
    """Quote the name of a table or a column.

    >>> print(quote('so "called"'))
    "so ""called\"""
    """
    return '"' + name.replace('"', '""') + '"'
