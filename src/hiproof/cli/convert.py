"""`hiproof convert`: the models of a run as files that 3D viewers open."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError, OutputError
from ..formats import OF_MODELS, import_format
from ..log import count_things
from ..read.damage import SkippedBuildings
from ..write.files import elsewhere

Made = StrEnum("Made", {name: name for name in OF_MODELS})  # type: ignore[misc]
FORMAT_HELP = ", ".join(f"{name} ({format.what})" for name, format in OF_MODELS.items())


def convert(
    folder: Annotated[Path, typer.Argument(help="output folder of a run")],
    out: Annotated[
        Path | None,
        typer.Argument(
            help="what to write [default: in the folder, named buildings as the run's own]"
        ),
    ] = None,
    format: Annotated[
        Made | None,
        typer.Option(help=f"what to make: {FORMAT_HELP} [default: by the name to write, else glb]"),
    ] = None,
    crs: Annotated[str | None, typer.Option(help="CRS of the models [default: the run's]")] = None,
    geoid_height: Annotated[
        float | None,
        typer.Option(
            help="height of the geoid above the ellipsoid, m, for 3dtiles [default: by pyproj's "
            "grid]"
        ),
    ] = None,
) -> None:
    """Convert the models of a run to a format of 3D viewers, with building ids, roof types and
    parameters as properties.

    Exit code: 0 all models were converted, 2 damaged ones were left out, or unusable input.
    """
    name = format.value if format else choose_format(out)
    arguments = {} if geoid_height is None else {"geoid_height_m": geoid_height}
    if arguments and name != "3dtiles":
        raise InputError(
            f"expected --geoid-height with 3dtiles alone, got it with {name}; leave it out"
        )
    path = out or Path(folder) / OF_MODELS[name].file
    try:
        left_out = convert_run(folder, path, name, crs, **arguments)
    except OutputError as error:
        raise elsewhere(error, f"hiproof convert {folder} OUT") if out is None else error from error
    if left_out.exit_code:
        raise typer.Exit(left_out.exit_code)


def convert_run(
    folder: Path, path: Path, name: str, crs: str | None = None, **given: float
) -> SkippedBuildings:
    """Write the models of the run in `folder` to `path` in the format `name`; returns what damage
    left out."""
    from ..view.run_models import run_buildings, run_crs_text

    left_out = SkippedBuildings()
    buildings = left_out.iterate_sound(run_buildings(folder, left_out))
    count = import_format(OF_MODELS[name].module).write_models(
        path, buildings, crs or run_crs_text(folder), **given
    )
    typer.echo(f"{path}: {count_things(count, 'building')}{left_out.describe()}")
    return left_out


def choose_format(out: Path | None) -> str:
    """The format that a name ends in, glb without a name. Raises InputError where that is none."""
    ending = "glb" if out is None else out.suffix.lower().removeprefix(".")
    if ending not in OF_MODELS:
        endings = ", ".join(f".{name}" for name in OF_MODELS)
        raise InputError(
            f"expected a name that ends in one of {endings}, got {out}; or say --format"
        )
    return ending
