"""`hiproof status`: progress and summary of a run by its ledger, also while it goes on."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..data_files import Values
from ..errors import InputError, escape_unseen
from .running import describe_overview

if TYPE_CHECKING:
    from ..city.folder.ledger import Ledger, Task

CLOSED = ("done", "failed")


def status(folder: Path, *, as_json: bool = False) -> None:
    """Show the progress of a run and the state of its buildings.

    The run may be finished or still going on.
    """
    from ..city.folder.ledger import Ledger

    path = folder / ".hiproof" / "ledger.sqlite"
    if not path.is_file():
        raise InputError(
            f"expected the output folder of a run, got {folder}, which has no ledger; check the "
            "path"
        )
    try:
        ledger = Ledger(path, read_only=True)
        state = read_state(ledger)
        lines = [json.dumps(state, indent=1)] if as_json else describe(ledger, state, str(folder))
    except sqlite3.DatabaseError as error:
        raise InputError(
            f"expected the ledger of a run at {path}, got: {error}; it may be damaged"
        ) from error
    for line in lines:
        click.echo(line)


def read_state(ledger: Ledger) -> Values:
    """Return the progress of a run for `--json`: tasks, buildings, rate, summary, failures."""
    tasks = ledger.tasks()
    sort, solve = ([task for task in tasks if task.kind == kind] for kind in ("sort", "solve"))
    closed = [task for task in solve if task.state in CLOSED]
    finished, total = (sum(task.buildings for task in of) for of in (closed, solve))
    rate = measure_rate(closed)
    return {
        "finished": ledger.get("merged") == "yes",
        "point_files": {"read": sum(t.state in CLOSED for t in sort), "total": len(sort)},
        "work_tiles": {"solved": len(closed), "total": len(solve)},
        "buildings": {"done": finished, "total": total},
        "buildings_per_second": rate,
        "seconds_left": (total - finished) / rate if rate and finished < total else None,
        "summary": ledger.overview().to_dict(),
        "by_status": ledger.counts("status"),
        "by_quality": ledger.counts("quality"),
        "failed_tasks": {task.name: task.message for task in tasks if task.state == "failed"},
        "internal_errors": dict(ledger.failures()),
    }


def measure_rate(closed: list[Task]) -> float | None:
    """Return buildings a second between the first and the last task done, None below two."""
    by_time = sorted((t.finished or 0.0, t.buildings) for t in closed)
    seconds = by_time[-1][0] - by_time[0][0] if by_time else 0.0
    return sum(buildings for _, buildings in by_time[1:]) / seconds if seconds > 0 else None


def describe(ledger: Ledger, state: Values, folder: str) -> list[str]:
    """Return progress, summary and failures, a line each."""
    lines = [
        "point files read: {read} of {total}".format(**state["point_files"]),
        "work tiles solved: {solved} of {total}".format(**state["work_tiles"]),
        "buildings done: {done} of {total}".format(**state["buildings"]),
    ]
    if rate := state["buildings_per_second"]:
        left = state["seconds_left"]
        text = "" if left is None else f", about {left:.0f} s left"
        lines.append(f"throughput: {rate:.1f} buildings a second{text}")
    lines += describe_overview(ledger.overview(), state["by_quality"], folder)
    lines += [f"failed: {name}: {reason}" for name, reason in state["failed_tasks"].items()]
    errors = state["internal_errors"].items()
    lines += [escape_unseen(f"internal error: building {id}: {reason}") for id, reason in errors]
    end = "finished" if state["finished"] else "not finished: run the command again to resume"
    return [*lines, end]
