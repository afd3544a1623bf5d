"""buildings.gpkg: outlines with every attribute, parts and roof surfaces as tables, for QGIS and
its like.

A table's columns need one type each, known before the first row, while the input's attributes may
differ from building to building: rows wait in a temporary file until the last building has settled
the types.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import islice
from typing import Any, BinaryIO

import numpy as np

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
from .rows import Row, split_lines, table_rows
from .styles import TABLE, style_rows

BUILDINGS = "buildings"
LAYERS = {BUILDINGS: "MultiPolygon", "parts": "MultiPolygon", "roof_surfaces": "Polygon Z"}
"""Tables and the geometry of their rows."""

DECLARED = {"parts": PARTS_LAYER, "roof_surfaces": SURFACES_LAYER}
ROWS_AT_ONCE = 1000  # rows handed to GDAL at once: its overhead is a call's, its memory a row's
GPKG_VERSION = "1.2"  # what GDAL 3.4 opens without a warning; nothing here needs more
# of a table in SQLite as GDAL's wheels come, less the number and the geometry of a row
MOST_COLUMNS = 1998
# GeoPackage notes when a layer last changed; a fixed date keeps the same input giving the same
# file.
FIXED_DATE = "2000-01-01T00:00:00.000Z"


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
        for waiting in self.waiting.values():
            kinds = waiting.kinds(self.prefix, MOST_COLUMNS)
            for number, rows in enumerate(waiting.batches()):
                self.write_rows(waiting.layer, rows, kinds, append=number > 0)
        self.write_styles()

    def write_rows(self, layer: str, rows: list[Row], kinds: dict[str, type], append: bool) -> None:
        self.write_table(
            layer,
            [row for _, row in rows],
            kinds,
            objects([wkb for wkb, _ in rows]),
            geometry_type=LAYERS[layer],
            promote_to_multi=LAYERS[layer] == "MultiPolygon",
            crs=self.plan_wkt,
            append=append,
        )

    def write_styles(self) -> None:
        """The table by which QGIS draws the layers."""
        rows = style_rows()
        kinds: dict[str, type] = {name: bool if name == "useAsDefault" else str for name in rows[0]}
        self.write_table(TABLE, rows, kinds, None, layer_options={"FID": "id"})

    def write_table(
        self,
        layer: str,
        rows: list[dict[str, Any]],
        kinds: dict[str, type],
        geometry: np.ndarray | None,
        **options: Any,
    ) -> None:
        """Write `rows` by columns of `kinds`, with `geometry` (n,) as WKB or without any."""
        import pyogrio
        from pyogrio.errors import DataLayerError, DataSourceError, FeatureError

        columns = [column([row.get(name) for row in rows], kind) for name, kind in kinds.items()]
        version = {} if self.hidden.exists() else {"dataset_options": {"VERSION": GPKG_VERSION}}
        try:
            with fixed_date():
                pyogrio.raw.write(
                    self.hidden,
                    geometry,
                    [values for values, _ in columns],
                    column_names(kinds, self.reserved),
                    [mask for _, mask in columns],
                    layer=layer,
                    driver="GPKG",
                    **version,
                    **options,
                )
        except (DataSourceError, DataLayerError, FeatureError, RuntimeError, OSError) as error:
            raise OutputError(
                f"expected to write {os.fspath(self.path)}, got: {error}; check the permissions "
                "and the space left"
            ) from error


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


@contextmanager
def fixed_date() -> Iterator[None]:
    """GDAL writes FIXED_DATE as the date of change, and an unknown CRS is no warning."""
    import pyogrio

    previous = pyogrio.get_gdal_config_option("OGR_CURRENT_DATE")
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": FIXED_DATE})
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "'crs' was not provided")
            yield
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": previous})


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


def column(values: list[Any], kind: type) -> tuple[np.ndarray, np.ndarray]:
    """Values (n,) of one type, and where they are unknown (n,)."""
    mask = np.array([value is None for value in values], dtype=bool)
    if kind is str:
        return objects([None if v is None else str(v) for v in values]), mask
    dtype = {bool: np.bool_, int: np.int64, float: np.float64}[kind]
    return np.array([kind(0) if v is None else kind(v) for v in values], dtype=dtype), mask


def objects(values: list[Any]) -> np.ndarray:
    """An array (n,) of the values themselves, whatever their types and lengths."""
    array = np.empty(len(values), dtype=object)
    array[:] = values
    return array


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
