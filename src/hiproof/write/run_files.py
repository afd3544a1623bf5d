"""The four files of a run, written in one pass over the buildings."""

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
from .building_attributes import figures_of
from .citygml import CityGMLWriter
from .cityjson import CityJSONWriter
from .parameters import ParametersWriter
from .roof_figures import RoofFigures
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
            ParametersWriter(folder / "parameters.jsonl"),
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
