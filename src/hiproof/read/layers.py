"""The layers of a vector file, those included that pyogrio refuses.

pyogrio opens no layer that is declared as TIN or PolyhedralSurface. GDAL's virtual format gives the
same layer without that declaration, so its features can be read.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pyogrio
from pyogrio.errors import DataSourceError, GeometryError
from pyogrio.util import vsi_path

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


def find_source(path: str, layer: str | int | None) -> tuple[str, str | int | None]:
    """Return what pyogrio can open in place of `path`, and the layer there."""
    try:
        pyogrio.read_info(path, layer=layer)
    except GeometryError:
        names = [name for name, _ in list_layers(path)]
        name = names[layer or 0] if not isinstance(layer, str) else layer
        return virtual_layer(path, name, geometry="wkbUnknown"), None
    return path, layer


def virtual_layer(path: str, layer: str, geometry: str = "", text: str = "") -> str:
    """Return GDAL's virtual format of one layer.

    The layer's `geometry` is declared anew, or it has one attribute alone, as text.

    `path` may be what this function made.
    """
    if path.startswith("<"):
        root = ElementTree.fromstring(path)
        path = root.findtext(".//SrcDataSource", "")
    root = ElementTree.Element("OGRVRTDataSource")
    of_layer = ElementTree.SubElement(root, "OGRVRTLayer", name=layer)
    ElementTree.SubElement(of_layer, "SrcDataSource").text = vsi_path(path)
    if geometry:
        ElementTree.SubElement(of_layer, "GeometryType").text = geometry
    if text:
        ElementTree.SubElement(of_layer, "Field", name=text, type="String")
    return ElementTree.tostring(root, encoding="unicode")
