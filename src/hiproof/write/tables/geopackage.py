"""buildings.gpkg: outlines with attributes, parts and roof surfaces, as tables for QGIS.

A table's columns need one type each, known before the first row, while the input's attributes may
differ from building to building: rows wait in a temporary file until the last building has settled
the types.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from typing import Any

from ...data_files import Values
from ...model import Building
from ..attribute_list import PREFIX, TABLES
from ..files import atomic, scratch
from ..fragments import Fragment, Sheet
from ..head import FileHead
from ..naming import plan_wkt
from ..writer import BuildingWriter
from .rows import split_lines, table_rows
from .styles import TABLE, Style, choose_styles, style_rows
from .vector_layer import (
    GEOPACKAGE,
    HISTORY,
    WaitingRows,
    name_columns,
    translate_write_errors,
    write_layer,
)

BUILDINGS = "buildings"
OUTLINE_GEOMETRY: Values = {"geometry_type": "MultiPolygon", "promote_to_multi": True}
# Tables and the geometry of their rows, in pyogrio's terms.
TABLE_GEOMETRIES: dict[str, Values] = {
    BUILDINGS: OUTLINE_GEOMETRY,
    "parts": OUTLINE_GEOMETRY,
    "roof_surfaces": {"geometry_type": "Polygon Z"},
    HISTORY: OUTLINE_GEOMETRY,
}

# of a table in SQLite as it comes, less the number and the geometry of a row
MOST_COLUMNS = 1998


def write_attributes(
    path: str | os.PathLike[str],
    buildings: Iterable[Building],
    crs: Any = None,
    prefix: str = PREFIX,
) -> None:
    """Write the GeoPackage `path` of outlines (world coordinates), parts and roof surfaces.

    A building whose outline is unknown gets a row without geometry. Values of one column are
    brought to one type: whole numbers and decimals to decimals, anything beside text to text.
    Geometries are in the unit of `crs`. Of thousands of attributes the last have no column
    (MOST_COLUMNS). Raises OutputError when the file cannot be written.
    """
    AttributesWriter(path, FileHead(crs, prefix=prefix)).add_all(buildings)


def attributes_with_a_column() -> int:
    """Return how many input attributes a table of buildings holds beside hiproof's own."""
    return MOST_COLUMNS - sum(len(TABLES[name].names) for name in ("roofer", "hiproof", "osm")) - 1


class AttributesWriter(BuildingWriter):
    """Incremental form of `write_attributes`; `layers` are those written."""

    layers: tuple[str, ...] = tuple(TABLE_GEOMETRIES)
    reserved: tuple[str, ...] = ("fid", "geom")  # names of columns that the format has itself

    def __init__(self, path: str | os.PathLike[str], head: FileHead) -> None:
        super().__init__(path, head)
        self.plan_wkt = plan_wkt(head.crs_of_files)

    def open(self, stack: ExitStack) -> None:
        self.hidden = stack.enter_context(atomic(self.path))
        self.waiting = {
            layer: WaitingRows(layer, stack.enter_context(scratch(self.path)))
            for layer in self.layers
        }

    @staticmethod
    def fragment(sheet: Sheet) -> Fragment:
        """Return a building's rows as text."""
        return Fragment(table_rows(sheet).to_text())

    def put(self, fragment: Fragment) -> None:
        lines = split_lines(fragment.text)
        for layer, waiting in self.waiting.items():
            waiting.put(lines[layer])

    def finish(self) -> None:
        columns = {}
        with translate_write_errors(self.path):
            for waiting in (w for w in self.waiting.values() if w.is_needed):
                kinds = columns[waiting.layer] = waiting.kinds(self.head.prefix, MOST_COLUMNS)
                for number, rows in enumerate(waiting.batches(kinds)):
                    write_layer(
                        self.hidden,
                        waiting.layer,
                        name_columns(kinds.items(), self.reserved),
                        [values for _, values in rows],
                        [wkb for wkb, _ in rows],
                        crs=self.plan_wkt,
                        append=number > 0,
                        **GEOPACKAGE,
                        **TABLE_GEOMETRIES[waiting.layer],
                    )
            write_styles(self.hidden, choose_styles(columns, self.head.sky))


def write_styles(path: str | os.PathLike[str], styles: Sequence[Style]) -> None:
    """Write the table by which QGIS draws the layers."""
    rows = style_rows(styles)
    kinds: dict[str, type] = {name: bool if name == "useAsDefault" else str for name in rows[0]}
    values = [list(row.values()) for row in rows]
    write_layer(path, TABLE, kinds, values, driver="GPKG", layer_options={"FID": "id"})


writer = AttributesWriter
