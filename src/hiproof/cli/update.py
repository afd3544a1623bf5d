"""`hiproof update`: a run brought up to date with a new survey."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..log import Level, console_level, count_things
from ..progress import show_progress
from ..settings import Changes
from .running import print_faults, print_files

if TYPE_CHECKING:
    from ..update.epochs import Surveys
    from ..update.run import UpdateSummary


def update(
    run: Path,
    clouds: list[str],
    *,
    out: Path,
    date: str = "",
    significance: float = 0.001,
    significance_over: str = "buildings",
    refine: bool = False,
    history: bool = False,
    footprints: str | None = None,
    layer: str | None = None,
    id_attribute: str | None = None,
    terrain: str | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    restart: bool = False,
    changes: Changes | None = None,
) -> int:
    """Bring the models of a run up to date with a new survey, and list what changed.

    The earlier run stays as it is. Run the same command again to resume. Exit code: 0 every
    building has a model or a reason why not, 1 an internal error, 2 unusable input.
    """
    with show_progress("plan") as progress:
        from ..read.points.pointcloud import expand_paths
        from ..update.earlier import find_parameters
        from ..update.request import UpdateRequest
        from ..update.run import update_area

        request = UpdateRequest(
            clouds=tuple(map(str, expand_paths(tuple(clouds)))),
            out=out,
            footprints=footprints,
            layer=layer,
            id_attribute=id_attribute,
            terrain=terrain,
            processes=jobs,
            scheduler=scheduler,
            restart=restart,
            run=run,
            run_parameters=str(find_parameters(run)),
            significance=significance,
            significance_over=significance_over,
            refine=refine,
            date=date,
            history=history,
        )
        summary = update_area(request, changes, progress)
    if console_level() is not Level.error:
        print_update(summary)
    return summary.run.exit_code


def print_update(summary: UpdateSummary) -> None:
    """Print what changed, how the surveys lie to each other, and the files."""
    counts = ", ".join(f"{n:,} {name}" for name, n in summary.by_change.items())
    buildings = count_things(summary.run.buildings, "building")
    click.echo(click.style(f"{buildings}: {counts}", bold=True))
    others = {
        "largest change of each": summary.by_kind,
        "roofs outside all outlines": summary.outside,
    }
    for subject, numbers in others.items():
        if numbers:
            counts = ", ".join(f"{name} {n:,}" for name, n in numbers.items())
            click.echo(f"{subject}: {counts}")
    surveys, shift = summary.surveys, summary.surveys.shift
    lies = ", ".join(
        f"{value:+.2f} ± {sigma:.2f}" for value, sigma in zip(shift.xyz, shift.sigma, strict=True)
    )
    taken = ", ".join(f"{value:+.2f}" for value in shift.clear_xyz)
    click.echo(
        f"survey of {surveys.date}, beside the earlier one by ({lies}) m, by {shift.rests_on}; "
        f"taken off: ({taken}) m"
    )
    click.echo(
        f"{describe_significance(surveys)}; compared with the "
        + ("earlier points" if surveys.has_earlier else "earlier models alone")
    )
    print_faults(summary.run)
    print_files([*summary.run.models, *summary.files], summary.run.seconds)


def describe_significance(surveys: Surveys) -> str:
    """Describe how many false alarms are to be expected."""
    if surveys.over == "buildings":
        return f"chance of a false alarm: {surveys.significance:g} for each building"
    return (
        f"expected share of false alarms among all changes: {surveys.significance:g}, which is a "
        f"chance of {surveys.largest_chance:.2g} for each building"
    )
