"""A layer of a vector file, written through GDAL (pyogrio)."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from ...errors import OutputError

CONFIGURATION = {
    # a GeoPackage notes when a table last changed; the same input gives the same file
    "OGR_CURRENT_DATE": "2000-01-01T00:00:00.000Z",
    "OGR_GPKG_ALLOW_THREADED_RTREE": False,
    "OGR_SQLITE_SYNCHRONOUS": "OFF",  # the file is seen once it is whole
}
GEOPACKAGE: dict[str, Any] = {
    "driver": "GPKG",
    "dataset_options": {"VERSION": "1.2"},
    "layer_options": {"GEOMETRY_NAME": "geom"},
}


def write_layer(
    path: str | os.PathLike[str],
    layer: str,
    columns: Mapping[str, type],
    rows: Sequence[Sequence[Any]],
    wkb: Sequence[bytes | None] | None = None,
    **options: Any,
) -> None:
    """Write or append `rows`, values by column, with their geometries as WKB.

    `columns` are names and types; `options` are pyogrio's own. Raises what pyogrio does.
    """
    import pyogrio

    pyogrio.set_gdal_config_options(CONFIGURATION)
    values = list(zip(*rows, strict=True)) or [()] * len(columns)
    data = [make_column(*pair) for pair in zip(values, columns.values(), strict=True)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # on a file's hidden name, and on an unknown CRS
        pyogrio.raw.write(
            os.fspath(path),
            None if wkb is None else make_objects(wkb),
            [column for column, _ in data],
            list(columns),
            [mask for _, mask in data],
            layer=layer,
            **options,
        )


@contextmanager
def translate_write_errors(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn errors of GDAL into an OutputError about the file `path`."""
    try:
        yield
    except (RuntimeError, OSError) as error:  # pyogrio's own are RuntimeErrors
        raise OutputError(
            f"expected to write {os.fspath(path)}, got: {error}; check the permissions and the "
            "space left"
        ) from error


def make_column(values: Sequence[Any], kind: type) -> tuple[np.ndarray, np.ndarray]:
    """Return values (n,) of one type, and where they are unknown (n,)."""
    mask = np.array([value is None for value in values], dtype=bool)
    if kind is str:
        return make_objects([None if v is None else str(v) for v in values]), mask
    dtype = {bool: np.bool_, int: np.int64, float: np.float64}[kind]
    return np.array([kind(0) if v is None else kind(v) for v in values], dtype=dtype), mask


def make_objects(values: Sequence[Any]) -> np.ndarray:
    """Return an array (n,) of the values themselves, whatever their types."""
    array = np.empty(len(values), dtype=object)
    array[:] = values
    return array
