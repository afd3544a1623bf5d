"""A run seen from the terminal: its progress while it works, a summary at its end."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from ..log import Level, console_level, count_things
from ..status import Grade, Status
from .progress import show_progress

if TYPE_CHECKING:
    from ..city.request import Request
    from ..city.run import Summary


def run_request(make_request: Callable[[], Request]) -> int:
    """Run the request that is made and print its summary; returns the exit code.

    Progress is shown before the request is made, since what it takes is imported then.
    """
    with show_progress("plan") as update:
        from ..city.run import reconstruct_area

        summary = reconstruct_area(make_request(), update)
    if console_level() is not Level.error:
        print_summary(summary)
    return summary.exit_code


def graded_words(by_quality: Mapping[str, int]) -> str:
    """How many models are good, fair and poor.

    >>> graded_words({"poor": 2, "good": 97})
    '97 good, 0 fair, 2 poor'
    """
    return ", ".join(f"{by_quality.get(grade.code, 0)} {grade.code}" for grade in Grade)


def print_summary(summary: Summary, show: Callable[..., None] | None = None) -> None:
    """The table at the end: buildings by status and by type, figures, time, and every failure by
    name.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(soft_wrap=True, markup=False)  # names from outside may look like markup
    show = show or console.print
    table = Table("buildings", "outcome", title=count_things(summary.buildings, "building"))
    for code, number in summary.by_status.items():
        table.add_row(str(number), Status[code.upper()].value)
    show(table)
    if summary.by_quality:
        show("quality: " + graded_words(summary.by_quality))
    if summary.by_type:
        show(
            "roof types: "
            + ", ".join(f"{number} {name}" for name, number in summary.by_type.items())
        )
    if summary.median_psd is not None:
        show(
            "median over buildings of the mean distance of all points, facades included: "
            f"{summary.median_psd:.3f} m"
        )
    if summary.mean_share is not None:
        share = f"{100 * summary.mean_share:.1f} % of the points 0.3 m or more inside the outline"
        show(f"mean over buildings: {share} lie within 0.2 m of the roof")
    if summary.doubts:
        doubtful = (
            f"{count_things(count, 'building')} ({doubt.told})"
            for doubt, count in summary.doubts.items()
        )
        show("read the detail of " + ", ".join(doubtful))
    if not summary.units.are_metres:
        show(f"coordinates are in {summary.units}; attributes and parameters in metres")
    show(
        "time: " + ", ".join(f"{step} {seconds:.1f} s" for step, seconds in summary.seconds.items())
    )
    for name, reason in summary.broken_inputs:
        show(Text.assemble(("could not be read:", "red"), f" {name}: {reason}"))
    for id, reason in summary.failures:
        show(Text.assemble(("internal error:", "red"), f" building {id}: {reason}"))
    if summary.bundles:
        show(Text(f"please report these, with the folders of the buildings in {summary.bundles}"))
    show(Text("models: " + ", ".join(map(str, summary.models))))
