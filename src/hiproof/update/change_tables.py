"""changes.csv and changes.gpkg: what an update found.

Both follow from the parameters.jsonl beside them. The layers of changes.gpkg leave out what is
unchanged.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ..errors import InputError
from ..formats import FORMATS
from ..parametric.file import opened_parameters
from ..parametric.record import polygon, read_change, read_outline
from ..status import Change
from ..write.colours import CHANGE_COLOURS
from ..write.files import atomic
from ..write.head import FileHead, UpdateHead
from ..write.naming import plan_wkt
from ..write.tables.geopackage import OUTLINE_GEOMETRY, write_styles
from ..write.tables.styles import Style
from ..write.tables.vector_layer import GEOPACKAGE, write_layer

CSV_FILE, GPKG_FILE = "changes.csv", "changes.gpkg"
CHANGE_COLUMNS: dict[str, type] = {
    "id": str,
    "class": str,
    "kind": str,
    "difference_m": float,
    "sigma_m": float,
    "area_m2": float,
    "height_m": float,
    "confidence": float,
}
"""Columns of both tables: a change, and its figures at one place.

Roofs outside all outlines have the last two.
"""
TABLE_COLUMNS: dict[str, type] = {
    **CHANGE_COLUMNS,
    "chance": float,
    "survey": str,
    "places": int,
    "predecessors": str,
}
PLACE_COLUMNS: dict[str, type] = {**CHANGE_COLUMNS, "old_part": int, "new_part": int}
OUTSIDE_CLASS = "outside"  # the class of a roof outside all outlines
BUILDINGS_LAYER, PLACES_LAYER = "changed_buildings", "changed_places"
CHANGE_STYLES = tuple(
    Style(layer, "changes", '"class"', CHANGE_COLOURS, alpha)
    for layer, alpha in ((BUILDINGS_LAYER, 0.3), (PLACES_LAYER, 0.8))
)


@dataclass(frozen=True)
class FoundChange:
    """A building that is not unchanged.

    `record` has the id and the change of its object of parameters.jsonl.
    """

    record: dict[str, Any]
    outline: shapely.Geometry | None


def write_changes(folder: Path) -> tuple[list[FoundChange], tuple[Path, ...]]:
    """Write changes.csv and changes.gpkg into the folder of an update.

    Returns the buildings that are not unchanged, and both paths. There are none in the folder of
    another run. Roofs outside all outlines follow, the largest first. Unchanged buildings come last
    in changes.csv.
    """
    with opened_parameters(folder / FORMATS["parameters"].file) as (head, records):
        if head.update is None:
            return [], ()
        found, unchanged = collect_changes(records, head.update)
    by_size = sorted(head.update.roofs_outside, key=lambda roof: roof["area"], reverse=True)
    outside = [report_outside(roof, head.update.survey) for roof in by_size]
    files = folder / CSV_FILE, folder / GPKG_FILE
    with atomic(files[0]) as temporary:
        write_csv(Path(temporary), [*found, *outside], unchanged, head.update)
    with atomic(files[1]) as temporary:
        write_geopackage(Path(temporary), [*found, *outside], head)
    return found, files


def collect_changes(
    records: Iterable[dict[str, Any]], update: UpdateHead
) -> tuple[list[FoundChange], list[str]]:
    """Return the changes that the survey of an update shows, and the ids of all other buildings.

    One that cannot be read is left out: it is not built, either.
    """
    result, unchanged = [], []
    for record in records:
        try:
            change = read_change(record)
            if change is not None and change["survey"] == update.survey:
                values = {"id": record["id"], "change": change}
                result.append(FoundChange(values, find_outline(record)))
            else:
                unchanged.append(record["id"])
        except InputError:
            continue
    return result, unchanged


def report_outside(roof: dict[str, Any], survey: str) -> FoundChange:
    """Return a roof outside all outlines as a change."""
    place = {"difference": None, "sigma": None, "parts": [None, None], **roof}
    change = {
        "class": OUTSIDE_CLASS,
        "chance": None,
        "survey": survey,
        "places": [place],
        "predecessors": [],
    }
    return FoundChange({"id": roof["id"], "change": change}, None)


def find_outline(record: dict[str, Any]) -> shapely.Geometry | None:
    """Return the outline of a building in the world, None where it is unknown."""
    outline = read_outline(record)
    if outline is None and record.get("outline") is not None:
        return polygon(record["outline"], "outline")
    return outline


def write_csv(
    path: Path, changes: list[FoundChange], unchanged: list[str], update: UpdateHead
) -> None:
    """Write a row for each change and for each of the `unchanged` buildings (ids)."""
    code = Change.UNCHANGED.code
    values = {"class": code, "kind": code, "survey": update.survey, "places": 0}
    same = dict.fromkeys(TABLE_COLUMNS) | values
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(TABLE_COLUMNS)
        table.writerows(make_row(change, TABLE_COLUMNS) for change in changes)
        table.writerows((same | {"id": name}).values() for name in unchanged)


def make_row(
    change: FoundChange, columns: dict[str, type], place: dict[str, Any] | None = None
) -> tuple[Any, ...]:
    """Return the values of a building at one place, None for its largest."""
    found = change.record["change"]
    place = next(iter(found["places"]), {}) if place is None else place
    old_part, new_part = place.get("parts") or (None, None)
    values = {"kind": found["class"], **place} | {
        "id": change.record["id"],
        "class": found["class"],
        "chance": found["chance"],
        "survey": found["survey"],
        "places": len(found["places"]),
        "predecessors": " ".join(map(str, found["predecessors"])) or None,
        "old_part": old_part,
        "new_part": new_part,
    }
    return tuple(values.get(name.removesuffix("_m2").removesuffix("_m")) for name in columns)


def write_geopackage(path: Path, changes: list[FoundChange], head: FileHead) -> None:
    """Write the layers of buildings and of places, with their QGIS style."""
    buildings = [c for c in changes if c.record["change"]["class"] != OUTSIDE_CLASS]
    outlines, rows = [c.outline for c in buildings], [make_row(c, TABLE_COLUMNS) for c in buildings]
    add_layer(path, BUILDINGS_LAYER, TABLE_COLUMNS, outlines, rows, head)
    places = [(change, place) for change in changes for place in change.record["change"]["places"]]
    areas = [
        shapely.union_all([polygon(rings, "an outline") for rings in place.get("outlines") or []])
        for _, place in places
    ]
    rows = [make_row(change, PLACE_COLUMNS, place) for change, place in places]
    add_layer(path, PLACES_LAYER, PLACE_COLUMNS, areas, rows, head)
    write_styles(path, CHANGE_STYLES)


def add_layer(
    path: Path,
    layer: str,
    columns: dict[str, type],
    geometries: list[Any],
    rows: list[tuple[Any, ...]],
    head: FileHead,
) -> None:
    """Add a layer of polygons, whose `geometries` are in world metres."""
    outlines = shapely.transform(np.array(geometries, object), head.units.table.from_metres)
    wkb = [None if g is None else g.wkb for g in outlines]
    crs = plan_wkt(head.crs_of_files)
    write_layer(path, layer, columns, rows, wkb, crs=crs, **GEOPACKAGE, **OUTLINE_GEOMETRY)
