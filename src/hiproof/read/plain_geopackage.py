"""Features of a plain GeoPackage through the standard library's SQLite.

GDAL reads every GeoPackage, but takes 30 MB of memory and a tenth of a second to load. What is
unusual about a table (a view, a date, a value of another type than its column's) is left to it.
"""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .sql import quote
from .wkb import decode_geometries

FILE_START, APPLICATION_ID = b"SQLite format 3\0", b"GPKG"
ID_POSITION = 68  # byte of a file of SQLite at which the application's id stands
ENVELOPE_SIZES = (0, 32, 48, 48, 64)  # bytes, by the indicator in a geometry's flags
HEADER_SIZE = 8  # bytes of a geometry before its envelope
EXTENDED_FLAG = 0b0010_0000  # of a geometry that is no WKB
GEOMETRY_KINDS = ("POLYGON", "MULTIPOLYGON", "GEOMETRY")
PYTHON_TYPES = {
    **dict.fromkeys(("SMALLINT", "MEDIUMINT", "INT", "INTEGER"), int),
    **dict.fromkeys(("REAL", "DOUBLE"), float),
    "BOOLEAN": bool,
    "TEXT": str,
}
"""Types of a column whose values SQLite gives as they are declared."""

FEATURE_TABLES = """
select g.table_name, g.column_name, g.geometry_type_name, s.organization, s.organization_coordsys_id
from gpkg_geometry_columns g join gpkg_spatial_ref_sys s using (srs_id)
join sqlite_master m on m.name = g.table_name and m.type = 'table'
"""

Features = tuple[dict[str, Any], np.ndarray, np.ndarray, list[np.ndarray]]


class Unusual(Exception):
    """A GeoPackage that is left to GDAL."""


class Layer(NamedTuple):
    """A table of features.

    It has the column of geometries with their kind, and the name of its CRS.
    """

    table: str
    geometry: str
    kind: str
    organization: str
    code: int

    @property
    def crs(self) -> str:
        return f"{self.organization}:{self.code}"


def is_geopackage(path: str | Path) -> bool:
    """Return whether a local file is a GeoPackage of version 1.2 or later."""
    try:
        with open(path, "rb") as file:
            start = file.read(ID_POSITION + len(APPLICATION_ID))
    except OSError:
        return False
    return start.startswith(FILE_START) and start.endswith(APPLICATION_ID)


def read_plain_geopackage(path: str | Path, layer: str | int | None) -> Features | None:
    """Read metadata, numbers, geometries and attribute columns of a layer.

    Returns None for a file that GDAL has to read.
    """
    try:
        with closing(open_database(path)) as database:
            chosen = choose_layer(database, layer)
            key, columns = list_columns(database, chosen)
            names = ", ".join(quote(name) for name in (key, chosen.geometry, *columns))
            rows = database.execute(f"select {names} from {quote(chosen.table)}").fetchall()
            numbers, blobs, *values = zip(*rows, strict=True)
            return (
                {"fields": list(columns), "crs": chosen.crs, "total_bounds": None},
                np.array(numbers),
                decode_geometries(np.array([strip_header(blob) for blob in blobs], dtype=object)),
                [convert(of, kind) for of, kind in zip(values, columns.values(), strict=True)],
            )
    except (Unusual, sqlite3.Error, ValueError):  # ValueError: no rows
        return None


def read_plain_crs(path: str | Path, layer: str | int | None) -> str | None:
    """Return the code of a layer's CRS, None for a file that GDAL has to read."""
    try:
        with closing(open_database(path)) as database:
            return choose_layer(database, layer).crs
    except (Unusual, sqlite3.Error):
        return None


def open_database(path: str | Path) -> sqlite3.Connection:
    return sqlite3.connect(f"{Path(path).resolve().as_uri()}?mode=ro", uri=True)


def choose_layer(database: sqlite3.Connection, layer: str | int | None) -> Layer:
    """Return the layer of that name, or the only one."""
    layers = [Layer(*row) for row in database.execute(FEATURE_TABLES)]
    chosen = [one for one in layers if layer is None or one.table == layer]
    if (
        len(chosen) != 1
        or chosen[0].kind.upper() not in GEOMETRY_KINDS
        or chosen[0].organization != "EPSG"
    ):
        raise Unusual
    return chosen[0]


def list_columns(database: sqlite3.Connection, layer: Layer) -> tuple[str, dict[str, type]]:
    """Return the column of feature numbers, and the types of the attributes."""
    keys, columns = [], {}
    for _, name, declared, _, _, is_key in database.execute(
        f"pragma table_info({quote(layer.table)})"
    ):
        declared_type = declared.upper().partition("(")[0]
        if is_key and declared_type == "INTEGER":
            keys.append(name)
        elif is_key or (name != layer.geometry and declared_type not in PYTHON_TYPES):
            raise Unusual
        elif name != layer.geometry:
            columns[name] = PYTHON_TYPES[declared_type]
    if len(keys) != 1:
        raise Unusual
    return keys[0], columns


def strip_header(blob: Any) -> bytes | None:
    """Return the WKB of a geometry in GeoPackage's own form."""
    if blob is None:
        return None
    if not isinstance(blob, bytes) or blob[:2] != b"GP" or blob[3] & EXTENDED_FLAG:
        raise Unusual
    indicator = blob[3] >> 1 & 0b111
    if indicator >= len(ENVELOPE_SIZES):
        raise Unusual
    return blob[HEADER_SIZE + ENVELOPE_SIZES[indicator] :]


def convert(values: tuple, kind: type) -> np.ndarray:
    """Convert the values (n,) of a column, None where a feature has none."""
    stored_kind = int if kind is bool else kind
    if any(value is not None and type(value) is not stored_kind for value in values):
        raise Unusual
    column = np.empty(len(values), dtype=object)
    column[:] = values
    if kind is bool:
        column[:] = [None if value is None else bool(value) for value in values]
    return column
