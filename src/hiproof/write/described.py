"""A building with its figures and attributes, for files of any format."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from ..formats import FORMATS, import_format
from ..model import Building
from ..model.roof_figures import RoofFigures
from .head import FileHead
from .meshes.viewed import view_building
from .parameters import crs_text


class Described(NamedTuple):
    """A building with the `figures` of its solid, if any, and `attributes` as in files."""

    building: Building
    figures: RoofFigures | None
    attributes: dict[str, Any]


def write_format(
    name: str, path: Path, buildings: Iterable[Described], head: FileHead, **given: Any
) -> int:
    """Write `buildings` to `path` in the format of that name; returns how many.

    Formats of 3D viewers leave out buildings without a solid. Raises OutputError where `path`
    cannot be written, and InputError for what the format cannot hold.
    """
    module, given = import_format(FORMATS[name].module), {**FORMATS[name].given, **given}
    if hasattr(module, "write_models"):
        models = (
            view_building(building, attributes, head.units.gml, head.write.lods)
            for building, _, attributes in buildings
            if building.built is not None
        )
        return module.write_models(path, models, crs_text(head.crs_of_files), **given)
    count = 0
    with module.writer(path, head, **given) as writer:
        for described in buildings:
            writer.add(*described)
            count += 1
    return count
