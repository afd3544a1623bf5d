"""`hiproof report`: one self-contained HTML page about a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..log import counted


def report(
    folder: Annotated[Path, typer.Argument(help="output folder of a run")],
    clouds: Annotated[
        list[str] | None, typer.Argument(help="point files [default: those of the run, if still there]")
    ] = None,
    footprints: Annotated[str | None, typer.Option(help="building polygons [default: those of the run]")] = None,
    layer: Annotated[str | None, typer.Option(help="layer of the footprints")] = None,
    out: Annotated[Path | None, typer.Option(help="file to write [default: report.html in the folder]")] = None,
) -> None:
    """Write one HTML page (no network needed): map, 3D view, distributions, the worst buildings, settings."""
    from ..evaluate.report import write_report
    from ..evaluate.run import evaluate_run

    path = out or Path(folder) / "report.html"
    run = evaluate_run(folder, clouds or (), footprints, layer=layer)
    write_report(path, run, title=f"hiproof: {Path(folder).resolve().name}")
    typer.echo(f"{path}: {counted(len(run.models), 'building')}, {path.stat().st_size / 1e6:.1f} MB")
