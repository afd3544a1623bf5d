"""GeoParquet files through pyarrow, local or by address.

Where a file has boxes for its rows, only the row groups that meet an extent are fetched.

Reads the versions 0.4 to 1.1 of the format: geometries as WKB, or as polygons and multipolygons in
Arrow's own lists.
"""

from __future__ import annotations

import io
import json
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import time, timedelta
from decimal import Decimal
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import shapely
from pyproj import CRS

from ...errors import InputError
from ...extras import import_extra
from ..crs import read_named_crs
from ..remote import FilePath, is_url, open_binary
from .attribute_columns import plain_value, quote, shortest
from .polygons import Features, Layer, decode_geometries


def read_crs(path: FilePath, layer: Layer) -> CRS | None:
    """Return the CRS that a GeoParquet file names, None where it leaves it open."""
    with open_parquet(path) as file:
        return geometry_column(file, path).crs


def read_features(
    path: FilePath,
    layer: Layer,
    where: str | None,
    box_in: Callable[[CRS | None], tuple[float, ...] | None],
) -> Features:
    """Read metadata, row numbers, geometries and columns of a file.

    Metadata are fields, crs and total_bounds. `box_in` gives the box that rows have to meet, in the
    file's CRS, None for all rows. `where` is a condition in SQL. Raises InputError where the file
    or the condition cannot be read.
    """
    stem = Path(str(path).partition("?")[0]).stem
    if layer not in (None, 0, stem):
        raise InputError(
            f"expected no --layer for {path}, which holds one table, got {layer!r}; leave it out"
        )
    with open_parquet(path) as file:
        column = geometry_column(file, path)
        box = box_in(column.crs)
        without = {column.name, *column.others, *column.boxes}
        names = [name for name in file.schema_arrow.names if name not in without]
        extent = None if box is None else shapely.box(*box)
        table, numbers = read_rows(file, column, names, extent)
    columns = [convert_values(table.column(name)) for name in names]
    if where and len(table):
        chosen = select_rows(names, columns, where, path)
        table, numbers = table.take(chosen), numbers[chosen]
        columns = [values[chosen] for values in columns]
    meta = {"fields": names, "crs": column.crs, "total_bounds": column.bounds}
    return meta, numbers, geometries_in(table, column), columns


def convert_values(column: Any) -> np.ndarray:
    """Return plain values (n,) of a column, or None; lists and structs become JSON text."""
    import pyarrow
    from pyarrow import types

    if types.is_float32(column.type):
        return shortest(np.array(column.to_numpy(), np.float32)).astype(object)
    if types.is_timestamp(column.type):
        # nanoseconds are more than Python's own times hold
        column = column.cast(pyarrow.timestamp("us", column.type.tz), safe=False)
    values = np.empty(len(column), object)
    values[:] = [convert_value(value) for value in column.to_pylist()]
    return values


def convert_value(value: Any) -> Any:
    if isinstance(value, dict | list):
        return json.dumps(value, default=str)
    if isinstance(value, Decimal):
        return float(value)
    return str(value) if isinstance(value, time | timedelta) else value


def select_rows(
    names: Sequence[str], columns: Sequence[np.ndarray], where: str, path: FilePath
) -> np.ndarray:
    """Return the numbers of the rows of `columns` (n,) that meet a condition in SQL (SQLite's)."""
    listed = ", ".join(["hiproof_row integer primary key", *map(quote, names)])
    rows = zip(*(map(plain_value, column) for column in columns), strict=True)
    try:
        with closing(sqlite3.connect(":memory:")) as database:
            database.execute(f"create table features ({listed})")
            database.executemany(f"insert into features values (null{', ?' * len(names)})", rows)
            sql = f"select hiproof_row - 1 from features where {where} order by hiproof_row"
            return np.array(database.execute(sql).fetchall(), np.int64).reshape(-1)
    except sqlite3.Error as error:
        raise InputError(
            f"expected --where in SQL on the attributes of {path} ({', '.join(names) or 'none'}), "
            f"got: {error}; use these names"
        ) from error


MAGIC = b"PAR1"  # the first bytes of every Parquet file

SUFFIXES = (".parquet", ".geoparquet")  # by which a file is known whose bytes are not at hand

# The CRS of a file that names none (GeoParquet 1.1, section "crs").
LONGITUDE_LATITUDE = "OGC:CRS84"

BOX_COLUMNS = ("xmin", "ymin", "xmax", "ymax")  # the sides of a box, as columns of boxes are named

# Encodings of surfaces that are lists of coordinates (GeoParquet 1.1, section "encoding").
LISTS = {"polygon": shapely.GeometryType.POLYGON, "multipolygon": shapely.GeometryType.MULTIPOLYGON}


@dataclass(frozen=True)
class GeometryColumn:
    """The geometry of a file as its metadata describe it.

    `others` are further columns of geometries. `sides` are the columns of a row's box, each the
    names on the way to it, none where the file has none. `bounds` is the box of all rows, None
    where it is not told.
    """

    name: str
    encoding: str
    crs: CRS | None
    others: tuple[str, ...]
    sides: tuple[tuple[str, ...], ...]
    bounds: tuple[float, ...] | None

    @property
    def boxes(self) -> set[str]:
        """The columns that hold the rows' boxes."""
        return {way[0] for way in self.sides}


def is_parquet(path: FilePath) -> bool:
    """Return whether a footprint source is a Parquet file.

    A file is recognised by its first bytes, an address by its suffix.

    >>> is_parquet("https://example.org/a.parquet?token=1"), is_parquet("postgresql://host/db")
    (True, False)
    """
    if is_url(path):
        return urlsplit(str(path)).path.lower().endswith(SUFFIXES)
    if str(path).startswith("/vsi"):
        return False
    try:
        with Path(path).open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC or str(path).lower().endswith(SUFFIXES)
    except (OSError, ValueError):
        return False


@contextmanager
def open_parquet(path: FilePath) -> Iterator[Any]:
    """Yield pyarrow's ParquetFile; raises InputError for what goes wrong, in the block, too."""
    parquet = import_pyarrow()
    if is_url(path):
        import_fsspec()
    # exact ranges: a Parquet file tells where everything lies
    with open_binary(path, "GeoParquet footprints", cache_type="none") as source:
        try:
            with parquet.ParquetFile(source, pre_buffer=True) as file:
                yield file
        except (InputError, MemoryError):
            raise
        except Exception as error:  # pyarrow's kinds, and those of each of fsspec's file systems
            raise InputError(
                f"expected a GeoParquet file at {path}, got: {str(error) or type(error).__name__}; "
                "check the file, or copy or download it again"
            ) from error


def geometry_column(file: Any, path: FilePath) -> GeometryColumn:
    """Return the main geometry column; raises InputError for none of a known kind."""
    try:
        geo = json.loads((file.metadata.metadata or {})[b"geo"])
        name = geo["primary_column"]
        told = geo["columns"][name]
        encoding = str(told.get("encoding", "WKB"))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"expected GeoParquet in {path}, got a Parquet file that describes no geometry "
            '(no "geo" in its metadata); convert it with geopandas or DuckDB'
        ) from error
    if encoding.upper() != "WKB" and encoding not in LISTS:
        raise InputError(
            f"expected polygons in {path}, got geometries encoded as {encoding}; name another file"
        )
    bounds = told.get("bbox")
    return GeometryColumn(
        name=name,
        encoding=encoding,
        crs=read_named_crs(told.get("crs", LONGITUDE_LATITUDE), path),
        others=tuple(other for other in geo["columns"] if other != name),
        sides=sides_of_rows(told, file.schema_arrow),
        # of a box in space the middle two sides are those in plan
        bounds=tuple(bounds[:2] + bounds[len(bounds) // 2 :][:2]) if bounds else None,
    )


def sides_of_rows(told: dict[str, Any], schema: Any) -> tuple[tuple[str, ...], ...]:
    """Return columns of rows' boxes by metadata, else of `bbox` as before version 1.1."""
    from pyarrow import types

    covering = (told.get("covering") or {}).get("bbox")
    if covering:
        return tuple(tuple(covering[side]) for side in BOX_COLUMNS)
    kinds = [field.type for field in schema if field.name == "bbox"]
    names = {f.name for kind in kinds if types.is_struct(kind) for f in kind.fields}
    return tuple(("bbox", side) for side in BOX_COLUMNS if names.issuperset(BOX_COLUMNS))


def read_rows(
    file: Any, column: GeometryColumn, names: Sequence[str], extent: shapely.Geometry | None = None
) -> tuple[Any, np.ndarray]:
    """Read the columns `names` and the geometry of rows that meet `extent`.

    `extent` is in the file's CRS; None is for all rows. Returns Arrow's table, and the numbers of
    the rows in the file.
    """
    import pyarrow

    counts = [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)]
    first = np.cumsum([0, *counts])
    own = [*names, column.name]
    wanted = list(dict.fromkeys([*own, *(sorted(column.boxes) if extent is not None else ())]))
    tables = [file.schema_arrow.empty_table().select(wanted)]
    numbers = [np.zeros(0, np.int64)]
    for group in groups_meeting(file, column, extent):
        table = file.read_row_group(group, columns=wanted)
        met = rows_meeting(table, column, extent)
        tables.append(table.take(met))
        numbers.append(first[group] + met)
    return pyarrow.concat_tables(tables).select(own), np.concatenate(numbers)


def groups_meeting(file: Any, column: GeometryColumn, extent: shapely.Geometry | None) -> list[int]:
    """Return the row groups that may hold rows in `extent`, by statistics of the boxes."""
    groups = list(range(file.num_row_groups))
    if extent is None or not column.sides:
        return groups
    from pyarrow import ArrowException, dataset

    footer = io.BytesIO()  # a file of the metadata alone, so that nothing is fetched twice
    file.metadata.write_metadata_file(footer)
    fragment = dataset.ParquetFileFormat().make_fragment(footer)
    low_x, low_y, high_x, high_y = (dataset.field(*way) for way in column.sides)
    xmin, ymin, xmax, ymax = extent.bounds
    met = (low_x <= xmax) & (low_y <= ymax) & (high_x >= xmin) & (high_y >= ymin)
    try:
        return [group.id for group in fragment.subset(met).row_groups]
    except ArrowException:  # boxes that are no numbers, which the rows show
        return groups


def rows_meeting(table: Any, column: GeometryColumn, extent: shapely.Geometry | None) -> np.ndarray:
    """Return ascending numbers of the rows of `table` whose boxes meet `extent`."""
    if extent is None:
        return np.arange(len(table))
    if column.sides:
        sides = table.select(sorted(column.boxes)).flatten()
        numbers = [sides.column(".".join(way)).cast("float64") for way in column.sides]
        boxes = np.column_stack([np.array(values.to_numpy(), float) for values in numbers])
    else:
        boxes = shapely.bounds(geometries_in(table, column))
    known = np.flatnonzero(np.isfinite(boxes).all(axis=1))
    shapely.prepare(extent)
    return known[shapely.intersects(extent, shapely.box(*boxes[known].T))]


def geometries_in(table: Any, column: GeometryColumn) -> np.ndarray:
    """Return the geometries (n,) of a table, None where a row has none."""
    values = table.column(column.name)
    if column.encoding not in LISTS:
        return decode_geometries(values.to_pylist())
    geometries = np.full(len(table), None)
    known = values.drop_null().combine_chunks()
    geometries[values.is_valid().to_numpy()] = convert_surfaces(known, LISTS[column.encoding])
    return geometries


def convert_surfaces(lists: Any, kind: shapely.GeometryType) -> np.ndarray:
    """Convert Arrow's lists of coordinates, none of them null, to surfaces (n,)."""
    from pyarrow import types

    offsets = []
    while types.is_list(lists.type) or types.is_large_list(lists.type):
        starts = lists.offsets.to_numpy()
        offsets.append(starts - starts[0])
        lists = lists.flatten()
    axes = [field.name for field in lists.type.fields]
    values = dict(zip(axes, lists.flatten(), strict=True))
    xy = np.column_stack([values[axis].to_numpy(zero_copy_only=False) for axis in "xy"])
    return shapely.from_ragged_array(kind, xy, tuple(reversed(offsets)))


def import_pyarrow() -> Any:
    """Import pyarrow. Raises InputError where it is missing."""
    import_extra("pyarrow", "parquet", "GeoParquet")
    return import_extra("pyarrow.parquet", "parquet", "GeoParquet")


def import_fsspec() -> Any:
    """Import fsspec. Raises InputError where it is missing."""
    return import_extra("fsspec", "parquet", "GeoParquet by address")
