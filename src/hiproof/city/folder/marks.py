"""The mark by which an output folder knows whose run it holds, and its lock: one run at a time.

The mark is made of every field of the request, of what stands in the files that it names, and of
the version. A field takes no part only where its declaration says what else it decides: one that is
added later cannot be forgotten.

The lock ends with its process, however that ends. SQLite does the locking, as it does for the
ledger: the standard library's, one way on every system, across processes and over network drives
that know locks. It has a file of its own, so that `hiproof status` still reads the ledger.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

from ... import __version__
from ...errors import OutputError
from ...masking import masked_values
from ..request import WHICH, Request

# parts of one file that formats keep beside it
SIDECAR_ENDINGS = (".dbf", ".shx", ".prj", ".cpg", ".tfw")
APPENDED = ("-wal", ".aux.xml", ".ovr", ".msk")
RESULT, SELECTION = "the result", WHICH["decides"]  # what fields of a request decide
SHOWN_FILES = 3  # of an input that differs: enough to know which delivery was replaced


def describe(request: Request, decides: str) -> dict[str, Any]:
    """Return by name all that decides the RESULT of a building, or the SELECTION of buildings.

    These are values, and stamps of files.
    """
    return {"version": __version__} | dict(named_values("", request, decides))


def named_values(name: str, value: Any, decides: str) -> Iterator[tuple[str, Any]]:
    """Yield (name, JSON value) of each deciding leaf of a dataclass.

    `decides` is in the leaf's declaration; the names of fields in fields are joined by dots. `name`
    is what they begin with.

    What stands at a path counts of leaves that are declared to name files alone: any word may be
    the name of a folder, too.
    """
    for declared in dataclasses.fields(value):
        if declared.metadata.get("decides", RESULT) == decides:
            inner, result = name + declared.name, getattr(value, declared.name)
            if dataclasses.is_dataclass(result):
                yield from named_values(f"{inner}.", result, decides)
            else:
                is_path = declared.metadata.get("names") == "files"
                yield inner, with_files(result) if is_path else result


def with_files(value: Any) -> Any:
    """Return `value` for JSON, with the state of a file or folder it names."""
    if isinstance(value, (tuple, list)):
        return [with_files(inner) for inner in value]
    stamps = file_stamps(Path(value)) if value and isinstance(value, (str, Path)) else []
    return stamps or (str(value) if isinstance(value, Path) else value)


def file_stamps(path: Path) -> list[tuple[str, int, int]]:
    """Return (name, bytes, time in ns) of a file with its companions, or of a folder's files.

    The names are those within its folder: what was moved whole is the same.
    """
    with suppress(OSError, ValueError):  # ValueError: a text that is no path at all
        if path.is_dir():
            folder, files = path, [file for file in path.rglob("*") if file.is_file()]
        else:
            sidecars = [path.with_suffix(end) for end in SIDECAR_ENDINGS] + [
                Path(f"{path}{end}") for end in APPENDED
            ]
            folder = path.parent
            files = [file for file in {path, *sidecars} if path.is_file() and file.is_file()]
        stamps = [(file.relative_to(folder).as_posix(), file.stat()) for file in files]
        return sorted((name, stat.st_size, stat.st_mtime_ns) for name, stat in stamps)
    return []


def find_changed_files(new_stamps: Any, old_stamps: Any) -> str:
    """Return which files of an input differ, in brackets.

    Stamps are the values of `with_files` as JSON gives them; the text is empty where they name
    none.

    >>> find_changed_files([[["a.laz", 10, 1], ["b.laz", 20, 1]]], [[["a.laz", 10, 1], ["b.laz", 20,
    ...     2]]])
    ' (b.laz)'
    """
    names = sorted({name for name, *_ in stamps_in(new_stamps) ^ stamps_in(old_stamps)})
    text = f" and {len(names) - SHOWN_FILES} more" if len(names) > SHOWN_FILES else ""
    return f" ({', '.join(names[:SHOWN_FILES])}{text})" if names else ""


def stamps_in(value: Any) -> set[tuple[str, int, int]]:
    """Return all (name, bytes, time in ns) in nested lists."""
    if not isinstance(value, list):
        return set()
    if (
        len(value) == 3
        and isinstance(value[0], str)
        and all(type(number) is int for number in value[1:])
    ):
        return {(value[0], value[1], value[2])}
    return set().union(*map(stamps_in, value))


def compute_mark(inputs: dict[str, Any], salt: str) -> str:
    """Return the mark of a run.

    A slow digest with a salt where an address holds a password: nobody shall try them out on it.
    """
    text, masked = (
        json.dumps(value, sort_keys=True, default=str) for value in (inputs, masked_values(inputs))
    )
    if text == masked:
        return hashlib.sha256((salt + text).encode()).hexdigest()
    return hashlib.scrypt(text.encode(), salt=salt.encode(), n=1 << 14, r=8, p=1, dklen=32).hex()


@contextmanager
def hold_folder(state: Path) -> Iterator[None]:
    """Hold the run's folder `state` for the block.

    Raises OutputError at once where another run holds it.
    """
    try:
        lock = sqlite3.connect(state / "lock.sqlite", isolation_level=None, timeout=0)
        lock.execute("begin exclusive")
    except sqlite3.Error as error:
        if error.sqlite_errorcode == sqlite3.SQLITE_BUSY:
            raise OutputError(
                f"expected {state.parent} for this run alone, got one that another run works in; "
                "wait for its end (`hiproof status` shows how far it is), or choose another --out"
            ) from None
        raise OutputError(
            f"expected to lock {state}, got: {error}; choose an --out that can be written, on a "
            "drive with locks"
        ) from error
    with closing(lock):
        yield
