"""`hiproof load`: the models of a run into PostGIS."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..log import count_things
from ..read.damage import SkippedBuildings


def load(
    folder: Annotated[Path, typer.Argument(help="output folder of a run")],
    database: Annotated[str, typer.Argument(help="postgresql://user@host/database")],
    prefix: Annotated[
        str,
        typer.Option(
            help="first part of the table names, at most 48 letters, digits and underscores"
        ),
    ] = "hiproof",
) -> None:
    """Load the models of a run into PostGIS tables; loading again replaces them.

    Exit code: 0 all buildings were loaded, 2 damaged ones were left out, or unusable input.
    """
    from ..view.loading import load_postgis

    left_out = SkippedBuildings()
    count = load_postgis(folder, database, prefix, left_out)
    tables = f"{prefix}_buildings, {prefix}_roofs and {prefix}_parts"
    typer.echo(f"{count_things(count, 'building')} loaded into {tables}{left_out.describe()}")
    if left_out.exit_code:
        raise typer.Exit(left_out.exit_code)
