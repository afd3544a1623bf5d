"""`hiproof load`: the models of a run into PostGIS."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..log import counted


def load(
    folder: Annotated[Path, typer.Argument(help="output folder of a run")],
    database: Annotated[str, typer.Argument(help="postgresql://user@host/database")],
    prefix: Annotated[str, typer.Option(help="first part of the table names")] = "hiproof",
) -> None:
    """Load the models of a run into PostGIS tables; loading again replaces them."""
    from ..evaluate.run import run_record, way_to_models
    from ..write.postgis import load_postgis

    count = load_postgis(folder, database, prefix, known=way_to_models(run_record(folder)))
    typer.echo(f"{counted(count, 'building')} loaded into {prefix}_buildings, {prefix}_roofs and {prefix}_parts")
