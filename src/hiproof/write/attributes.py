"""buildings.gpkg: the outlines with every attribute as a table, for QGIS and its like.

A table's columns need one type each, known before the first row, while the input's attributes may differ from building
to building: rows wait in a temporary file until the last building has settled the types.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import numpy as np
import shapely

from ..errors import OutputError
from ..frames import METRES, Units
from ..model import GROUND, Building
from .attribute_list import HIPROOF, OWN, PREFIX, ROOFER
from .building_attributes import building_attributes, figures_of, plain_text
from .files import atomic, scratch
from .naming import FileUnits, plan_wkt
from .roof_figures import RoofFigures
from .writer import BuildingWriter

LAYER = "buildings"
ROWS_AT_ONCE = 1000
RESERVED = ("fid", "geom")
Row = tuple[bytes | None, dict[str, Any]]  # the outline as WKB, the values by column
# GeoPackage notes when a layer last changed; a fixed date keeps the same input giving the same file.
FIXED_DATE = "2000-01-01T00:00:00.000Z"


def write_attributes(
    path: str | os.PathLike, buildings: Iterable[Building], crs: Any = None, prefix: str = PREFIX
) -> None:
    """Write the outline of each of `buildings` (world coordinates) with its attributes to the GeoPackage `path`.

    A building whose outline is unknown gets a row without geometry. Values of one column are brought to one type: whole
    numbers and decimals to decimals, anything beside text to text. Outlines are in the unit of `crs`. Raises OutputError when the file cannot be written.
    """
    with AttributesWriter(path, crs, prefix) as writer:
        for building in buildings:
            writer.add(building)


class AttributesWriter(BuildingWriter):
    """Incremental form of `write_attributes`."""

    def __init__(
        self, path: str | os.PathLike, crs: Any = None, prefix: str = PREFIX, units: Units | None = None
    ) -> None:
        super().__init__(path)
        self.plan_wkt, self.prefix, self.units = plan_wkt(crs), prefix, FileUnits.of(crs, units).gml
        self.kinds: dict[str, set[type]] = {}
        self.count = 0

    def open(self, stack: ExitStack) -> None:
        self.hidden = stack.enter_context(atomic(self.path))
        self.waiting = stack.enter_context(scratch(self.path))

    def add(self, building: Building, figures: RoofFigures | None = None) -> None:
        attributes = building_attributes(building, figures or figures_of(building), self.prefix, self.units)
        self.put(table_row(building, attributes, self.units))

    def put(self, row: Row) -> None:
        """Write a building that `table_row` made, here or in another process."""
        for name, value in row[1].items():
            self.kinds.setdefault(name, set()).add(kind_of(value))
        outline, values = row
        self.waiting.write(json.dumps([outline and outline.hex(), values]).encode() + b"\n")
        self.count += 1

    def finish(self) -> None:
        kinds = {name: column_kind(name, found, self.prefix) for name, found in self.kinds.items()} or {"id": str}
        self.waiting.seek(0)
        for number, rows in enumerate(self.batches()):
            self.write_rows(rows, kinds, append=number > 0)

    def batches(self) -> Iterator[list[Row]]:
        """The waiting rows, some thousands at a time; one empty batch if there are none."""
        left = self.count
        while True:
            size = min(left, ROWS_AT_ONCE)
            waiting = (json.loads(self.waiting.readline()) for _ in range(size))
            yield [(outline and bytes.fromhex(outline), values) for outline, values in waiting]
            left -= size
            if not left:
                return

    def write_rows(self, rows: list, kinds: dict[str, type], append: bool) -> None:
        import pyogrio
        from pyogrio.errors import DataLayerError, DataSourceError, FeatureError

        columns = [column([row.get(name) for _, row in rows], kind) for name, kind in kinds.items()]
        try:
            with fixed_date():
                pyogrio.raw.write(
                    self.hidden,
                    objects([wkb for wkb, _ in rows]),
                    [values for values, _ in columns],
                    column_names(kinds),
                    [mask for _, mask in columns],
                    layer=LAYER,
                    driver="GPKG",
                    geometry_type="MultiPolygon",
                    promote_to_multi=True,
                    crs=self.plan_wkt,
                    append=append,
                )
        except (DataSourceError, DataLayerError, FeatureError, RuntimeError, OSError) as error:
            raise OutputError(
                f"expected to write {os.fspath(self.path)}, got: {error}; check the permissions and the space left"
            ) from error


def table_row(building: Building, attributes: dict[str, Any], units: Units = METRES) -> Row:
    """The outline of `building` in `units` as WKB (None where it is unknown) and its attributes by column."""
    named = {f"{name}_input" if name.lower() == "id" else name: value for name, value in attributes.items()}
    outline = plan_outline(building)
    if outline is not None and not units.are_metres:
        outline = shapely.transform(outline, units.from_metres)
    return None if outline is None else shapely.to_wkb(outline), {"id": plain_text(building.id), **named}


@contextmanager
def fixed_date() -> Iterator[None]:
    """GDAL writes FIXED_DATE as the date of change, and an unknown CRS is no warning."""
    import pyogrio

    before = pyogrio.get_gdal_config_option("OGR_CURRENT_DATE")
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": FIXED_DATE})
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "'crs' was not provided")
            yield
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": before})


def plan_outline(building: Building) -> shapely.Geometry | None:
    """The building's outline in world coordinates: the modelled one, else the one asked for, else None."""
    if building.roof is not None:
        return shapely.transform(building.roof.outline, building.roof.frame.to_world)
    if building.solid is not None:
        rings = [[building.solid.vertices[list(r), :2] for r in f.rings] for f in building.solid.of_kind(GROUND)]
        return shapely.union_all([shapely.Polygon(outer, inner) for outer, *inner in rings])
    return building.footprint


def kind_of(value: Any) -> type:
    """bool, int, float, str or NoneType; whole numbers beyond 64 bits count as text."""
    return str if type(value) is int and abs(value) >= 2**63 else type(value)


def column_kind(name: str, found: set[type], prefix: str) -> type:
    """The one type that holds all values found; a computed figure that is always unknown stays a decimal."""
    known = found - {type(None)}
    if not known:
        computed = {prefix + a.name: a.kind for a in ROOFER} | {OWN + a.name: a.kind for a in HIPROOF}
        return str if computed.get(name, "text") == "text" else float
    if len(known) == 1:
        return known.pop()
    return str if str in known else float if float in known else int


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


def column_names(names: Iterable[str]) -> list[str]:
    """Names that SQLite, which does not tell upper from lower case, can hold beside its own columns.

    >>> column_names(["id", "Year", "year", "fid"])
    ['id', 'Year', 'year_2', 'fid_2']
    """
    taken, unique = set(RESERVED), []
    for name in names:
        candidate, number = name, 1
        while candidate.lower() in taken:
            number += 1
            candidate = f"{name}_{number}"
        taken.add(candidate.lower())
        unique.append(candidate)
    return unique
