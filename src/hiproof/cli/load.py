"""`hiproof load`: the models of a run into PostGIS."""

from __future__ import annotations

from pathlib import Path

import click

from ..errors import InputError
from ..log import count_things
from ..progress import show_progress
from ..read.models.damage import SkippedBuildings


def load(
    folder: Path,
    database: str,
    *,
    prefix: str = "hiproof",
    run: str | None = None,
    replace: bool = False,
    append: bool = False,
) -> int:
    """Load the models of a run into PostGIS tables.

    Loading the same run again replaces it. Exit code: 0 all buildings were loaded, 2 damaged ones
    were left out, or unusable input.
    """
    if replace and append:
        raise InputError("expected --replace or --append, got both; leave one out")
    left_out = SkippedBuildings()
    how = {"replace": replace, "append": append}
    with show_progress("load"):
        from ..parametric.finished import load_postgis

        count = load_postgis(folder, database, prefix, left_out, run, **how)
    tables = f"{prefix}_buildings, {prefix}_roofs and {prefix}_parts"
    click.echo(f"{count_things(count, 'building')} loaded into {tables}{left_out.describe()}")
    return left_out.exit_code
