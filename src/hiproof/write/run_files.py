"""The files of a run, written in one pass over the buildings.

A building's text is the same in whichever process it is made: `fragments` makes it for all files at
once, in a worker, and `join_fragments` only puts texts one after the other.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from ..formats import FORMATS, import_format, requested_fragments
from ..model import Building
from ..model.roof_figures import RoofFigures
from ..status import Status
from .building_attributes import measure_figures
from .fragments import Fragments, Sheet, describe
from .head import FileHead
from .meshes.viewed import view_building
from .parameters import crs_text
from .writer import BuildingWriter


def make_writer(name: str, path: Path, head: FileHead, **given: Any) -> BuildingWriter:
    """Return the incremental writer of a file in the format of that name."""
    format = FORMATS[name]
    return import_format(format.module).writer(path, head, **format.given, **given)


def write_format(
    name: str, path: Path, sheets: Iterable[Sheet], head: FileHead, **given: Any
) -> int:
    """Write the buildings `sheets` to `path` in the format of that name; returns how many.

    Formats of 3D viewers leave out buildings without a solid. Raises OutputError where `path`
    cannot be written, and InputError for what the format cannot hold.
    """
    module = import_format(FORMATS[name].module)
    if hasattr(module, "write_models"):
        models = (view_building(sheet) for sheet in sheets if sheet.building.built is not None)
        return module.write_models(path, models, crs_text(head.crs_of_files), **given)
    count = 0
    with make_writer(name, path, head, **given) as writer:
        for sheet in sheets:
            writer.add(sheet)
            count += 1
    return count


def fragments(
    requested: Building, names: tuple[str, str], head: FileHead
) -> tuple[Building, Fragments]:
    """Return one building, and its texts.

    `names` are its CityJSON id and its gml:id. They are those of the files that a run writes,
    `head` what these have in common, the offset of the CityJSON file included. A solid that cannot
    be measured is left out.
    """
    sheet = describe(*measure_or_drop_solid(requested), head, *names)
    return sheet.building, make_texts(sheet, requested_fragments(head.write))


def make_texts(sheet: Sheet, kinds: Iterable[str]) -> Fragments:
    """Return a building's texts by the module that makes them."""
    return {kind: import_format(kind).writer.fragment(sheet) for kind in kinds}


def join_fragments(files: dict[str, Path], parts: Iterable[Fragments], head: FileHead) -> None:
    """Write `files` of a run from `parts`, each whole or not at all.

    No text is made. `files` are paths by format, a key of FORMATS. Raises OutputError when one
    cannot be written.
    """
    with ExitStack() as stack:
        opened = [
            (stack.enter_context(make_writer(name, path, head)), FORMATS[name].fragment)
            for name, path in files.items()
        ]
        for part in parts:
            for writer, content in opened:
                writer.put(part[content])


def measure_or_drop_solid(building: Building) -> tuple[Building, RoofFigures | None]:
    """Return the building and its figures, or without a solid that has none."""
    try:
        if building.built is not None and not np.isfinite(building.solid.vertices).all():
            raise ValueError("its solid has coordinates that are not numbers")
        return building, measure_figures(building)
    except (ValueError, IndexError) as error:
        detail = f"{Status.INTERNAL_ERROR.value} ({error})"
        return dataclasses.replace(
            building,
            status=Status.INTERNAL_ERROR,
            detail=detail,
            built=None,
            terrain_intersection=(),
        ), None
