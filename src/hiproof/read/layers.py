"""The layers of a vector file, those that pyogrio refuses by their declaration included.

pyogrio opens no layer that is declared as TIN or PolyhedralSurface. GDAL's virtual format gives the same layer
without that declaration, so its features can be read.
"""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import pyogrio
from pyogrio.errors import DataSourceError, GeometryError

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


def source_of(path: str, layer: str | int | None) -> tuple[str, str | int | None]:
    """What pyogrio can open in place of `path`, and the layer there."""
    try:
        pyogrio.read_info(path, layer=layer)
    except GeometryError:
        names = [name for name, _ in list_layers(path)]
        name = names[layer or 0] if not isinstance(layer, str) else layer
        source = f"<SrcDataSource>{escape(path)}</SrcDataSource><GeometryType>wkbUnknown</GeometryType>"
        layers = f"<OGRVRTLayer name={quoteattr(name)}>{source}</OGRVRTLayer>"
        return f"<OGRVRTDataSource>{layers}</OGRVRTDataSource>", None
    return path, layer
