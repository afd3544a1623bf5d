"""Footprints of a GeoParquet file, in pyogrio's shape."""

from __future__ import annotations

import io
import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyogrio
import shapely
from pyogrio.errors import FeatureError
from pyproj import CRS

from ..errors import InputError
from .attribute_columns import shortest
from .geoparquet import (
    attribute_names,
    geometries_in,
    geometry_column,
    open_parquet,
    read_rows,
)

ROW, FID = "hiproof_row", "hiproof_fid"
"""Columns of the table that answers a condition, of names that no file has."""


def parquet_crs(path: str | Path) -> CRS | None:
    """Return the CRS that a GeoParquet file names, None where it leaves it open."""
    with open_parquet(path) as file:
        return geometry_column(file, path).crs


def read_parquet(
    path: str | Path,
    layer: str | int | None,
    where: str | None,
    box_in: Callable[[CRS | None], tuple[float, ...] | None],
) -> tuple[dict[str, Any], np.ndarray, np.ndarray, list[np.ndarray]]:
    """Read metadata, row numbers, geometries and columns of a file.

    Metadata are fields, crs and total_bounds.

    `box_in` gives the box that rows have to meet, in the file's CRS, None for all rows. `where` is
    a condition in SQL. Raises InputError where the file or the condition cannot be read.
    """
    refuse_layer(path, layer)
    with open_parquet(path) as file:
        column = geometry_column(file, path)
        box = box_in(column.crs)
        names = attribute_names(file, column)
        extent = None if box is None else shapely.box(*box)
        table, numbers = read_rows(file, column, names, extent)
    if where and len(table):
        chosen = select_rows(table.select(names), where, path)
        table, numbers = table.take(chosen), numbers[chosen]
    meta = {"fields": names, "crs": column.crs, "total_bounds": column.bounds}
    columns = [convert_values(table.column(name)) for name in names]
    return meta, numbers, geometries_in(table, column), columns


def refuse_layer(path: str | Path, layer: str | int | None) -> None:
    """Raise InputError for another layer than the one that GDAL names after the file."""
    stem = Path(str(path).partition("?")[0]).stem
    if layer not in (None, 0, stem):
        raise InputError(
            f"expected no --layer for {path}, which holds one table, got {layer!r}; leave it out"
        )


def convert_values(column: Any) -> np.ndarray:
    """Return plain values (n,) of a column, None where a row has none.

    Lists and fields of fields become JSON text.
    """
    from pyarrow import types

    values = np.empty(len(column), object)
    if types.is_dictionary(column.type):
        column = column.cast(column.type.value_type)
    kind = column.type
    if types.is_nested(kind):
        texts = [None if v is None else json.dumps(v, default=str) for v in column.to_pylist()]
        values[:] = texts
    elif types.is_float32(kind):
        values[:] = shortest(np.array(column.to_numpy(), np.float32))
    elif types.is_decimal(kind):
        values[:] = column.cast("float64").to_pylist()
    elif types.is_timestamp(kind):
        import pyarrow

        # nanoseconds are more than Python's own times hold
        values[:] = column.cast(pyarrow.timestamp("us", kind.tz), safe=False).to_pylist()
    elif types.is_duration(kind) or types.is_time(kind):
        values[:] = [None if v is None else str(v) for v in column.to_pylist()]
    else:
        values[:] = column.to_pylist()
    return values


def select_rows(table: Any, where: str, path: str | Path) -> np.ndarray:
    """Return the numbers of the rows of `table` that meet a condition in SQL.

    SQLite evaluates the condition.
    """
    import pyarrow

    known = {name: plain_column(table.column(name)) for name in table.column_names}
    known[ROW] = pyarrow.array(np.arange(len(table)))
    file = io.BytesIO()
    try:
        pyogrio.raw.write_arrow(
            pyarrow.table(known), file, layer="rows", driver="GPKG", geometry_name=None, FID=FID
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a file in memory has no name, and so no suffix
            _, _, _, (rows,) = pyogrio.raw.read(
                file.getvalue(), where=where, columns=[ROW], read_geometry=False
            )
    except (FeatureError, ValueError) as error:
        told = str(error).rpartition(f"{where}: ")[2]
        raise InputError(
            f"expected --where in SQL on the attributes of {path} "
            f"({', '.join(table.column_names) or 'none'}), got: {told}; use these names"
        ) from error
    return np.sort(rows)


def plain_column(column: Any) -> Any:
    """Convert a column of a nested or rare type to text, as GDAL's tables do."""
    import pyarrow
    from pyarrow import types

    kind = column.type
    rare = types.is_nested(kind) or types.is_dictionary(kind) or types.is_decimal(kind)
    rare |= types.is_duration(kind) or types.is_time(kind) or types.is_null(kind)
    if not rare:
        return column
    return pyarrow.array(convert_values(column).tolist(), from_pandas=True)
