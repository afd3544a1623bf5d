"""The file of accepted edits: overrides, one line a building.

`--overrides` of the next run takes it.

Every change writes the whole file beside its place, synced, and renames it, so that kill -9 and
power cuts leave the old or the new one. A change says on which version of its building it stands;
where that is not the present one, somebody else was faster, and nothing is written.
"""

from __future__ import annotations

import hashlib
import json
import os
import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from ..city.plan.overrides import read_overrides
from ..errors import HiproofError, InputError, OutputError
from ..parametric.override import read_override
from ..write.files import atomic

EDITS_FILE = "edits.jsonl"
WAIT_S = 30  # seconds for another window to finish its write, which takes milliseconds
UNTOUCHED = "run"  # the version of a building that the file does not name


class OtherVersion(HiproofError):
    """A building that was changed since; `version` is the present one."""

    def __init__(self, told: str, version: str = "") -> None:
        super().__init__(told)
        self.version = version


class Edits:
    """The overrides in `folder`, by building.

    A folder without such a file starts with those `obeyed` by its run. Raises InputError for a file
    that cannot be read, or that is a link to elsewhere.
    """

    def __init__(self, folder: Path, obeyed: dict[str, dict[str, Any]] | None = None) -> None:
        self.path, self.obeyed = folder / EDITS_FILE, obeyed or {}
        if self.path.is_symlink():
            raise InputError(f"expected a file of its own at {self.path}, got a link; remove it")
        self.lock = threading.Lock()
        self.stamp: tuple[int, int, int] | None = None
        self.records: dict[str, dict[str, Any]] = {}
        self.refresh()

    def refresh(self) -> None:
        """Read the file where somebody else has changed it."""
        stamp = read_stamp(self.path)
        if stamp is None:
            self.records = dict(self.obeyed)
        elif stamp != self.stamp:
            self.records = dict(read_overrides(str(self.path)))
        self.stamp = stamp

    def of(self, id: str) -> tuple[dict[str, Any] | None, str]:
        """Return the override of a building, None without one, and its version."""
        with self.lock:
            self.refresh()
            record = self.records.get(id)
            return record, compute_version(record)

    def put(self, id: str, record: dict[str, Any] | None, version: str) -> str:
        """Replace the override of a building, or drop it with None.

        It takes the place of that of `version`. Returns the new version, on disk. Raises
        OtherVersion where the building has another by now, InputError for what is no override,
        OutputError where the file cannot be written.
        """
        if record is not None:
            read_override(record)
        with self.lock, lock_edits(self.path):
            self.refresh()
            stored = self.records.get(id)
            if compute_version(stored) != version:
                raise OtherVersion(explain_conflict(id, stored), compute_version(stored))
            records = {key: value for key, value in self.records.items() if key != id}
            if record is not None:
                records[id] = record
            with atomic(self.path) as temporary:
                temporary.write_text(
                    "".join(json.dumps(r, allow_nan=False) + "\n" for r in records.values())
                )
            self.records, self.stamp = records, read_stamp(self.path)
            return compute_version(record)


@contextmanager
def lock_edits(path: Path) -> Iterator[None]:
    """Lock the file at `path` for the block, against all processes, by SQLite as for runs."""
    try:
        with closing(
            sqlite3.connect(
                path.with_name(f".{path.name}.lock"), isolation_level=None, timeout=WAIT_S
            )
        ) as lock:
            lock.execute("begin exclusive")
            yield
    except sqlite3.Error as error:
        raise OutputError(
            f"expected to write {path}, got: {error}; is the folder writable, and nobody else "
            "accepting?"
        ) from error


def compute_version(record: dict[str, Any] | None) -> str:
    """Return a name for an override: another for every other one."""
    if record is None:
        return UNTOUCHED
    return hashlib.sha256(json.dumps(record, sort_keys=True, default=str).encode()).hexdigest()[:20]


def explain_conflict(id: str, record: dict[str, Any] | None) -> str:
    """Return a sentence on who was faster."""
    if record is None:
        return (
            f"expected building {id} as it was accepted, got it taken back in another window; look "
            "at it again"
        )
    user, when = record.get("who") or "somebody", record.get("when") or "meanwhile"
    return (
        f"expected building {id} as this window knows it, got one that {user} accepted ({when}); "
        "look at theirs first"
    )


def read_stamp(path: Path) -> tuple[int, int, int] | None:
    """Return what tells a file from its predecessor; None without a file."""
    try:
        result = os.stat(path)
    except FileNotFoundError:
        return None
    return result.st_mtime_ns, result.st_size, result.st_ino
