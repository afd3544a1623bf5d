"""Every kind of output file, declared once in data/formats.toml.

A run, its merge, `hiproof build`, `hiproof convert`, help and documents derive from FORMATS: a new
format is a module and a table there. A module has either

    writer(path, head, **given)         the incremental writer (a write.writer.BuildingWriter)
    write_models(path, buildings, crs)  of 3D viewers, which draw a write.meshes.viewed.ViewedModel;
                                        returns how many it wrote

The writer of a file that a run writes makes a building's part of it in a worker (`fragment`).

Modules are imported when a file of theirs is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from .data_files import read_data_file
from .settings import Settings, WriteSettings


@dataclass(frozen=True)
class Format:
    """A kind of output file, as data/formats.toml declares it."""

    file: str
    what: str
    module: str
    fragment: str = ""
    when: dict[str, list[Any]] = field(default_factory=dict)
    tile_ending: str = ""
    given: dict[str, Any] = field(default_factory=dict)


FORMATS = {name: Format(**row) for name, row in read_data_file("formats").items()}
# What `hiproof convert` writes: the parameters are what it reads.
CONVERTED = {name: format for name, format in FORMATS.items() if name != "parameters"}

# What a work tile may have of its own.
OF_TILES = {name: format for name, format in FORMATS.items() if format.tile_ending}

TILE_FOLDER = "models"  # in a run's folder: the models of work tiles, where a run writes these


def list_requested_files(settings: Settings, folder: Path) -> dict[str, Path]:
    """Return paths in `folder`, by format, of the files for the whole area of a run.

    >>> [path.name for path in list_requested_files(Settings(), Path("models")).values()]
    ['buildings.gml', 'buildings.city.jsonl', 'parameters.jsonl', 'buildings.gpkg']
    """
    by_tile_alone = settings.city.models == "tiles"
    return {
        name: folder / format.file
        for name, format in requested_formats(settings.write).items()
        if not (by_tile_alone and format.tile_ending)
    }


def list_requested_tile_files(settings: Settings, folder: Path, tile: str) -> dict[str, Path]:
    """Return paths in `folder` of a work tile's files by format, none if a run writes none."""
    by_tile = settings.city.models != "merged"
    return {
        name: folder / f"{tile}{format.tile_ending}"
        for name, format in requested_formats(settings.write).items()
        if by_tile and format.tile_ending
    }


def list_model_paths(settings: Settings, folder: Path) -> list[Path]:
    """Return where a run's models lie in `folder`: files of the whole area, a folder of tiles.

    >>> [path.name for path in list_model_paths(Settings.from_dict({"write": {"citygml": "3.0"}}),
    ...     Path("out"))]
    ['buildings.citygml3.gml', 'buildings.city.jsonl']
    """
    whole = [
        path for name, path in list_requested_files(settings, folder).items() if name in OF_TILES
    ]
    return whole if settings.city.models == "merged" else [*whole, folder / TILE_FOLDER]


def requested_fragments(write: WriteSettings) -> list[str]:
    """Return the modules that make a building's parts of all files, work tiles' included."""
    return list(dict.fromkeys(format.fragment for format in requested_formats(write).values()))


def requested_formats(write: WriteSettings) -> dict[str, Format]:
    """Return the formats of a run, as whole files or by work tile."""
    return {
        name: format
        for name, format in FORMATS.items()
        if format.fragment
        and all(getattr(write, setting) in values for setting, values in format.when.items())
    }


def import_format(name: str) -> ModuleType:
    """Import the module of `write` of that name."""
    return import_module(f".write.{name}", __package__)


def choose_format(file: str) -> str | None:
    """Return the format of files named like `file` by its whole ending, else its suffix, or None.

    >>> [choose_format(name) for name in ("a.gml", "a.citygml3.gml", "b.json", "c.jsonl", "d.txt")]
    ['citygml2', 'citygml3', 'cityjson', 'cityjsonseq', None]
    """
    files = [(format.file, name) for name, format in reversed(CONVERTED.items())]
    names = {Path(file).suffix: name for file, name in files}
    names |= {file[file.index(".") :]: name for file, name in files}
    endings = [ending for ending in names if file.lower().endswith(ending)]
    return names[max(endings, key=len)] if endings else None
