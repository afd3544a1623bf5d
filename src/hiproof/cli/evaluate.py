"""`hiproof evaluate`: figures of a run's models by points, footprints and a reference."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import click

from ..errors import InputError
from ..log import count_things
from ..progress import show_progress

SHOWN_FIGURES = {
    "psd_mean": "PSD",
    "psd_std": "std",
    "rmse": "RMSE",
    "p95": "p95",
    "share_within_20cm": "<0.2 m",
    "outline_iou": "IoU",
}
CAPTION = (
    "distances of all points from the roof in metres, facades included; PSD: mean; std: standard "
    "deviation; RMSE: root mean square; p95: 95 of 100 points lie closer\n"
    "<0.2 m: share of the points 0.3 m or more inside the outline that lie within 0.2 m over or "
    "under the roof\n"
    "IoU: area that the roof's outline and the footprint share, of all that both cover (1: equal)"
)
COMPARED = {
    "ref_ridge_height_m": "ridge",
    "ref_slope_deg": "slope",
    "ref_volume_relative": "volume",
}
DIFFERENCES = "ridge in m, slope in degrees, volume as a share of the reference's"


def evaluate(
    folder: Path,
    clouds: list[str] | None = None,
    *,
    footprints: str | None = None,
    layer: str | None = None,
    reference: str | None = None,
    out: Path | None = None,
    as_json: bool = False,
) -> int:
    """Measure the models of a run.

    The figures are distances of points, shares of points, IoU and volume. They are printed for each
    roof type and for all buildings; those of each building go into evaluation.csv and
    evaluation.json.
    """
    with show_progress("measure"):
        from ..evaluate.evaluation import summarise, to_csv, to_json
        from ..evaluate.run import evaluate_run
        from ..read.models.damage import SkippedBuildings
        from ..write.files import refuse_overwriting, save_text, suggest_elsewhere

        place = Path(out or folder)
        files = [place / f"evaluation{suffix}" for suffix in (".csv", ".json")]
        refuse_overwriting(files, [*(clouds or ()), footprints, reference])
        left_out = SkippedBuildings()
        run = evaluate_run(folder, clouds or (), footprints, reference, layer, left_out)
    left_out.refuse_all(model.is_damaged for model in run.models)
    if not run.clouds:
        raise InputError(
            f"expected point files to measure {folder} against, got none; name them after it"
        )
    with suggest_elsewhere(f"hiproof evaluate {folder} --out FOLDER", out):
        save_text(files[0], to_csv(run.figures))
        save_text(files[1], to_json(run.figures))
    if as_json:
        click.echo(json.dumps(summarise(run.figures), indent=1, allow_nan=False))
    else:
        print_summary(summarise(run.figures), reference is not None)
        click.echo(
            f"{files[0]}, {files[1]}: "
            f"{count_things(len(run.figures), 'building')}{left_out.describe()}"
        )
        unmeasured = sum(math.isnan(item.quality.psd_mean) for item in run.figures)
        if unmeasured:
            entries = count_things(unmeasured, "building")
            click.echo(f"{entries} without distances (no model, or no points) are not in the means")
    return left_out.exit_code


def print_summary(summary: dict, has_reference: bool) -> None:
    """Print means of figures by roof type, those against a reference in a table of their own."""
    from rich.console import Console

    console = Console(soft_wrap=True, markup=False)  # a roof type from outside may look like markup
    console.print(make_table(summary, SHOWN_FIGURES, "mean over buildings", CAPTION))
    if has_reference:
        console.print(
            make_table(summary, COMPARED, "mean difference from the reference", DIFFERENCES)
        )


def make_table(summary: dict, columns: dict[str, str], title: str, caption: str) -> Any:
    """Return a table with a line a roof type."""
    from rich.table import Column, Table

    from ..primitives.catalogue import describe_type

    table = Table(
        Column("type", no_wrap=True),
        "buildings",
        *columns.values(),
        title=title,
        caption=caption,
        pad_edge=False,
    )
    for kind, figures in summary.items():
        means = [figures[name]["mean"] if name in figures else None for name in columns]
        table.add_row(
            describe_type(kind),
            str(figures["buildings"]),
            *("" if mean is None else f"{mean:.3f}" for mean in means),
        )
    return table
