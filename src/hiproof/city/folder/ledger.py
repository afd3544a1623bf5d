"""The record of what is done, what failed and why, in SQLite with a write-ahead log.

SQLite rather than DuckDB: it needs no further dependency, survives kill -9 at any moment, and
`hiproof status` may read while the run writes. Only the main process writes; a row changes after
its task's file stands whole on disk.
"""

from __future__ import annotations

import os
import sqlite3
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from ...evaluate.overview import BuildingOutcome, Overview
from ...status import Doubt

SCHEMA = """
create table if not exists run (key text primary key, value text);
create table if not exists task (
    name text primary key, kind text, position integer, buildings integer,
    state text default 'open',
    losses integer default 0, message text default '', finished real);
create table if not exists building (
    position integer primary key, tile text, digest blob, id text, status text, quality text,
    type text, detail text, share real, seconds real, file text, number integer);
create index if not exists building_tile on building (tile);
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
    """What came of a building, and where its texts are.

    `position` is its place in the plan. Its texts are number `number` of `file` in the folder of
    texts.
    """

    position: int
    id: str
    status: str
    quality: str | None
    type: str | None
    detail: str
    share: float | None
    seconds: float
    file: str = ""
    number: int = 0


class Failure(NamedTuple):
    """A building that hit an internal error, and what it was."""

    id: str
    detail: str


class Settled(NamedTuple):
    """How many buildings stay as they are, are gone or changed, and are to be solved."""

    kept: int
    gone: int
    remainder: int


class Claim(NamedTuple):
    """A file that the run has written: its name, size and digest.

    The name is that within the run's folder.
    """

    name: str
    bytes: int
    digest: str


def read_only_address(path: Path) -> str:
    """Return SQLite's address of a ledger that is only read.

    SQLite makes a file beside a ledger in WAL mode. Where another person's folder allows none and
    no run is at work, the ledger is read as it stands.
    """
    sibling_path = path.with_name(path.name + "-wal")
    at_rest = not sibling_path.exists() or sibling_path.stat().st_size == 0
    return "?mode=ro&immutable=1" if at_rest and not os.access(path.parent, os.W_OK) else "?mode=ro"


OUTCOME_COLUMNS = ", ".join(Outcome._fields)
OUTCOME = OUTCOME_COLUMNS.partition(", ")[2]  # all but the position


class Ledger:
    """The memory of a run at `path`, with a row for each building of the plan.

    A building without a status is still to be solved. States of a task are open, running, done and
    failed (its input cannot be used).

    `losses` counts how often the process died that worked on the task. sqlite3's errors pass
    through.
    """

    def __init__(self, path: Path, read_only: bool = False):
        address = Path(path).absolute().as_uri() + (
            read_only_address(Path(path)) if read_only else ""
        )
        self.database = sqlite3.connect(address, uri=True, isolation_level=None, timeout=60)
        if not read_only:
            self.run("pragma journal_mode=wal")
            self.run("pragma synchronous=normal")
            self.database.executescript(SCHEMA)

    def close(self) -> None:
        self.database.close()

    def run(self, sql: str, *values: Any) -> sqlite3.Cursor:
        return self.database.execute(sql, values)

    def set(self, **values: str) -> None:
        self.database.executemany("insert or replace into run values (?, ?)", list(values.items()))

    def get(self, key: str) -> str | None:
        row = self.run("select value from run where key = ?", key).fetchone()
        return row[0] if row else None

    @contextmanager
    def transact(self) -> Iterator[None]:
        """Make all changes of the block, or none."""
        self.run("begin")
        try:
            yield
        except BaseException:
            self.run("rollback")
            raise
        self.run("commit")

    def claim(self, files: list[Claim]) -> None:
        """Enter all files written, and with them that the run is finished."""
        with self.transact():
            self.database.executemany("insert or replace into output values (?, ?, ?)", files)
            self.set(merged="yes")

    def claims(self) -> list[Claim]:
        sql = "select name, bytes, digest from output order by name"
        return list(map(Claim._make, self.run(sql)))

    def settle(
        self, planned: Iterable[tuple[int, str, bytes]], lost: Iterable[str]
    ) -> Settled | None:
        """Put the ledger on a plan: what is known of a building stays with its digest.

        The rows of the plan have the position, the work tile and the digest of a building. What is
        known only by files that are `lost` is forgotten. Returns None where nothing is another.
        """
        run = self.run

        def count(rows: str) -> int:
            return int(run(f"select count(*) from {rows}").fetchone()[0])

        run("create temp table planned (position integer primary key, tile text, digest blob)")
        self.database.executemany("insert into planned values (?, ?, ?)", planned)
        before, total = count("building"), count("planned")
        self.database.executemany("delete from building where file = ?", [(file,) for file in lost])
        same = count("planned join building using (position, tile, digest)")
        run(
            "create temp table known as select planned.position, planned.tile, planned.digest, "
            f"{OUTCOME} from planned left join building using (digest)"
        )
        kept = count("known where status is not null")
        if not before == same == total:
            run("delete from building")
            run("insert into building select * from known")
        run("drop table known")
        run("drop table planned")
        return None if before == same == total else Settled(kept, before - kept, total - kept)

    def forget(self) -> None:
        """Drop all that is known of a run."""
        for table in ("run", "task", "building", "output"):
            self.run(f"delete from {table}")

    def put_tasks(self, clouds: int, tiles: dict[str, int]) -> None:
        """Enter the tasks that sort point files, and those that solve tiles.

        `clouds` counts the files, and `tiles` the buildings of each tile. Where buildings
        wait for their points, all files are read again.
        """
        run, remainder = self.run, self.open_buildings()
        run("delete from task where kind = 'solve' or ?", bool(remainder))
        sql = "insert or ignore into task (name, kind, position, buildings) values (?, ?, ?, ?)"
        rows = [(f"sort:{i}", "sort", i, 0) for i in range(clouds)]
        rows += [(f"solve:{tile}", "solve", i, n) for i, (tile, n) in enumerate(tiles.items())]
        self.database.executemany(sql, rows)
        for tile in tiles.keys() - remainder.keys():
            self.finish(f"solve:{tile}", "done")

    def open_buildings(self) -> dict[str, list[int]]:
        """Return the buildings to solve by work tile."""
        sql = "select tile, position from building where status is null order by position"
        result: dict[str, list[int]] = {}
        for tile, position in self.run(sql):
            result.setdefault(tile, []).append(position)
        return result

    def texts(self, tile: str) -> list[tuple[str, int]]:
        """Return where the texts of a tile's buildings are: files, and numbers there."""
        sql = "select file, number from building where tile = ? order by position"
        return self.run(sql, tile).fetchall()

    def text_files(self) -> list[str]:
        """Return the files with texts of solved buildings."""
        sql = "select distinct file from building where status is not null"
        return [file for (file,) in self.run(sql)]

    def open_tasks(self, kind: str) -> list[str]:
        """Return names of the tasks still to do, the largest first.

        So at the end no worker waits long for another.
        """
        sql = (
            "select name from task where kind = ? and state = 'open' order by buildings desc, "
            "position"
        )
        return [name for (name,) in self.run(sql, kind)]

    def start(self, name: str) -> None:
        self.run("update task set state = 'running' where name = ?", name)

    def lose(self, name: str) -> None:
        """Record that the process that worked on the task died."""
        self.run("update task set state = 'open', losses = losses + 1 where name = ?", name)

    def reopen(self) -> None:
        """Reopen what was running when the main process ended, and count it as lost.

        Raises sqlite3.DatabaseError for the ledger of another version.
        """
        columns = {name for _, name, *_ in self.run("pragma table_info(building)")}
        if columns != {*Outcome._fields, "tile", "digest"}:
            raise sqlite3.DatabaseError("the columns of another version")
        self.run("update task set state = 'open', losses = losses + 1 where state = 'running'")

    def interrupt(self) -> None:
        """Reopen what was running, without a loss.

        The main process ends in order.
        """
        self.run("update task set state = 'open' where state = 'running'")

    def sort_again(self) -> None:
        """Open the reading of the point files that were read."""
        self.run("update task set state = 'open' where kind = 'sort' and state = 'done'")

    def losses(self, name: str) -> int:
        sql = "select losses from task where name = ?"
        return self.run(sql, name).fetchone()[0]

    def finish(
        self, name: str, state: str, message: str = "", outcomes: Iterable[Outcome] = ()
    ) -> None:
        """Close a task together with the rows of its buildings."""
        sql = "update task set state = ?, message = ?, finished = ? where name = ?"
        self.run(sql, state, message, time.time(), name)
        sql = f"update building set ({OUTCOME}) = ({', '.join('?' * 9)}) where position = ?"
        rows = [(*outcome, position) for position, *outcome in outcomes]
        self.database.executemany(sql, rows)

    def tasks(self) -> list[Task]:
        sql = f"select {', '.join(Task._fields)} from task order by kind, position"
        return list(map(Task._make, self.run(sql)))

    def counts(self, column: str) -> dict[str, int]:
        """Count buildings by `column` (status, quality or type), most frequent first."""
        sql = f"select {column}, count(*) from building group by 1 order by 2 desc, 1"
        return {key: number for key, number in self.run(sql) if key is not None}

    def doubts(self) -> dict[Doubt, int]:
        """Count buildings by the doubts in their details.

        Doubts that no building has are left out.
        """
        sql = "select count(*) from building where instr(detail, ?)"
        counts = {doubt: self.run(sql, doubt.value).fetchone()[0] for doubt in Doubt}
        return {doubt: count for doubt, count in counts.items() if count}

    def overview(self) -> Overview:
        """Count the buildings modelled so far, how well, and what needs attention."""
        rows = self.run(
            "select status, quality, detail, share from building where status is not null"
        )
        return Overview.of(map(BuildingOutcome._make, rows))

    def failures(self, most: int = 20) -> list[Failure]:
        """Return the first buildings that hit an internal error, all of them for -1."""
        sql = (
            "select id, detail from building where status = 'internal_error' order by position "
            "limit ?"
        )
        return list(map(Failure._make, self.run(sql, most)))
