"""GeoParquet files through pyarrow, local or by address.

Where a file has boxes for its rows, only the row groups that meet an extent are fetched.

Reads the versions 0.4 to 1.1 of the format: geometries as WKB, or as polygons and multipolygons in
Arrow's own lists.
"""

from __future__ import annotations

import io
import json
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pyogrio
import shapely
from pyogrio.errors import FeatureError
from pyproj import CRS

from ...errors import InputError
from ...extras import import_extra
from ..crs import read_named_crs
from ..remote import is_url, open_binary
from .attribute_columns import shortest
from .polygons import Features, decode_geometries

# Columns of the table that answers a condition, of names that no file has.
ROW, FID = "hiproof_row", "hiproof_fid"


def parquet_crs(path: str | Path) -> CRS | None:
    """Return the CRS that a GeoParquet file names, None where it leaves it open."""
    with open_parquet(path) as file:
        return geometry_column(file, path).crs


def read_parquet(
    path: str | Path,
    layer: str | int | None,
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
        boxes = {way[0] for way in column.sides or ()}
        without = {column.name, *column.others, *boxes}
        names = [name for name in file.schema_arrow.names if name not in without]
        extent = None if box is None else shapely.box(*box)
        table, numbers = read_rows(file, column, names, extent)
    if where and len(table):
        chosen = select_rows(table.select(names), where, path)
        table, numbers = table.take(chosen), numbers[chosen]
    meta = {"fields": names, "crs": column.crs, "total_bounds": column.bounds}
    columns = [convert_values(table.column(name)) for name in names]
    return meta, numbers, geometries_in(table, column), columns


def convert_values(column: Any) -> np.ndarray:
    """Return plain values (n,) of a column, or None; lists and structs become JSON text."""
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
    """Return the numbers of the rows of `table` that meet a condition in SQL (by SQLite)."""
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
    names on the way to it, None where the file has none. `bounds` is the box of all rows, None
    where it is not told.
    """

    name: str
    encoding: str
    crs: CRS | None
    others: tuple[str, ...]
    sides: tuple[tuple[str, ...], ...] | None
    bounds: tuple[float, ...] | None


def is_parquet(path: str | Path) -> bool:
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
def open_parquet(path: str | Path) -> Iterator[Any]:
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


def geometry_column(file: Any, path: str | Path) -> GeometryColumn:
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


def sides_of_rows(told: dict[str, Any], schema: Any) -> tuple[tuple[str, ...], ...] | None:
    """Return columns of rows' boxes by metadata, else of `bbox` as before version 1.1."""
    from pyarrow import types

    covering = (told.get("covering") or {}).get("bbox")
    if covering:
        return tuple(tuple(covering[side]) for side in BOX_COLUMNS)
    kind = {field.name: field.type for field in schema}.get("bbox")
    if kind is None or not types.is_struct(kind):
        return None
    names = {field.name for field in kind.fields}
    return tuple(("bbox", side) for side in BOX_COLUMNS) if names.issuperset(BOX_COLUMNS) else None


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
    boxes = sorted({way[0] for way in column.sides or ()}) if extent is not None else []
    wanted = list(dict.fromkeys([*names, column.name, *boxes]))
    tables = [file.schema_arrow.empty_table().select(wanted)]
    numbers = [np.zeros(0, np.int64)]
    for group in groups_meeting(file, column, extent):
        table = file.read_row_group(group, columns=wanted)
        met = rows_meeting(table, column, extent)
        tables.append(table.take(met))
        numbers.append(first[group] + met)
    table = pyarrow.concat_tables(tables)
    return table.select([*names, column.name]), np.concatenate(numbers)


def groups_meeting(file: Any, column: GeometryColumn, extent: shapely.Geometry | None) -> list[int]:
    """Return the row groups that may hold rows in `extent`, by statistics of the boxes."""
    groups = list(range(file.num_row_groups))
    if extent is None or column.sides is None:
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
    if column.sides is None:
        boxes = shapely.bounds(geometries_in(table, column))
    else:
        boxes = np.column_stack([numbers_at(table, way) for way in column.sides])
    known = np.isfinite(boxes).all(axis=1)
    met = np.zeros(len(table), bool)
    shapely.prepare(extent)
    met[known] = shapely.intersects(extent, shapely.box(*boxes[known].T))
    return np.flatnonzero(met)


def numbers_at(table: Any, way: Sequence[str]) -> np.ndarray:
    """Return the numbers (n,) of the column at the names of `way`, NaN without."""
    import pyarrow.compute

    values = table.column(way[0])
    if len(way) > 1:
        values = pyarrow.compute.struct_field(values, list(way[1:]))
    return np.array(values.cast("float64").to_numpy(), float)


def geometries_in(table: Any, column: GeometryColumn) -> np.ndarray:
    """Return the geometries (n,) of a table, None where a row has none."""
    values = table.column(column.name)
    if column.encoding not in LISTS:
        bodies = np.empty(len(table), object)
        bodies[:] = values.to_pylist()
        return decode_geometries(bodies)
    geometries = np.empty(len(table), object)
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
