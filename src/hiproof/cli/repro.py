"""`hiproof repro`: a building on which a run failed, run again from what the run kept."""

from __future__ import annotations

from pathlib import Path

import click

from ..errors import escape_unseen
from ..progress import show_progress


def repro(folder: Path, *, out: Path) -> int:
    """Run a building again on which hiproof failed.

    The result shows whether the failure repeats or is fixed. Exit code: 0 the building has an
    outcome, 1 the failure repeats, 2 the folder cannot be used.
    """
    from ..masking import mask
    from ..status import Status

    with show_progress("repeat"):
        from ..city.work.repro import solve_bundle

        building, trace = solve_bundle(folder, out)
    if trace:
        click.echo(mask(trace), err=True)
    text = f"building {building.id}: {building.detail or building.status.value}"
    click.echo(escape_unseen(text))
    click.echo(f"files: {out}")
    return 1 if building.status is Status.INTERNAL_ERROR else 0
