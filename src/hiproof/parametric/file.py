"""parameters.jsonl, read line by line: its head, buildings, and errors by line and column."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from ..data_files import Values
from ..errors import InputError, SettingsError
from ..read.crs import parse_crs
from ..read.models.cityjson import ESCAPED
from ..read.models.damage import Damaged, excerpt, explain_unreadable, readable, refuse
from ..settings import Settings
from ..write.head import FileHead
from ..write.parameters import VERSION
from .record import read_update, read_value

HEAD_KEY = "hiproof_parameters"
# This very object stands for a line that cannot be read.
DAMAGED: Values = {"damaged": True}


def read_parameters(path: str | os.PathLike[str]) -> list[Values]:
    """Read the objects of all buildings in a parameters.jsonl, in its order.

    Raises InputError when it cannot be read or is no such file, naming line and column where its
    JSON is broken.
    """
    with opened_parameters(path) as (_, records):
        return list(records)


@contextmanager
def opened_parameters(
    path: str | os.PathLike[str], damaged: Damaged = refuse
) -> Iterator[tuple[FileHead, Iterator[Values]]]:
    """Yield the head of the parameters.jsonl at `path`, and its buildings.

    Buildings come one by one. A line that cannot be read is told to `damaged`, which refuses the
    file by default, and comes as DAMAGED. Raises InputError for a file that is no parameters.jsonl.
    """
    with locate_parameters(path, damaged) as (head, located):
        yield head, (record for _, record in located)


@contextmanager
def locate_parameters(
    path: str | os.PathLike[str], damaged: Damaged = refuse
) -> Iterator[tuple[FileHead, Iterator[tuple[int, Values]]]]:
    """Do as `opened_parameters`, with the place of each building for `read_at`."""
    try:
        with Path(path).open("rb") as file:
            lines = objects(file, path, damaged)
            yield read_head(next(lines, (1, 0, None))[2], path), records(lines, path, damaged)
    except (OSError, UnicodeDecodeError) as error:
        expected = "a parameters.jsonl that hiproof wrote"
        raise explain_unreadable(os.fspath(path), expected, error) from error


def objects(
    file: BinaryIO, path: str | os.PathLike[str], damaged: Damaged = refuse
) -> Iterator[tuple[int, int, Any]]:
    """Yield (line, its first byte, JSON value) of lines that are not blank.

    The value is DAMAGED where `damaged` took one.
    """
    start = 0
    for number, content in enumerate(file, 1):
        # Editors may begin a file with a mark of the encoding.
        line = content.decode("utf-8-sig" if number == 1 else "utf-8").rstrip()
        if line:
            try:
                value = parse_object(line, f"line {number} of {os.fspath(path)}")
            except InputError as error:
                damaged(error)
                value = DAMAGED
            yield number, start, value
        start += len(content)


def read_at(path: Path, start: int) -> Any:
    """Read the JSON value of the line that begins at byte `start`."""
    with path.open("rb") as file:
        file.seek(start)
        line = file.readline().decode(errors="replace")
    return parse_object(line.rstrip(), f"the line at byte {start} of {path}")


def parse_object(line: str, place: str) -> Any:
    """Parse the JSON value of a line. Raises InputError where it is none."""
    try:
        value = json.loads(line)
    except json.JSONDecodeError as error:
        is_cut = error.pos >= len(line)
        beside = line[max(error.pos - 12, 0) : error.pos + 12].strip()
        raise InputError(
            f"expected a JSON object in {place}, got a syntax error at column "
            f"{error.colno} ({error.msg}), beside {beside!r}; "
            + ("an object stands on one line" if is_cut else "mend it there")
        ) from error
    except (ValueError, RecursionError) as error:  # a number of 5,000 digits, nested without end
        raise InputError(
            f"expected a JSON object in {place}, got one that cannot be read: {error}"
        ) from error
    return readable(value) if ESCAPED.search(line) else value


def read_head(record: Any, path: str | os.PathLike[str]) -> FileHead:
    """Read the head, the object on the first line."""
    where = os.fspath(path)
    if not isinstance(record, dict) or HEAD_KEY not in record:
        raise InputError(
            f'expected {{"{HEAD_KEY}": {VERSION}, ...}} in the first line of {where}, got '
            "something else; is it a parameters.jsonl that hiproof wrote?"
        )
    if record[HEAD_KEY] != VERSION:
        raise InputError(
            f"expected parameters of version {VERSION} in {where}, got version "
            f"{excerpt(record[HEAD_KEY])}; use the hiproof that wrote them, or reconstruct again"
        )
    try:
        settings = Settings.from_dict(
            {name: record.get(name) or {} for name in ("compose", "write")}
        )
        crs, unit, offset, update = (
            parse_crs(record.get("crs")),
            read_value(record.get("unit", "auto"), "unit", "unit"),
            read_value(record.get("cityjson_offset"), "place?", "cityjson_offset"),
            None if record.get("update") is None else read_update(record["update"]),
        )
    except (InputError, SettingsError) as error:
        raise InputError(f"{where}, in its head: {error!s:.400}") from error
    return FileHead(crs, unit, offset, settings.compose, settings.write, update=update)


def records(
    lines: Iterator[tuple[int, int, Any]], path: str | os.PathLike[str], damaged: Damaged = refuse
) -> Iterator[tuple[int, Values]]:
    """Yield (place, object) of the buildings after the head. Raises InputError for a second one."""
    for number, start, record in lines:
        if isinstance(record, dict) and HEAD_KEY in record:
            raise InputError(
                f"expected one head in {os.fspath(path)}, got another in line {number}, so files "
                "were joined; leave each a file of its own"
            )
        if record is not DAMAGED and not (
            isinstance(record, dict) and isinstance(record.get("id"), str)
        ):
            damaged(
                InputError(
                    f"expected a JSON object with an id in line {number} of {os.fspath(path)}, got "
                    f"{excerpt(record)}; is it a parameters.jsonl that hiproof wrote?"
                )
            )
            record = DAMAGED
        yield start, record
