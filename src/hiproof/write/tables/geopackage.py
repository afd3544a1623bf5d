"""buildings.gpkg: outlines with every attribute, parts and roof surfaces as tables, for QGIS and
its like.

A table's columns need one type each, known before the first row, while the input's attributes may
differ from building to building: rows wait in a temporary file until the last building has settled
the types.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, closing
from itertools import islice
from typing import Any, BinaryIO

from ...errors import OutputError
from ...model import Building
from ...settings import WriteSettings
from ..attribute_list import HIPROOF, OSM, OWN, PARTS_LAYER, PREFIX, ROOFER, SURFACES_LAYER
from ..building_attributes import building_attributes, measure_figures
from ..files import atomic, scratch
from ..fragments import Fragment, Sheet
from ..head import FileHead
from ..naming import plan_wkt
from ..roof_figures import RoofFigures
from ..writer import BuildingWriter
from .geopackage_file import GeometryType, GeoPackage
from .rows import Row, split_lines, table_rows
from .styles import TABLE, style_rows

BUILDINGS = "buildings"
OUTLINE_GEOMETRY, POLYGON_Z = GeometryType("MULTIPOLYGON"), GeometryType("POLYGON", has_z=True)
LAYERS = {BUILDINGS: OUTLINE_GEOMETRY, "parts": OUTLINE_GEOMETRY, "roof_surfaces": POLYGON_Z}
"""Tables and the geometry of their rows."""

DECLARED = {"parts": PARTS_LAYER, "roof_surfaces": SURFACES_LAYER}
ROWS_AT_ONCE = 1000  # rows handed to SQLite at once: its overhead is a call's, its memory a row's
# of a table in SQLite as it comes, less the number and the geometry of a row
MOST_COLUMNS = 1998


def write_attributes(
    path: str | os.PathLike, buildings: Iterable[Building], crs: Any = None, prefix: str = PREFIX
) -> None:
    """Write the GeoPackage `path`: layers of the outlines of `buildings` (world coordinates), their
    parts and roof surfaces.

    A building whose outline is unknown gets a row without geometry. Values of one column are
    brought to one type: whole numbers and decimals to decimals, anything beside text to text.
    Geometries are in the unit of `crs`. Of thousands of attributes the last have no column
    (MOST_COLUMNS). Raises OutputError when the file cannot be written.
    """
    with AttributesWriter(path, crs, prefix) as writer:
        for building in buildings:
            writer.add(building)


def attributes_with_a_column() -> int:
    """How many attributes of the input a table of buildings has room for beside hiproof's own."""
    return MOST_COLUMNS - len(ROOFER) - len(HIPROOF) - len(OSM) - 1


class WaitingRows:
    """Rows of one table in a temporary file, as the text that their buildings brought, and the
    types found in each column.
    """

    def __init__(self, layer: str, file: BinaryIO) -> None:
        self.layer, self.file = layer, file
        self.found: dict[str, set[type]] = {a.name: set() for a in DECLARED.get(layer, ())}

    def put(self, line: bytes) -> None:
        """A building's rows, as a line of `Rows.to_text`."""
        for _, values in json.loads(line):
            for name, value in values.items():
                self.found.setdefault(name, set()).add(classify_value(value))
        self.file.write(line + b"\n")

    def kinds(self, prefix: str, limit: int | None = None) -> dict[str, type]:
        """The one type of every column; of more than `limit`, the last of the input's own are left
        out.
        """
        declared = {
            start + a.name: a.kind
            for start, table in ((prefix, ROOFER), (OWN, HIPROOF), ("", OSM))
            for a in table
        }
        declared = (
            {a.name: a.kind for a in DECLARED[self.layer]} if self.layer in DECLARED else declared
        )
        kinds = {
            name: column_kind(result, declared.get(name, "text"))
            for name, result in self.found.items()
        }
        excess = len(kinds) - (limit or len(kinds))
        if excess > 0:
            selected_kinds = [name for name in kinds if name not in declared and name != "id"]
            left_out = set(selected_kinds[-excess:])
            kinds = {name: kind for name, kind in kinds.items() if name not in left_out}
        return kinds or {"id": str}

    def batches(self) -> Iterator[list[Row]]:
        """The rows, some thousands at a time; one empty batch if there are none."""
        self.file.seek(0)
        rows = (
            (wkb and bytes.fromhex(wkb), values)
            for line in self.file
            for wkb, values in json.loads(line)
        )
        yield list(islice(rows, ROWS_AT_ONCE))
        while batch := list(islice(rows, ROWS_AT_ONCE)):
            yield batch


class AttributesWriter(BuildingWriter):
    """Incremental form of `write_attributes`; `layers` are those written."""

    layers: tuple[str, ...] = tuple(LAYERS)
    reserved: tuple[str, ...] = ("fid", "geom")  # names of columns that the format has itself

    def __init__(
        self,
        path: str | os.PathLike,
        crs: Any = None,
        prefix: str = PREFIX,
        write: WriteSettings | None = None,
    ) -> None:
        super().__init__(path)
        head = FileHead(crs, write=write or WriteSettings())
        self.osm_tags = head.write.osm_tags
        self.plan_wkt, self.prefix, self.units = plan_wkt(head.crs_of_files), prefix, head.units

    def open(self, stack: ExitStack) -> None:
        self.hidden = stack.enter_context(atomic(self.path))
        self.waiting = {
            layer: WaitingRows(layer, stack.enter_context(scratch(self.path)))
            for layer in self.layers
        }

    def add(self, building: Building, figures: RoofFigures | None = None) -> None:
        figures = figures or measure_figures(building)
        attributes = building_attributes(
            building, figures, self.prefix, self.units.gml, self.osm_tags
        )
        self.put(Fragment(table_rows(building, figures, attributes, self.units.table).to_text()))

    def put(self, fragment: Fragment) -> None:
        lines = split_lines(fragment.text)
        for layer, waiting in self.waiting.items():
            waiting.put(lines[layer])

    def finish(self) -> None:
        try:
            with closing(GeoPackage(self.hidden, self.plan_wkt)) as file:
                for waiting in self.waiting.values():
                    write_layer(file, waiting, waiting.kinds(self.prefix, MOST_COLUMNS))
                write_styles(file)
                file.finish()
        except sqlite3.Error as error:
            raise OutputError(
                f"expected to write {os.fspath(self.path)}, got: {error}; check the permissions "
                "and the space left"
            ) from error


def write_layer(file: GeoPackage, waiting: WaitingRows, kinds: dict[str, type]) -> None:
    """Write the rows of a table, by columns of `kinds`."""
    names = column_names(kinds, AttributesWriter.reserved)
    columns = dict(zip(names, kinds.values(), strict=True))
    file.create_table(waiting.layer, columns, LAYERS[waiting.layer])
    first = 1
    for rows in waiting.batches():
        values = [
            tuple(None if (v := row.get(name)) is None else kind(v) for name, kind in kinds.items())
            for _, row in rows
        ]
        file.insert_features(waiting.layer, first, [wkb for wkb, _ in rows], values)
        first += len(rows)


def write_styles(file: GeoPackage) -> None:
    """Write the table by which QGIS draws the layers."""
    rows = style_rows()
    kinds: dict[str, type] = {name: bool if name == "useAsDefault" else str for name in rows[0]}
    file.create_table(TABLE, kinds, None, key="id")
    file.insert(TABLE, [(number, *row.values()) for number, row in enumerate(rows, 1)])


def writer(path: str | os.PathLike, head: FileHead) -> AttributesWriter:
    """The writer of a run's file."""
    return AttributesWriter(path, head.crs, write=head.write)


def fragment(sheet: Sheet) -> Fragment:
    """A building's rows in the tables of a run, as text."""
    return Fragment(
        table_rows(
            sheet.building, sheet.figures, sheet.attributes, sheet.head.units.table
        ).to_text()
    )


def classify_value(value: Any) -> type:
    """bool, int, float, str or NoneType; whole numbers beyond 64 bits count as text."""
    return str if type(value) is int and abs(value) >= 2**63 else type(value)


def column_kind(result: set[type], declared: str) -> type:
    """The one type that holds all values found; a figure that is always unknown stays what it is
    `declared`.
    """
    kinds = result - {type(None)}
    if not kinds:
        return {"text": str, "count": int}.get(declared, float)
    if len(kinds) == 1:
        return kinds.pop()
    return str if str in kinds else float if float in kinds else int


def column_names(names: Iterable[str], reserved: Iterable[str] = ()) -> list[str]:
    """Names that SQLite, which does not tell upper from lower case, can hold beside the `reserved`
    ones.

    >>> column_names(["id", "Year", "year", "fid"], ["fid"])
    ['id', 'Year', 'year_2', 'fid_2']
    """
    accepted, unique = set(reserved), []
    for name in names:
        candidate, number = name, 1
        while candidate.lower() in accepted:
            number += 1
            candidate = f"{name}_{number}"
        accepted.add(candidate.lower())
        unique.append(candidate)
    return unique
