"""`hiproof status`: how far a run is, read from its ledger while the run may still be
writing it.
"""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InputError
from .running import graded_words

if TYPE_CHECKING:
    from ..city.ledger import Ledger

CLOSED = ("done", "failed")


def status(folder: Annotated[Path, typer.Argument(help="output folder of a run")]) -> None:
    """Show how far a run is: progress, failures by kind, throughput and time left, while it runs or
    after.
    """
    from ..city.ledger import Ledger

    path = folder / ".hiproof" / "ledger.sqlite"
    if not path.is_file():
        raise InputError(
            f"expected the output folder of a run, got {folder}, which has no ledger; check the "
            "path"
        )
    try:
        for line in describe(Ledger(path, read_only=True)):
            typer.echo(line)
    except sqlite3.DatabaseError as error:
        raise InputError(
            f"expected the ledger of a run at {path}, got: {error}; it may be damaged"
        ) from error


def describe(ledger: Ledger) -> list[str]:
    """Progress, failures by kind, throughput and time left, a line each."""
    tasks = ledger.tasks()
    lines = []
    for kind, subject in (("sort", "point files read"), ("solve", "work tiles solved")):
        selected_tasks = [task for task in tasks if task.kind == kind]
        lines.append(
            f"{subject}: {sum(task.state in CLOSED for task in selected_tasks)} of "
            f"{len(selected_tasks)}"
        )
    solve = [task for task in tasks if task.kind == "solve"]
    total, done = (
        sum(task.buildings for task in solve),
        [task for task in solve if task.state in CLOSED],
    )
    finished = sum(task.buildings for task in done)
    lines.append(f"buildings done: {finished} of {total}")
    by_time = sorted((task.finished or 0.0, task.buildings) for task in done)
    if len(done) > 1 and (seconds := by_time[-1][0] - by_time[0][0]) > 0:
        rate = (finished - by_time[0][1]) / seconds
        text = (
            f", about {(total - finished) / rate:.0f} s left" if finished < total and rate else ""
        )
        lines.append(f"throughput: {rate:.1f} buildings a second{text}")
    lines += [f"{number} {status}" for status, number in ledger.counts("status").items()]
    if graded := ledger.counts("quality"):
        lines.append(f"quality: {graded_words(graded)}")
    lines += [f"failed: {task.name}: {task.message}" for task in tasks if task.state == "failed"]
    lines += [f"internal error: building {id}: {detail}" for id, detail in ledger.failures()]
    lines.append(
        "finished" if ledger.get("merged") == "yes" else "not finished: the same command goes on"
    )
    return lines
