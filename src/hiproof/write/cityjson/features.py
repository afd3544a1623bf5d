"""CityJSON 2.0: one building a line (CityJSONSeq), or one document.

A building is written as soon as it is added and forgotten, so a city needs no more memory than a
street. The first line must name the offset of all coordinates and their extent, which only the last
building settles: its place is reserved and filled in at the end. The offset is the first solid's
corner rounded down to whole thousands, so that small changes of the input leave the integers of all
other buildings as they were.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import ExitStack
from typing import Any

import numpy as np

from ...model import Building
from ...settings import WriteSettings
from ..building_attributes import OWN, PREFIX
from ..files import scratch
from ..fragments import Fragment, Sheet
from ..head import FileHead
from ..naming import FUNCTIONS, reference_system
from ..shapes import PartShape
from ..values import WIDEST, dump, metres
from ..writer import BuildingWriter
from .boundaries import (
    LOD_OVERHANGS,
    LOD_SOLID,
    Vertices,
    building_geometry,
    first_corner,
    part_geometry,
    solid_geometry,
)

SCALE = 0.0001  # units of the file; tenths of a millimetre, on which solids are composed
# units of the file; offsets are whole thousands, so that files of neighbouring tiles often share
# theirs
GRID = 1000.0


def write_cityjson(
    path: str | os.PathLike[str],
    buildings: Iterable[Building],
    crs: Any = None,
    prefix: str = PREFIX,
    scale: float = SCALE,
    write: WriteSettings | None = None,
) -> None:
    """Write `buildings` (solids in world metres) to `path`.

    It is CityJSONSeq 2.0, or one document if the name ends in `.json`. `crs` is anything pyproj
    understands or None; coordinates are written in its unit. `prefix` goes before roofer's
    attribute names; `scale` is the grid that coordinates are rounded to, in the file's unit;
    `write` says what is drawn of a building. Raises OutputError when the file cannot be written; an
    older file then stays.
    """
    head = FileHead(crs, write=write or WriteSettings(), prefix=prefix)
    CityJSONWriter(path, head, scale).add_all(buildings)


class CityJSONWriter(BuildingWriter):
    """Incremental form of `write_cityjson`."""

    def __init__(self, path: str | os.PathLike[str], head: FileHead, scale: float = SCALE) -> None:
        super().__init__(path, head)
        self.units = self.head.units.cityjson
        self.reference_system = reference_system(self.head.crs_of_files)
        self.is_document = str(path).endswith(".json")
        self.scale = scale
        self.translate = head.offset
        self.low, self.high = np.full(3, np.inf), np.full(3, -np.inf)
        self.vertex_count = self.object_count = 0

    def begin(self, stack: ExitStack) -> None:
        self.header_length = len(self.header(np.full(3, WIDEST), [WIDEST] * 6))
        self.file.write(b" " * self.header_length + b"\n")
        # The vertices of a document stand in one list after all objects: they wait in a second
        # file.
        if self.is_document:
            self.waiting = stack.enter_context(scratch(self.path))

    def add_sheet(self, sheet: Sheet) -> None:
        vertices = Vertices(self.choose_origin(sheet.building), self.scale, self.units)
        if self.is_document:
            self.add_to_document(city_objects(sheet, vertices), vertices)
        else:
            self.put(feature_line(sheet, vertices))

    def put(self, fragment: Fragment) -> None:
        """Write a building whose line is about this file's `translate`."""
        self.widen(fragment.extent)
        self.file.write(fragment.text)

    def widen(self, extent: tuple[float, ...] | None) -> None:
        if extent is not None:
            self.low = np.minimum(self.low, extent[:3])
            self.high = np.maximum(self.high, extent[3:])

    def choose_origin(self, building: Building) -> np.ndarray:
        """Return the file's offset (3,), set by the first building that has coordinates."""
        if self.translate is None:
            corner = first_corner(building)
            if corner is None:
                return np.zeros(3)
            self.translate = choose_offset(self.units.from_metres(corner[:2]))
        return self.translate

    def add_to_document(self, objects: dict[str, dict[str, Any]], vertices: Vertices) -> None:
        self.widen(next(iter(objects.values())).get("geographicalExtent"))
        for name, city_object in objects.items():
            for geometry in city_object.get("geometry", ()):
                geometry["boundaries"] = shift_indices(geometry["boundaries"], self.vertex_count)
            self.file.write(
                (b",\n" if self.object_count else b"") + dump(name) + b":" + dump(city_object)
            )
            self.object_count += 1
        if vertices.grid:
            self.waiting.write((b",\n" if self.vertex_count else b"") + dump(vertices.grid)[1:-1])
        self.vertex_count += len(vertices.grid)

    def finish(self) -> None:
        if self.is_document:
            self.append_waiting_vertices()
        translate = np.zeros(3) if self.translate is None else self.translate
        extent = (
            [metres(v) for v in (*self.low, *self.high)] if np.isfinite(self.low).all() else None
        )
        self.file.seek(0)
        self.file.write(self.header(translate, extent).ljust(self.header_length))

    def append_waiting_vertices(self) -> None:
        self.file.write(b'},\n"vertices":[')
        self.waiting.seek(0)
        while chunk := self.waiting.read(1 << 20):
            self.file.write(chunk)
        self.file.write(b"]}\n")

    def header(self, translate: np.ndarray, extent: list[float] | None) -> bytes:
        """Return the first line; of a document, all before the first object."""
        metadata: dict[str, Any] = {}
        if extent is not None:
            metadata["geographicalExtent"] = extent
        if self.reference_system is not None:
            metadata["referenceSystem"] = self.reference_system
        transform = {"scale": [self.scale] * 3, "translate": [float(v) for v in translate]}
        head = {"type": "CityJSON", "version": "2.0", "transform": transform, "metadata": metadata}
        if self.is_document:
            return dump(head)[:-1] + b',"CityObjects":{'
        return dump({**head, "CityObjects": {}, "vertices": []})


writer = CityJSONWriter


def fragment(sheet: Sheet) -> Fragment:
    """Return a building's line in a run's file."""
    offset = np.zeros(3) if sheet.head.offset is None else sheet.head.offset
    vertices = Vertices(offset, SCALE, sheet.head.units.cityjson)
    return feature_line(sheet, vertices)


def choose_offset(corner_xy: np.ndarray) -> np.ndarray:
    """Return the offset (3,), in whole thousands, so seldom moved, of a file at (2,)."""
    return np.append(np.floor(np.asarray(corner_xy) / GRID) * GRID, 0.0)


def city_objects(sheet: Sheet, vertices: Vertices) -> dict[str, dict[str, Any]]:
    """Return CityObjects, building and parts, by id; their vertices go to `vertices`."""
    name, prefix, lods = sheet.name, sheet.head.prefix, sheet.head.write.lods
    finest = sheet.finest if LOD_OVERHANGS in lods and sheet.figures is not None else None
    geometry = building_geometry(
        sheet.building, sheet.figures, sheet.shapes, vertices, prefix, lods, sheet.surfaces, finest
    )
    whole: dict[str, Any] = {"type": "Building", "attributes": sheet.attributes}
    parts = {
        f"{name}-part{k}": part_object(sheet, part, vertices)
        for k, part in enumerate(sheet.shapes.parts, 1)
    }
    installations = {
        f"{name}-installation{k}": installation_object(sheet, k - 1, vertices)
        for k in range(1, len(sheet.boxes) + 1)
    }
    if geometry:
        whole = {
            "type": "Building",
            "geographicalExtent": list(compute_extent(vertices)),
            "attributes": sheet.attributes,
        }
        whole["geometry"] = geometry
    children = {**parts, **installations}
    if children:
        whole["children"] = list(children)
    return {name: whole, **children}


def installation_object(sheet: Sheet, number: int, vertices: Vertices) -> dict[str, Any]:
    """Return the CityObject of an installation of the building."""
    kind = sheet.building.model.installations[number].type
    return {
        "type": "BuildingInstallation",
        "parents": [sheet.name],
        "attributes": {"function": FUNCTIONS[kind], f"{OWN}type": kind},
        "geometry": [solid_geometry(sheet.boxes[number], vertices, LOD_SOLID)],
    }


def part_object(sheet: Sheet, part: PartShape, vertices: Vertices) -> dict[str, Any]:
    """Return the CityObject of a part of the building."""
    geometry = part_geometry(
        sheet.building, part, vertices, sheet.head.prefix, sheet.head.write.lods
    )
    return {
        "type": "BuildingPart",
        "parents": [sheet.name],
        "attributes": part.attributes,
        "geometry": geometry,
    }


def compute_extent(vertices: Vertices) -> tuple[float, ...]:
    """Return low x y z and high x y z of all vertices."""
    grid = np.array(vertices.grid)
    lower, upper = (
        edge * vertices.scale + vertices.origin for edge in (grid.min(axis=0), grid.max(axis=0))
    )
    return tuple(metres(v) for v in (*lower, *upper))


def feature_line(sheet: Sheet, vertices: Vertices) -> Fragment:
    """Return a building's CityJSONFeature, `vertices` empty, about the file's offset."""
    objects = city_objects(sheet, vertices)
    feature = {
        "type": "CityJSONFeature",
        "id": sheet.name,
        "CityObjects": objects,
        "vertices": vertices.grid,
    }
    return Fragment(dump(feature) + b"\n", compute_extent(vertices) if vertices.grid else None)


def shift_indices(boundaries: Any, count: int) -> Any:
    """Raise each index in nested lists of vertex indices by `count`."""
    return (
        boundaries + count
        if isinstance(boundaries, int)
        else [shift_indices(inner, count) for inner in boundaries]
    )
