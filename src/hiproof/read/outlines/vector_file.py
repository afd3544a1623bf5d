"""Features of a vector file (GeoPackage, GeoJSON, Shapefile, ...) through GDAL (pyogrio)."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, quoteattr

import numpy as np
import pyogrio
from pyogrio.errors import DataLayerError, DataSourceError, FeatureError, FieldError, GeometryError
from pyogrio.util import vsi_path

from ...errors import InputError, explain_fault, warn
from ...frames import Box
from ..remote import FilePath, is_url
from .attribute_columns import restore_declared_type
from .polygons import Features, Layer, decode_geometries

SLASHED_DATE = re.compile(r"^(\d{1,5})/(\d\d)/(\d\d)")  # how GDAL writes a date as text

# What pyogrio raises for a value that it cannot represent; text that is no UTF-8 is a ValueError,
# too.
READ_ERRORS = (ValueError, OverflowError, FieldError)


def read_layer(
    path: str, layer: Layer, **chosen: Any
) -> tuple[dict[str, Any], np.ndarray, np.ndarray, list[np.ndarray], list[str]]:
    """Read pyogrio's metadata, numbers, WKB and columns of a layer, in their declared types.

    The names of the attributes that were read as text come with them. `chosen` are pyogrio's own
    options that choose among the features.
    """
    read = partial(
        pyogrio.raw.read, path, layer=layer, return_fids=True, datetime_as_string=True, **chosen
    )
    odd: list[str] = []
    try:
        meta, numbers, wkb, columns = read()
    except READ_ERRORS as error:
        fields = pyogrio.read_info(path, layer=layer)["fields"]
        if "SQL" not in str(error):
            odd = [name for name in fields if not is_readable(path, layer, name)]
        if not odd:
            raise
        meta, numbers, wkb, columns = read(columns=[name for name in fields if name not in odd])
    read_text = partial(column_as_text, path, layer, numbers)
    values = {
        name: restore_declared_type(kind, column, partial(read_text, name))
        for name, kind, column in zip(meta["fields"], meta["dtypes"], columns, strict=True)
    }
    values |= {name: read_text(name) for name in odd}
    names = list(fields if odd else values)
    return {**meta, "fields": names}, numbers, wkb, [values[name] for name in names], odd


def is_readable(path: str, layer: Layer, name: str) -> bool:
    """Return whether pyogrio can represent every value of an attribute."""
    try:
        pyogrio.raw.read(
            path, layer=layer, columns=[name], read_geometry=False, datetime_as_string=True
        )
    except READ_ERRORS:
        return False
    return True


def column_as_text(path: str, layer: Layer, numbers: np.ndarray, name: str) -> np.ndarray:
    """Return an attribute (n,) of these features as text, broken UTF-8 replaced."""
    layer_name = pyogrio.read_info(path, layer=layer)["layer_name"]
    # one attribute alone, as text
    source = virtual_layer(path, layer_name, f'<Field name={quoteattr(name)} type="String"/>')
    try:
        _, _, _, (values,) = pyogrio.raw.read(
            source, fids=numbers, read_geometry=False, encoding="latin-1"
        )
    except (*READ_ERRORS, DataSourceError, FeatureError):
        values = [None] * len(numbers)
    return np.array([tidy_value(value) for value in values], dtype=object)


def tidy_value(value: str | None) -> str | None:
    """Decode text that was read as Latin-1, and write dates in ISO's way.

    >>> tidy_value("1950/00/00"), tidy_value("Stra\\u00c3\\u009fe")
    ('1950-00-00', 'Straße')
    """
    if value is None:
        return None
    text = value.encode("latin-1", "replace").decode("utf-8", "replace")
    return SLASHED_DATE.sub(r"\1-\2-\3", text)


OF_GEOPACKAGE = "select table_name, geometry_type_name from gpkg_geometry_columns"


def list_layers(path: str) -> list[tuple[str, str | None]]:
    """Name and kind of geometry of every layer, None for a table without geometry."""
    try:
        return [(str(name), kind) for name, kind in pyogrio.list_layers(path)]
    except GeometryError:
        pass
    try:
        _, _, _, (names, kinds) = pyogrio.raw.read(path, sql=OF_GEOPACKAGE, read_geometry=False)
    except (DataSourceError, ValueError, RuntimeError):
        return [(Path(path).stem, "surfaces")]
    return list(zip(names.tolist(), kinds.tolist(), strict=True))


def virtual_layer(path: str, layer: str, declared: str) -> str:
    """Return GDAL's virtual format of one layer with what is `declared` of it, in XML.

    `path` may be what this function made.
    """
    source = path if path.startswith("<") else vsi_path(path)
    return (
        f"<OGRVRTDataSource><OGRVRTLayer name={quoteattr(layer)}>"
        f"<SrcDataSource>{escape(source)}</SrcDataSource>{declared}"
        "</OGRVRTLayer></OGRVRTDataSource>"
    )


def read_features(
    path: FilePath,
    layer: Layer,
    where: str | None,
    make_box: Callable[[Any], Box | None],
) -> Features:
    """Read pyogrio's metadata, feature numbers, geometries and columns.

    Geometries are shapely's, None where a feature has none. `make_box` gives the box to read in the
    layer's CRS.
    """
    source, layer, info = open_layer(path, layer)
    box = make_box(info["crs"])
    with translate_read_errors(path, info):
        meta, numbers, wkb, columns, as_text = read_layer(source, layer, where=where, bbox=box)
    if as_text:
        names = ", ".join(as_text)
        warn(path, f"read as text, for a value does not fit the attribute's type: {names}")
    if wkb is None:
        raise InputError(
            f"expected polygons in {path}, got a table without geometry; name another file or layer"
        )

    meta = {**meta, "total_bounds": info["total_bounds"]}
    return meta, numbers, decode_geometries(wkb), columns


def read_crs(path: FilePath, layer: Layer) -> str | None:
    """Return the CRS that a layer names, in GDAL's form."""
    return open_layer(path, layer)[2]["crs"]


def open_layer(path: FilePath, layer: Layer) -> tuple[str, Layer, dict[str, Any]]:
    """Return what pyogrio can open in place of `path`, the layer there, and its metadata."""
    with translate_read_errors(path):
        source, layer = str(path), choose_layer(path, layer)
        try:
            return source, layer, pyogrio.read_info(source, layer=layer)
        except GeometryError:
            names = [name for name, _ in list_layers(source)]
            name = layer if isinstance(layer, str) else names[layer or 0]
            source = virtual_layer(source, name, "<GeometryType>wkbUnknown</GeometryType>")
            return source, None, pyogrio.read_info(source)


def choose_layer(path: FilePath, layer: Layer) -> Layer:
    """Return `layer`, or the only one with geometries; InputError lists several."""
    if layer is not None:
        return layer
    layers = [name for name, geometry in list_layers(str(path)) if geometry is not None]
    if len(layers) > 1:
        raise InputError(
            f"expected one layer of footprints in {path}, got {len(layers)}: "
            f"{', '.join(map(str, layers))}; name one with --layer"
        )
    return layers[0] if layers else None


@contextmanager
def translate_read_errors(path: FilePath, info: dict[str, Any] | None = None) -> Iterator[None]:
    """Turn pyogrio's errors in the block into InputErrors.

    The error lists the layers where that helps. With the `info` of a layer it lists the attributes
    for a condition that does not fit them.
    """
    try:
        with warnings.catch_warnings():
            # pyogrio remarks on measured geometries and mixed layers, which are fine
            warnings.simplefilter("ignore")
            yield
    # ValueError: a condition on other files than databases
    except (FeatureError, ValueError) as error:
        if info is None or "SQL" not in str(error):
            raise unreadable(path, error) from error
        reason, names = str(error).partition(": ")[2], ", ".join(info["fields"]) or "none"
        raise InputError(
            f"expected --where in SQL on the attributes of {path} ({names}), got: {reason}; use "
            "these names"
        ) from error
    except DataLayerError as error:
        layers = ", ".join(str(name) for name, _ in list_layers(str(path)))
        raise InputError(
            f"expected a layer of {path} (it has {layers}), got: {error}; use one of these"
        ) from error
    except (DataSourceError, OSError, RuntimeError) as error:
        raise unreadable(path, error) from error


def unreadable(path: FilePath, error: Exception) -> InputError:
    is_local = not is_url(path) and not str(path).startswith(("/vsi", "PG:"))
    # what follows is advice on GDAL's own options
    reason = str(error).partition("; It might help")[0].rstrip(".")
    reason = (is_local and explain_fault(path)) or reason
    return InputError(
        f"expected a vector file that GDAL reads (GeoPackage, GeoJSON, Shapefile, ...) at {path}, "
        f"got: {reason}; check the file, or convert it with ogr2ogr"
    )
