"""The record of what is done, what failed and why.

It is SQLite in WAL mode, from the standard library.

SQLite rather than DuckDB: it needs no further dependency, survives kill -9 at any moment, and
`hiproof status` may read while the run writes. Only the main process writes; a row changes after
its task's file stands whole on disk.
"""

from __future__ import annotations

import os
import sqlite3
import time
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from ...evaluate.overview import BuildingOutcome, Overview
from ...status import Doubt

SCHEMA = """
create table if not exists run (key text primary key, value text);
create table if not exists task (
    name text primary key, kind text, position integer, buildings integer,
    state text default 'open',
    losses integer default 0, message text default '', finished real);
create table if not exists building (
    position integer primary key, id text, task text, status text, quality text, type text,
    detail text, share real, seconds real);
create table if not exists override (position integer primary key, digest text);
create table if not exists output (name text primary key, bytes integer, digest text);
"""


class Task(NamedTuple):
    """A row of the tasks: its work, its number of buildings, its state."""

    name: str
    kind: str
    buildings: int
    state: str = "open"
    losses: int = 0
    message: str = ""
    finished: float | None = None


class Outcome(NamedTuple):
    """A row of the buildings.

    It has the `position` in the plan, the outcome, the quality, and the cost.
    """

    position: int
    id: str
    status: str
    quality: str | None
    type: str | None
    detail: str
    share: float | None
    seconds: float


class Failure(NamedTuple):
    """A building that hit an internal error, and what it was."""

    id: str
    detail: str


class Claim(NamedTuple):
    """A file that the run has written: its name, size and digest.

    The name is that within the run's folder.
    """

    name: str
    bytes: int
    digest: str


def read_only_address(path: Path) -> str:
    """Return SQLite's address of a ledger that is only read.

    It wants to make a file beside one in WAL mode: where another person's folder allows none, and
    no run is at work, the ledger is read as it stands.
    """
    sibling_path = path.with_name(path.name + "-wal")
    at_rest = not sibling_path.exists() or sibling_path.stat().st_size == 0
    return "?mode=ro&immutable=1" if at_rest and not os.access(path.parent, os.W_OK) else "?mode=ro"


LEDGER_TABLES = ("run", "task", "building", "override", "output")


class Ledger:
    """The run's memory at `path`.

    States of a task: open, running, done, failed (its input cannot be used).

    `losses` counts how often the process died that worked on the task. sqlite3's errors pass
    through.
    """

    def __init__(self, path: Path, read_only: bool = False):
        address = Path(path).absolute().as_uri() + (
            read_only_address(Path(path)) if read_only else ""
        )
        self.database = sqlite3.connect(address, uri=True, isolation_level=None, timeout=60)
        if not read_only:
            self.database.execute("pragma journal_mode=wal")
            self.database.execute("pragma synchronous=normal")
            self.database.executescript(SCHEMA)

    def close(self) -> None:
        self.database.close()

    def set(self, **values: str) -> None:
        self.database.executemany("insert or replace into run values (?, ?)", list(values.items()))

    def get(self, key: str) -> str | None:
        row = self.database.execute("select value from run where key = ?", (key,)).fetchone()
        return row[0] if row else None

    def claim(self, files: list[Claim]) -> None:
        """Enter all files written, and with them that the run is finished."""
        self.database.execute("begin")
        self.database.executemany("insert or replace into output values (?, ?, ?)", files)
        self.set(merged="yes")
        self.database.execute("commit")

    def claims(self) -> list[Claim]:
        return list(
            map(
                Claim._make,
                self.database.execute("select name, bytes, digest from output order by name"),
            )
        )

    def overrides(self) -> dict[int, str]:
        """Return digests of the overrides with which buildings were made.

        They are by position.
        """
        return dict(self.database.execute("select position, digest from override"))

    def set_overrides(self, digests: dict[int, str]) -> None:
        self.database.execute("begin")
        self.put_overrides(digests)
        self.database.execute("commit")

    def put_overrides(self, digests: dict[int, str]) -> None:
        self.database.execute("delete from override")
        self.database.executemany("insert into override values (?, ?)", list(digests.items()))

    def open_again(self, solved: list[str], digests: dict[int, str]) -> None:
        """Open the tasks `solved` and the reading of all point files.

        Overrides of buildings now have the `digests`.
        """
        self.database.execute("begin")
        self.database.executemany(
            "update task set state = 'open' where name = ?", [(name,) for name in solved]
        )
        self.database.execute("update task set state = 'open' where kind = 'sort'")
        self.put_overrides(digests)
        self.set(merged="no")
        self.database.execute("commit")

    def forget(self) -> None:
        """Drop all that is known of a run."""
        for table in LEDGER_TABLES:
            self.database.execute(f"delete from {table}")

    def add_tasks(self, tasks: list[Task]) -> None:
        """Enter open tasks of a kind, in the order of the plan.

        Those that exist already stay.
        """
        self.database.execute("begin")
        sql = "insert or ignore into task (name, kind, position, buildings) values (?, ?, ?, ?)"
        self.database.executemany(
            sql, [(t.name, t.kind, i, t.buildings) for i, t in enumerate(tasks)]
        )
        self.database.execute("commit")

    def open_tasks(self, kind: str) -> list[str]:
        """Return names of the tasks still to do, the largest first.

        So at the end no worker waits long for another.
        """
        sql = (
            "select name from task where kind = ? and state = 'open' order by buildings desc, "
            "position"
        )
        return [name for (name,) in self.database.execute(sql, (kind,))]

    def start(self, name: str) -> None:
        self.database.execute("update task set state = 'running' where name = ?", (name,))

    def lose(self, name: str) -> None:
        """Record that the process that worked on the task died."""
        self.database.execute(
            "update task set state = 'open', losses = losses + 1 where name = ?", (name,)
        )

    def reopen(self) -> None:
        """Reopen what was running when the main process ended.

        It was lost with it. Raises sqlite3.DatabaseError for the ledger of another version.
        """
        columns = {name for _, name, *_ in self.database.execute("pragma table_info(building)")}
        if columns != {*Outcome._fields, "task"}:
            raise sqlite3.DatabaseError("the columns of another version")
        self.database.execute(
            "update task set state = 'open', losses = losses + 1 where state = 'running'"
        )

    def interrupt(self) -> None:
        """Reopen what was running, without a loss.

        The main process ends in order.
        """
        self.database.execute("update task set state = 'open' where state = 'running'")

    def sort_again(self) -> None:
        """Open the reading of the point files that were read."""
        self.database.execute(
            "update task set state = 'open' where kind = 'sort' and state = 'done'"
        )

    def losses(self, name: str) -> int:
        return self.database.execute("select losses from task where name = ?", (name,)).fetchone()[
            0
        ]

    def finish(
        self, name: str, state: str, message: str = "", outcomes: Iterable[Outcome] = ()
    ) -> None:
        """Close a task together with the rows of its buildings."""
        self.database.execute("begin")
        sql = "update task set state = ?, message = ?, finished = ? where name = ?"
        self.database.execute(sql, (state, message, time.time(), name))
        self.put_outcomes(name, outcomes)
        self.database.execute("commit")

    def begin_again(
        self, tasks: list[Task], outcomes: dict[int, Outcome], overrides: dict[int, str]
    ) -> None:
        """Enter the tasks of another plan, and what is known of its buildings.

        That is by position.
        """
        self.database.execute("begin")
        sql = (
            "insert into task (name, kind, position, buildings, state, message, finished) values "
            "(?, ?, ?, ?, ?, ?, ?)"
        )
        positions = (
            (t.name, t.kind, i, t.buildings, t.state, t.message, t.finished or time.time())
            for i, t in enumerate(tasks)
        )
        self.database.executemany(sql, positions)
        self.put_outcomes("", outcomes.values())
        self.put_overrides(overrides)
        self.set(merged="no")
        self.database.execute("commit")

    def put_outcomes(self, task: str, outcomes: Iterable[Outcome]) -> None:
        rows = [(position, id, task, *remainder) for position, id, *remainder in outcomes]
        self.database.executemany(
            "insert or replace into building values (?, ?, ?, ?, ?, ?, ?, ?, ?)", rows
        )

    def outcomes(self) -> dict[int, Outcome]:
        """Return the outcomes of the buildings that were solved, by position."""
        sql = f"select {', '.join(Outcome._fields)} from building"
        return {
            outcome.position: outcome for outcome in map(Outcome._make, self.database.execute(sql))
        }

    def tasks(self) -> list[Task]:
        sql = f"select {', '.join(Task._fields)} from task order by kind, position"
        return list(map(Task._make, self.database.execute(sql)))

    def counts(self, column: str) -> dict[str, int]:
        """Count buildings by `column`, most frequent first.

        It is "status", "quality" or "type".
        """
        sql = f"select {column}, count(*) from building group by 1 order by 2 desc, 1"
        return {key: number for key, number in self.database.execute(sql) if key is not None}

    def doubts(self) -> dict[Doubt, int]:
        """Count buildings by the doubts in their details.

        Doubts that no building has are left out.
        """
        sql = "select count(*) from building where instr(detail, ?)"
        counts = {
            doubt: self.database.execute(sql, (doubt.value,)).fetchone()[0] for doubt in Doubt
        }
        return {doubt: count for doubt, count in counts.items() if count}

    def overview(self) -> Overview:
        """Count the buildings modelled so far, how well, and what needs attention."""
        rows = self.database.execute("select status, quality, detail, share from building")
        return Overview.of(map(BuildingOutcome._make, rows))

    def failed_ids(self) -> list[str]:
        """Return the ids of all buildings that hit an internal error."""
        return [
            id
            for (id,) in self.database.execute(
                "select id from building where status = 'internal_error'"
            )
        ]

    def failures(self, limit: int = 20) -> list[Failure]:
        """Return the first buildings that hit an internal error."""
        sql = (
            "select id, detail from building where status = 'internal_error' order by position "
            "limit ?"
        )
        return list(map(Failure._make, self.database.execute(sql, (limit,))))
