"""`hiproof evaluate`: how well the models of a run stand for points, footprints and a reference model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError

SHOWN = {
    "psd_mean": "PSD",
    "psd_std": "std",
    "rmse": "RMSE",
    "p95": "p95",
    "share_within_20cm": "<0.2 m",
    "outline_iou": "IoU",
}
CAPTION = "<0.2 m: share of the points 0.3 m or more inside the outline that lie within 0.2 m over or under the roof"
COMPARED = {"ref_ridge_height_m": "ridge", "ref_slope_deg": "slope", "ref_volume_relative": "volume"}


def evaluate(
    folder: Annotated[Path, typer.Argument(help="output folder of a run")],
    clouds: Annotated[
        list[str] | None, typer.Argument(help="point files to measure against [default: those of the run]")
    ] = None,
    footprints: Annotated[
        str | None, typer.Option(help="building polygons [default: those of the run, else the models' own outlines]")
    ] = None,
    layer: Annotated[str | None, typer.Option(help="layer of the footprints, where a file has several")] = None,
    reference: Annotated[str | None, typer.Option(help="CityJSON model to compare with")] = None,
    out: Annotated[Path | None, typer.Option(help="folder for evaluation.csv and .json [default: the run's]")] = None,
) -> None:
    """Measure the models of a run: distances of points, shares, IoU and volume per building, per type and overall."""
    from ..evaluate.evaluation import summarise, to_csv, to_json
    from ..evaluate.run import evaluate_run
    from ..write.files import atomic_file

    run = evaluate_run(folder, clouds or (), footprints, reference, layer)
    if not run.clouds:
        raise InputError(f"expected point files to measure {folder} against, got none; name them after it")
    place = Path(out or folder)
    for name, text in (("evaluation.csv", to_csv(run.figures)), ("evaluation.json", to_json(run.figures))):
        with atomic_file(place / name) as file:
            file.write(text.encode())
    print_summary(summarise(run.figures), reference is not None)
    typer.echo(f"{place / 'evaluation.csv'}, {place / 'evaluation.json'}: {len(run.figures)} buildings")


def print_summary(summary: dict, has_reference: bool) -> None:
    """A line a roof type, means of the figures over its buildings."""
    from rich.console import Console
    from rich.table import Column, Table

    columns = SHOWN | (COMPARED if has_reference else {})
    table = Table(
        Column("type", no_wrap=True), "buildings", *columns.values(), title="mean over buildings", pad_edge=False
    )
    table.caption = CAPTION
    for kind, figures in summary.items():
        means = [figures[name]["mean"] if name in figures else None for name in columns]
        table.add_row(kind, str(figures["buildings"]), *("" if mean is None else f"{mean:.3f}" for mean in means))
    Console(soft_wrap=True, markup=False).print(table)  # a roof type from outside may look like markup
