"""Buildings out: CityGML, CityJSON, parameters and an attribute table, each file whole or not at all.

Every format is a function over an iterable of buildings and an incremental writer with `add`; both hold one building in
memory at a time. `write_all` writes the four files of a run in one pass.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from ..model import Building
from .attributes import AttributesWriter, write_attributes
from .building_attributes import building_attributes, figures_of
from .citygml import CityGMLWriter, write_citygml
from .cityjson import CityJSONWriter, write_cityjson
from .files import atomic, atomic_file
from .parameters import ParametersWriter, read_parameters, write_parameters
from .roof_figures import RoofFigures, roof_figures
from .writer import BuildingWriter

__all__ = [
    "AttributesWriter",
    "BuildingWriter",
    "CityGMLWriter",
    "CityJSONWriter",
    "ParametersWriter",
    "RoofFigures",
    "atomic",
    "atomic_file",
    "building_attributes",
    "read_parameters",
    "roof_figures",
    "write_all",
    "write_attributes",
    "write_citygml",
    "write_cityjson",
    "write_parameters",
]


def write_all(folder: str | os.PathLike, buildings: Iterable[Building], crs: Any = None) -> None:
    """Write buildings.gml, buildings.city.jsonl, parameters.jsonl and buildings.gpkg to `folder` in one pass.

    `buildings` may be a generator; `crs` is anything pyproj understands or None. When anything goes wrong before the last
    building none of the files appears and older ones stay. Raises OutputError when the folder cannot be written.
    """
    folder = Path(folder)
    with ExitStack() as stack:
        writers: list[BuildingWriter] = [
            CityGMLWriter(folder / "buildings.gml", crs),
            CityJSONWriter(folder / "buildings.city.jsonl", crs),
            ParametersWriter(folder / "parameters.jsonl"),
            AttributesWriter(folder / "buildings.gpkg", crs),
        ]
        # The table does most of its work at the end: it is closed first, so that its failure keeps the others back.
        for writer in writers:
            stack.enter_context(writer)
        for building in buildings:
            figures = figures_of(building)
            for writer in writers:
                writer.add(building, figures)
