"""`hiproof report`: one self-contained HTML page about a run."""

from __future__ import annotations

from pathlib import Path

import click

from ..log import count_things
from ..progress import show_progress


def report(
    folder: Path,
    clouds: list[str] | None = None,
    *,
    footprints: str | None = None,
    layer: str | None = None,
    out: Path | None = None,
) -> int:
    """Write a self-contained HTML page about a run.

    It shows a map, quality charts and the 20 worst buildings in 3D. Of an update it shows the 20
    buildings that changed most, before and after. Exit code: 0 all buildings could be read, 2
    damaged ones are shown without a model, or unusable input.
    """
    with show_progress("measure"):
        from ..evaluate.report import write_report
        from ..evaluate.run import evaluate_run, list_run_inputs
        from ..read.models.damage import SkippedBuildings
        from ..update.before_after import draw_changes, evaluate_earlier
        from ..write.files import refuse_replacing, suggest_elsewhere

        path, left_out = out or Path(folder) / "report.html", SkippedBuildings()
        refuse_replacing([path], [*(clouds or ()), footprints, *list_run_inputs(folder)])
        run = evaluate_run(
            folder, clouds or (), footprints, layer=layer, damaged=left_out, must_be_valid=True
        )
        left_out.refuse_all(model.is_damaged for model in run.models)
        with suggest_elsewhere(f"hiproof report {folder} --out FILE", out):
            changes = draw_changes(run, evaluate_earlier(run.record, left_out))
            title = f"hiproof: {Path(folder).resolve().name}"
            write_report(path, run, title=title, changes=changes)
    size = f"{path.stat().st_size / 1e6:.1f} MB"
    click.echo(f"{path}: {count_things(len(run.models), 'building')}, {size}{left_out.describe()}")
    return left_out.exit_code
