"""The four files of a run, written in one pass over the buildings.

A building's text is the same in whichever process it is made: `fragments` makes it for all files at once, in a worker,
and `join_fragments` only puts texts one after the other.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from ..model import Building
from ..status import Status
from .attributes import AttributesWriter
from .building_attributes import building_attributes, figures_of
from .citygml import CityGMLWriter, gml_member
from .cityjson import SCALE, CityJSONWriter, feature_line
from .cityjson_geometry import Vertices
from .fragments import Fragments
from .geoparquet import GeoParquetWriter
from .naming import FileUnits
from .parameters import FileHead, ParametersWriter, parameters_line
from .roof_figures import RoofFigures
from .table_rows import table_rows
from .writer import BuildingWriter


def write_all(folder: str | os.PathLike, buildings: Iterable[Building], crs: Any = None) -> list[str]:
    """Write buildings.gml, buildings.city.jsonl, parameters.jsonl and buildings.gpkg to `folder`.

    `buildings` may be a generator; `crs` is anything pyproj understands or None. Returns the ids of buildings whose solid
    turned out to be broken: they are written without it, as internal errors, and do not stop the others. When anything
    else goes wrong before the last building none of the files appears and older ones stay. Raises OutputError when the
    folder cannot be written.
    """
    folder, broken = Path(folder), []
    with ExitStack() as stack:
        writers: list[BuildingWriter] = [
            CityGMLWriter(folder / "buildings.gml", crs),
            CityJSONWriter(folder / "buildings.city.jsonl", crs),
            ParametersWriter(folder / "parameters.jsonl", FileHead(crs)),
            AttributesWriter(folder / "buildings.gpkg", crs),
        ]
        # The table does most of its work at the end: entered last it is closed first, and its failure stops the others.
        for writer in writers:
            stack.enter_context(writer)
        for asked in buildings:
            building, figures = measured(asked)
            if building is not asked:
                broken.append(str(asked.id))
            for writer in writers:
                writer.add(building, figures)
    return broken


def fragments(
    asked: Building, names: tuple[str, str], translate: np.ndarray, units: FileUnits
) -> tuple[Building, Fragments]:
    """The texts of one building, `names` being its CityJSON id and its gml:id, and the building they tell of.

    `translate` (3,) is the offset of the CityJSON file, `units` those of coordinates in each file. A solid that cannot
    be measured is left out, as in `write_all`.
    """
    building, figures = measured(asked)
    attributes = building_attributes(building, figures, units=units.gml)
    feature = feature_line(building, figures, attributes, names[0], Vertices(translate, SCALE, units.cityjson))
    member = gml_member(building, figures, attributes, names[1], units.gml)
    return building, Fragments(
        member, feature, parameters_line(building), table_rows(building, figures, attributes, units.gml)
    )


def join_fragments(files: dict[str, Path], parts: Iterable[Fragments], head: FileHead) -> None:
    """Write `files` of a run from `parts`, each whole or not at all; as `write_all` would, without making any text.

    `files` are paths by what they hold: gml, cityjson, parameters, gpkg (the tables) or parquet, parquet_parts,
    parquet_surfaces (the same as GeoParquet). Raises OutputError when one cannot be written.
    """
    writers = {
        "gml": lambda path: (CityGMLWriter(path, head.crs), "gml"),
        "cityjson": lambda path: (CityJSONWriter(path, head.crs, translate=head.offset), "cityjson"),
        "parameters": lambda path: (ParametersWriter(path, head), "parameters"),
        "gpkg": lambda path: (AttributesWriter(path, head.crs), "rows"),
        "parquet": lambda path: (GeoParquetWriter(path, head.crs), "rows"),
        "parquet_parts": lambda path: (GeoParquetWriter(path, head.crs, layer="parts"), "rows"),
        "parquet_surfaces": lambda path: (GeoParquetWriter(path, head.crs, layer="roof_surfaces"), "rows"),
    }
    with ExitStack() as stack:
        opened = []
        for kind, path in files.items():
            writer, content = writers[kind](path)
            opened.append((stack.enter_context(writer), content))
        for part in parts:
            for writer, content in opened:
                writer.put(getattr(part, content))


def measured(building: Building) -> tuple[Building, RoofFigures | None]:
    """`building` and the figures of its solid; without the solid if that cannot be measured."""
    try:
        if building.solid is not None and not np.isfinite(building.solid.vertices).all():
            raise ValueError("its solid has coordinates that are not numbers")
        return building, figures_of(building)
    except (ValueError, IndexError) as error:
        detail = f"{Status.INTERNAL_ERROR.value} ({error})"
        return dataclasses.replace(
            building, status=Status.INTERNAL_ERROR, detail=detail, solid=None, roof=None, terrain_intersection=()
        ), None
