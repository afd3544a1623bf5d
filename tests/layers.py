"""Vector layers and rasters of tests, each written in a line."""

import sqlite3
from contextlib import contextmanager

import numpy as np
import pyogrio
import shapely


def write_layer(path, shapes, columns=None, crs="EPSG:28992", **options):
    """Write polygons with their attributes in the format of the path's ending; return the path."""
    fields = {name: np.asarray(values) for name, values in (columns or {}).items()}
    values = [v.astype(object) if v.dtype.kind == "U" else v for v in fields.values()]
    wkb = shapely.to_wkb(np.array(list(shapes), object))
    options = {"geometry_type": "Polygon", "crs": crs, **options}
    pyogrio.raw.write(str(path), wkb, values, list(fields), **options)
    return path


def write_raster(path, heights, west, north, step=1.0, crs="EPSG:28992", **options):
    """Write heights (rows, columns) from their north-west corner on; return the path as text."""
    import rasterio

    (rows, columns), dtype = heights.shape, heights.dtype
    options = {"height": rows, "width": columns, "count": 1, "dtype": dtype, **options}
    corner = rasterio.transform.from_origin(west, north, step, step)
    with rasterio.open(path, "w", driver="GTiff", crs=crs, transform=corner, **options) as file:
        file.write(heights, 1)
    return str(path)


@contextmanager
def open_geopackage(path):
    """The database of a layer that was written with SPATIAL_INDEX="NO", which takes any values."""
    with sqlite3.connect(path) as base:
        for (trigger,) in base.execute(
            "select name from sqlite_master where type = 'trigger'"
        ).fetchall():
            base.execute(f'drop trigger "{trigger}"')
        yield base
