"""Which column of a table of points holds what."""

from __future__ import annotations

from collections.abc import Sequence

NAMES = {
    "x": ("x", "east", "easting", "x_coord", "point_x"),
    "y": ("y", "north", "northing", "y_coord", "point_y"),
    "z": ("z", "height", "elevation", "z_coord", "point_z"),
    "classification": ("classification", "class", "scalar_classification"),
}


def find_columns(header: Sequence[str]) -> tuple[int, ...] | None:
    """Return the indices of x, y, z and classification among column names.

    Classification is left out where there is none.

    Returns None unless x, y and z are named.

    >>> find_columns(["Intensity", "X", "Y", "Z", "Classification"])
    (1, 2, 3, 4)
    """
    names = [name.strip().strip("\"'").lower() for name in header]
    result = []
    for targets in NAMES.values():
        matches = [names.index(alias) for alias in targets if alias in names]
        result += matches[:1]
    return tuple(result) if len(result) >= 3 and names[result[2]] in NAMES["z"] else None
