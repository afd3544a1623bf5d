"""CityJSON 2.0: one building a line (CityJSONSeq), or one document.

A building is written as soon as it is added and forgotten, so a city needs no more memory than a
street. The first line must name the offset of all coordinates and their extent, which only the last
building settles: its place is reserved and filled in at the end. The offset is the first solid's
corner rounded down to whole thousands, so that small changes of the input leave the integers of all
other buildings as they were.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np

from ...data_files import Values
from ...model import Building
from ...settings import WriteSettings
from ..building_attributes import OWN, PREFIX
from ..files import scratch
from ..fragments import Fragment, Sheet
from ..head import FileHead
from ..naming import FUNCTIONS, reference_system
from ..values import WIDEST, dump, metres
from ..writer import BuildingWriter
from .boundaries import (
    LOD_SOLID,
    Vertices,
    building_geometry,
    first_corner,
    part_geometry,
    solid_geometry,
)

# units of the file; offsets are whole thousands, so that files of neighbouring tiles often share
# theirs
GRID = 1000.0


def write_cityjson(
    path: str | os.PathLike[str],
    buildings: Iterable[Building],
    crs: Any = None,
    prefix: str = PREFIX,
    scale: float = FileHead.scale,
    write: WriteSettings | None = None,
) -> None:
    """Write `buildings` (solids in world metres) to `path`.

    It is CityJSONSeq 2.0, or one document if the name ends in `.json`. `crs` is anything pyproj
    understands or None; coordinates are written in its unit. `prefix` goes before roofer's
    attribute names; `scale` is the grid that coordinates are rounded to, in the file's unit;
    `write` says what is drawn of a building. Raises OutputError when the file cannot be written; an
    older file then stays.
    """
    head = FileHead(crs, write=write or WriteSettings(), prefix=prefix, scale=scale)
    CityJSONWriter(path, head).add_all(buildings)


class CityJSONWriter(BuildingWriter):
    """Incremental form of `write_cityjson`."""

    def __init__(self, path: str | os.PathLike[str], head: FileHead) -> None:
        super().__init__(path, head)
        self.reference_system = reference_system(self.head.crs_of_files)
        self.is_document = str(path).endswith(".json")
        self.vertex_count = self.object_count = 0

    def begin(self, stack: ExitStack) -> None:
        self.header_length = len(self.header(np.full(3, WIDEST), [WIDEST] * 6))
        self.file.write(b" " * self.header_length + b"\n")
        # The vertices of a document stand in one list after all objects: they wait in a second
        # file.
        if self.is_document:
            self.waiting = stack.enter_context(scratch(self.path))

    def add(self, sheet: Sheet) -> None:
        """Write one building; the first that has coordinates sets the file's offset."""
        corner = first_corner(sheet.building) if self.head.offset is None else None
        if corner is not None:
            place = self.head.units.cityjson.from_metres(corner[:2])
            self.head = replace(self.head, offset=choose_offset(place))
        super().add(sheet)

    @staticmethod
    def fragment(sheet: Sheet) -> Fragment:
        """Return a building's CityJSONFeature about the file's offset."""
        head = sheet.head
        offset = np.zeros(3) if head.offset is None else head.offset
        vertices = Vertices(offset, head.scale, head.units.cityjson)
        objects = city_objects(sheet, vertices)
        feature = {
            "type": "CityJSONFeature",
            "id": sheet.name,
            "CityObjects": objects,
            "vertices": vertices.grid,
        }
        return Fragment(
            dump(feature) + b"\n", compute_extent(vertices) if vertices.numbers else None
        )

    def put(self, fragment: Fragment) -> None:
        """Write a building whose line is about this file's offset."""
        self.extend(fragment)
        if self.is_document:
            self.add_to_document(json.loads(fragment.text))
        else:
            self.file.write(fragment.text)

    def add_to_document(self, feature: Values) -> None:
        for name, city_object in feature["CityObjects"].items():
            for geometry in city_object.get("geometry", ()):
                geometry["boundaries"] = shift_indices(geometry["boundaries"], self.vertex_count)
            self.file.write(
                (b",\n" if self.object_count else b"") + dump(name) + b":" + dump(city_object)
            )
            self.object_count += 1
        if feature["vertices"]:
            text = dump(feature["vertices"])[1:-1]
            self.waiting.write((b",\n" if self.vertex_count else b"") + text)
        self.vertex_count += len(feature["vertices"])

    def finish(self) -> None:
        if self.is_document:
            self.file.write(b'},\n"vertices":[')
            self.waiting.seek(0)
            shutil.copyfileobj(self.waiting, self.file)
            self.file.write(b"]}\n")
        translate = np.zeros(3) if self.head.offset is None else self.head.offset
        extent = (
            [metres(v) for v in (*self.low, *self.high)] if np.isfinite(self.low).all() else None
        )
        self.file.seek(0)
        self.file.write(self.header(translate, extent).ljust(self.header_length))

    def header(self, translate: np.ndarray, extent: list[float] | None) -> bytes:
        """Return the first line; of a document, all before the first object."""
        metadata: Values = {}
        if extent is not None:
            metadata["geographicalExtent"] = extent
        if self.reference_system is not None:
            metadata["referenceSystem"] = self.reference_system
        transform = {"scale": [self.head.scale] * 3, "translate": [float(v) for v in translate]}
        head = {"type": "CityJSON", "version": "2.0", "transform": transform, "metadata": metadata}
        if self.is_document:
            return dump(head)[:-1] + b',"CityObjects":{'
        return dump({**head, "CityObjects": {}, "vertices": []})


writer = CityJSONWriter


def choose_offset(corner_xy: np.ndarray) -> np.ndarray:
    """Return the offset (3,), in whole thousands, so seldom moved, of a file at (2,)."""
    return np.append(np.floor(np.asarray(corner_xy) / GRID) * GRID, 0.0)


def city_objects(sheet: Sheet, vertices: Vertices) -> dict[str, Values]:
    """Return CityObjects, building and parts, by id; their vertices go to `vertices`."""
    geometry, children = building_geometry(sheet, vertices), {}
    for k, part in enumerate(sheet.shapes.parts, 1):
        shapes = part_geometry(sheet, part, vertices)
        children[f"{sheet.name}-part{k}"] = child(sheet, "BuildingPart", part.attributes, shapes)
    for k, box in enumerate(sheet.boxes):
        kind = sheet.building.model.installations[k].type
        attributes = {"function": FUNCTIONS[kind], f"{OWN}type": kind}
        shapes = [solid_geometry(box, vertices, LOD_SOLID)]
        name = f"{sheet.name}-installation{k + 1}"
        children[name] = child(sheet, "BuildingInstallation", attributes, shapes)
    extent = {"geographicalExtent": compute_extent(vertices)} if geometry else {}
    whole = {"type": "Building", **extent, "attributes": sheet.attributes}
    whole |= {"geometry": geometry} if geometry else {}
    whole |= {"children": list(children)} if children else {}
    return {sheet.name: whole, **children}


def child(sheet: Sheet, kind: str, attributes: Values, geometry: list[Values]) -> Values:
    """Return a CityObject that belongs to the building."""
    return {"type": kind, "parents": [sheet.name], "attributes": attributes, "geometry": geometry}


def compute_extent(vertices: Vertices) -> tuple[float, ...]:
    """Return low x y z and high x y z of all vertices."""
    grid = np.array(vertices.grid)
    lower, upper = (
        edge * vertices.scale + vertices.origin for edge in (grid.min(axis=0), grid.max(axis=0))
    )
    return tuple(metres(v) for v in (*lower, *upper))


def shift_indices(boundaries: Any, count: int) -> Any:
    """Raise each index in nested lists of vertex indices by `count`."""
    return (
        boundaries + count
        if isinstance(boundaries, int)
        else [shift_indices(inner, count) for inner in boundaries]
    )
