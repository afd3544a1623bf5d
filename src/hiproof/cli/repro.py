"""`hiproof repro`: one building that a run failed on, run again from what the run kept of it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..log import Level, start


def repro(
    folder: Annotated[
        Path, typer.Argument(help="folder that a run kept of a failed building (OUT/failures/ID)")
    ],
    out: Annotated[Path, typer.Option(help="folder for the results")],
    log_level: Annotated[Level, typer.Option(help="what of the log to show")] = Level.warning,
) -> None:
    """Run a building again that hiproof failed on, to repeat the failure or to see that it is
    mended.

    Exit code: 0 the building has an outcome, 1 the failure repeats, 2 the folder cannot be used.
    """
    from ..city.repro import solve_bundle
    from ..masking import mask
    from ..status import Status

    start(log_level)
    building, trace = solve_bundle(folder, out)
    if trace:
        typer.echo(mask(trace), err=True)
    typer.echo(f"building {building.id}: {building.detail or building.status.value}")
    typer.echo(f"files: {out}")
    raise typer.Exit(1 if building.status is Status.INTERNAL_ERROR else 0)
