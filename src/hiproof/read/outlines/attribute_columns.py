"""Attributes of a vector file in the types that its columns declare.

pyogrio makes decimals of whole numbers and of booleans where a feature has none. A year became
1950.0, a yes 1.0, and an id of 17 digits its neighbour's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

LARGEST_EXACT = 2.0**53  # whole numbers below it are themselves as decimals


def restore_declared_types(
    names: Sequence[str],
    declared: Sequence[str],
    columns: list[np.ndarray],
    known_of: Callable[[str], np.ndarray],
) -> list[np.ndarray]:
    """Return the `columns` (n,) in their `declared` types, None for no value.

    These are whole numbers and booleans. `known_of` reads the values (k,) of one column again, of
    the features that have one and in their order, for numbers that decimals do not hold.
    """
    whole = []
    for name, kind, column in zip(names, declared, columns, strict=True):
        if not (
            kind.startswith(("int", "uint", "bool")) and np.issubdtype(column.dtype, np.floating)
        ):
            whole.append(shortest(column) if column.dtype == np.float32 else column)
            continue
        is_known = np.isfinite(column)
        set_values = column[is_known]
        if (np.abs(set_values) >= LARGEST_EXACT).any() and len(repeat := known_of(name)) == len(
            set_values
        ):
            set_values = repeat
        values = np.full(len(column), None, dtype=object)
        values[is_known] = [
            bool(value) if kind == "bool" else int(value) for value in set_values.tolist()
        ]
        whole.append(values)
    return whole


def shortest(column: np.ndarray) -> np.ndarray:
    """Return single precision (n,) as the decimals that it is written by.

    Doubling the digits of 0.2 would make 0.20000000298.

    >>> shortest(np.array([0.2, np.nan], np.float32)).tolist()
    [0.2, nan]
    """
    return np.array([float(str(value)) for value in column])


def make_known_condition(name: str, where: str | None) -> str:
    """Return the condition `where`, if any, and that the attribute `name` is set.

    >>> make_known_condition("year", "year < 1950 or listed")
    '(year < 1950 or listed) and "year" is not null'
    """
    return (f"({where}) and " if where else "") + f"{quote(name)} is not null"


def quote(name: str) -> str:
    """Quote the name of a table or a column.

    >>> print(quote('so "called"'))
    "so ""called\"""
    """
    return '"' + name.replace('"', '""') + '"'
