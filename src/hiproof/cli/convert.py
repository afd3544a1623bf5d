"""`hiproof convert`: models in another format."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Any

import click

from ..errors import InputError
from ..formats import CONVERTED, choose_format
from ..log import count_things
from ..progress import Update, count_progress, show_progress
from ..read.models.damage import SkippedBuildings

FormatName = StrEnum("FormatName", {name: name for name in CONVERTED})  # type: ignore[misc]
DEFAULT = "glb"


def convert(
    source: Path,
    out: Path | None = None,
    *,
    format: FormatName | None = None,
    crs: str | None = None,
    geoid_height: float | None = None,
) -> int:
    """Convert models of a run or of a file to another format.

    The models keep their attributes. Models of a run keep their roof parameters too, in formats
    that have a place for them. Exit code: 0 all models were converted, 2 damaged ones were left
    out, or unusable input.
    """
    from ..evaluate.run import list_run_inputs
    from ..write.files import refuse_replacing, suggest_elsewhere

    name = format.value if format else name_format(out)
    given = {} if geoid_height is None else {"geoid_height_m": geoid_height}
    if given and name != "3dtiles":
        raise InputError(
            f"expected --geoid-height with 3dtiles alone, got it with {name}; leave it out"
        )
    path = out or default_path(source, name)
    refuse_replacing([path], [source, *list_run_inputs(source)])
    with (
        show_progress("convert") as update,
        suggest_elsewhere(f"hiproof convert {source} OUT", out),
    ):
        text, left_out = convert_models(source, path, name, crs, update, **given)
    click.echo(text)
    return left_out.exit_code


def convert_models(
    source: Path, path: Path, name: str, crs: str | None, update: Update, **given: Any
) -> tuple[str, SkippedBuildings]:
    """Write the models of `source` to `path`; returns the result in a line and the damage."""
    from ..parametric.finished import open_run
    from ..write.run_files import write_format

    left_out = SkippedBuildings()
    run = open_run(source, crs)
    buildings = left_out.iterate_sound(run.describe(left_out))
    counted = count_progress(buildings, "convert", update)
    count = write_format(name, path, counted, run.head, **given)
    return f"{path}: {count_things(count, 'building')}{left_out.describe()}", left_out


def name_format(out: Path | None) -> str:
    """Return the format in which a name ends; raises InputError where that is none."""
    name = DEFAULT if out is None else choose_format(out.name)
    if name is None:
        suffixes = ", ".join(dict.fromkeys(Path(f.file).suffix for f in CONVERTED.values()))
        raise InputError(
            f"expected a name that ends in one of {suffixes}, got {out}; or pass --format"
        )
    return name


def default_path(source: Path, name: str) -> Path:
    """Return the path of a converted file without a name; a run's own is an InputError."""
    path = (source if source.is_dir() else source.parent) / CONVERTED[name].file
    if CONVERTED[name].fragment and path.exists():
        raise InputError(
            f"expected a name for the new file, got none while {path} is there already; try: "
            f"hiproof convert {source} OUT"
        )
    return path
