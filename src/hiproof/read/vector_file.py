"""Features of a vector file through GDAL (pyogrio).

GDAL reads GeoPackage, GeoJSON, Shapefile and others.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyogrio
from pyogrio.errors import DataLayerError, DataSourceError, FeatureError

from ..errors import InputError, InputWarning
from .attribute_columns import make_known_condition, restore_declared_types
from .features import read_layer
from .layers import find_source, list_layers
from .wkb import decode_geometries

Features = tuple[dict[str, Any], np.ndarray, np.ndarray, list[np.ndarray]]
"""Metadata (fields and crs), feature numbers, geometries and columns of a layer."""


def read_vector_file(
    path: str | Path,
    layer: str | int | None,
    where: str | None,
    make_box: Callable[[Any], tuple[float, float, float, float] | None],
) -> Features:
    """Read pyogrio's metadata, feature numbers, geometries and columns.

    Geometries are shapely's, None where a feature has none.

    `make_box` gives the box to read in the layer's CRS.
    """
    source, layer = translate_read_errors(
        lambda: find_source(str(path), choose_layer(path, layer)), path
    )
    info = translate_read_errors(lambda: pyogrio.read_info(source, layer=layer), path)
    selection = {"where": where, "bbox": make_box(info["crs"])}
    meta, numbers, wkb, columns, as_text = translate_read_errors(
        lambda: read_layer(source, layer, **selection), path, info
    )
    if as_text:
        names = ", ".join(as_text)
        warnings.warn(
            f"{path}: read as text, for a value does not fit the attribute's type: {names}",
            InputWarning,
        )
    if wkb is None:
        raise InputError(
            f"expected polygons in {path}, got a table without geometry; name another file or layer"
        )

    def read_column(name: str) -> np.ndarray:
        # of all columns: in some formats those left out are empty to the condition as well
        known_values: dict[str, Any] = {
            **selection,
            "layer": layer,
            "where": make_known_condition(name, where),
        }
        entries, *_, values, _ = translate_read_errors(
            lambda: read_layer(source, read_geometry=False, **known_values), path, info
        )
        return values[list(entries["fields"]).index(name)]

    return (
        {**meta, "total_bounds": info["total_bounds"]},
        numbers,
        decode_geometries(wkb),
        restore_declared_types(meta["fields"], meta["dtypes"], columns, read_column),
    )


def vector_file_crs(path: str | Path, layer: str | int | None) -> str | None:
    """Return the CRS that a layer names, in GDAL's form."""
    source, layer = translate_read_errors(
        lambda: find_source(str(path), choose_layer(path, layer)), path
    )
    return translate_read_errors(lambda: pyogrio.read_info(source, layer=layer), path)["crs"]


def choose_layer(path: str | Path, layer: str | int | None) -> str | int | None:
    """Return `layer`, or the only layer of a file that holds geometries.

    Raises InputError, listing them, where several do.
    """
    if layer is not None:
        return layer
    layer_names = translate_read_errors(lambda: list_layers(str(path)), path)
    layers = [name for name, geometry in layer_names if geometry is not None]
    if len(layers) > 1:
        raise InputError(
            f"expected one layer of footprints in {path}, got {len(layers)}: "
            f"{', '.join(map(str, layers))}; "
            "name one with --layer"
        )
    return layers[0] if layers else None


def translate_read_errors(
    read: Callable[[], Any], path: str | Path, info: dict[str, Any] | None = None
) -> Any:
    """Call `read()` and turn pyogrio's errors into InputErrors.

    The error lists the layers where that helps. With the `info` of a layer it lists the attributes
    for a condition that does not fit them.
    """
    try:
        with warnings.catch_warnings():
            # pyogrio remarks on measured geometries and mixed layers, which are fine
            warnings.simplefilter("ignore")
            return read()
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


def unreadable(path: str | Path, error: Exception) -> InputError:
    # what follows is advice on GDAL's own options
    reason = str(error).partition("; It might help")[0].rstrip(".")
    return InputError(
        f"expected a vector file that GDAL reads (GeoPackage, GeoJSON, Shapefile, ...) at {path}, "
        f"got: {reason}; "
        "check the file, or convert it with ogr2ogr"
    )
