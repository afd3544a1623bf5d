"""A run seen from the terminal: its progress while it works, a summary at its end."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..errors import escape_unseen
from ..evaluate.overview import Overview, show_command
from ..log import Level, console_level
from ..progress import show_progress
from ..status import Grade

if TYPE_CHECKING:
    from ..city.request import Request
    from ..city.run import Summary


def run_request(make_request: Callable[[], Request]) -> int:
    """Run the request that is made and print its summary; returns the exit code.

    Progress is shown before the request is made, since what it takes is imported then.
    """
    with show_progress("plan") as update:
        from ..city.run import reconstruct_area

        request = make_request()
        if request.epochs:
            from ..update.several import reconstruct_epochs

            summary = reconstruct_epochs(request, update)
        else:
            summary = reconstruct_area(request, update)
    if console_level() is not Level.error:
        print_summary(summary, str(request.out))
    return summary.exit_code


def graded_words(by_quality: Mapping[str, int]) -> str:
    """Describe how many models are good, fair and poor.

    >>> graded_words({"poor": 2, "good": 97})
    '97 good, 0 fair, 2 poor'
    """
    return ", ".join(f"{by_quality.get(grade.code, 0)} {grade.code}" for grade in Grade)


def print_summary(summary: Summary, out: str) -> None:
    """Print the result of a run: models, how well they fit, what needs attention, files."""
    for line in describe_overview(summary.overview, summary.by_quality, out):
        click.echo(line)
    if summary.doubts:
        remarks = ", ".join(f"{doubt.told} {count:,}" for doubt, count in summary.doubts.items())
        click.echo(f"buildings by remark in hiproof_detail: {remarks}")
    print_faults(summary)
    if summary.bundles:
        click.echo(f"please report these, with the folders of the buildings in {summary.bundles}")
    if not summary.units.are_metres:
        click.echo(f"coordinates are in {summary.units}; attributes and parameters in metres")
    print_files(summary.models, summary.seconds)


def print_faults(summary: Summary) -> None:
    """Print which inputs could not be read, and which buildings failed."""
    for name, reason in summary.broken_inputs:
        click.echo(f"{click.style('not read:', fg='red')} {name}: {reason}")
    for id, reason in summary.failures:
        text = escape_unseen(f"building {id}: {reason}")
        click.echo(f"{click.style('internal error:', fg='red')} {text}")


def print_files(files: Iterable[Path], seconds: Mapping[str, float]) -> None:
    """Print the files of a run, and how long its steps took."""
    click.echo("files: " + ", ".join(map(str, files)))
    steps = ", ".join(f"{step} {duration:.1f} s" for step, duration in seconds.items())
    click.echo(f"time: {sum(seconds.values()):.1f} s ({steps})")


def describe_overview(overview: Overview, by_quality: Mapping[str, int], out: str) -> list[str]:
    """Describe the overview of a run in lines: its result, quality and fit, and what to look at."""
    lines = [click.style(overview.headline, bold=True)]
    if by_quality:
        lines.append("quality: " + graded_words(by_quality))
    lines += filter(None, [overview.fit])
    if overview.attention:
        lines.append("needs attention:")
    for kind, count in overview.attention.items():
        lines.append(f"  {count:,} {kind.code}: {kind.value}")
        lines.append(f"    {show_command(out, kind)}")
    return lines
