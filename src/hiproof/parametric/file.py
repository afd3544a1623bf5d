"""parameters.jsonl read line by line: its head, its buildings, and its errors by line and column."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, SettingsError
from ..read.crs import NAMED_UNITS, parse_crs
from ..settings import Settings
from ..write.parameters import VERSION, FileHead

HEAD = "hiproof_parameters"


def read_parameters(path: str | os.PathLike) -> list[dict[str, Any]]:
    """The objects of all buildings in a parameters.jsonl, in its order.

    Raises InputError when it cannot be read or is no such file, naming line and column where its JSON is broken.
    """
    with opened_parameters(path) as (_, records):
        return list(records)


@contextmanager
def opened_parameters(path: str | os.PathLike) -> Iterator[tuple[FileHead, Iterator[dict[str, Any]]]]:
    """The head of the parameters.jsonl at `path`, and its buildings one by one; raises InputError as they are read."""
    try:
        with Path(path).open(encoding="utf-8-sig") as file:  # editors may begin it with a mark of the encoding
            lines = objects(file, path)
            yield head_of(next(lines, None), path), records(lines, path)
    except (OSError, UnicodeDecodeError) as error:
        found = "none" if isinstance(error, FileNotFoundError) else f"something else: {error}"
        raise InputError(
            f"expected a parameters.jsonl that hiproof wrote at {os.fspath(path)}, got {found}; check the path"
        ) from error


def objects(file: Any, path: str | os.PathLike) -> Iterator[tuple[int, Any]]:
    """(line, JSON value) of every line that is not blank."""
    for number, line in enumerate(file, 1):
        if line.strip():
            try:
                yield number, json.loads(line.rstrip())
            except json.JSONDecodeError as error:
                is_cut = error.pos >= len(line.rstrip())
                raise InputError(
                    f"expected a JSON object in line {number} of {os.fspath(path)}, got a syntax error at column "
                    f"{error.colno} ({error.msg}), beside {around(line, error.pos)!r}; "
                    + ("an object stands on one line" if is_cut else "mend it there")
                ) from error
            except (ValueError, RecursionError) as error:  # a number of 5,000 digits, nested without end
                raise InputError(
                    f"expected a JSON object in line {number} of {os.fspath(path)}, got one that cannot be read: {error}"
                ) from error


def around(line: str, place: int) -> str:
    return line[max(place - 12, 0) : place + 12].strip()


def head_of(first: tuple[int, Any] | None, path: str | os.PathLike) -> FileHead:
    """The head, from the first line."""
    where = os.fspath(path)
    record = first[1] if first else None
    if not isinstance(record, dict) or HEAD not in record:
        raise InputError(
            f'expected {{"{HEAD}": {VERSION}, ...}} in the first line of {where}, got something else; '
            "is it a parameters.jsonl that hiproof wrote?"
        )
    if record[HEAD] != VERSION:
        raise InputError(
            f"expected parameters of version {VERSION} in {where}, got version {record[HEAD]!r}; "
            "use the hiproof that wrote them, or reconstruct again"
        )
    unit, offset = record.get("unit", "auto"), record.get("cityjson_offset")
    if unit not in NAMED_UNITS:
        raise InputError(f"expected a unit ({', '.join(NAMED_UNITS)}) in the head of {where}, got {unit!r}; choose one")
    if offset is not None and not is_place(offset):
        raise InputError(f"expected three numbers as cityjson_offset of {where}, got {offset!r}; write null for none")
    try:
        settings = Settings.from_dict({name: record.get(name) or {} for name in ("compose", "write")})
    except SettingsError as error:
        raise InputError(f"{where}, in its head: {error}") from error
    offset = None if offset is None else np.array(offset)
    return FileHead(parse_crs(record.get("crs")), unit, offset, settings.compose, settings.write)


def is_place(value: Any) -> bool:
    """Whether a value is three finite numbers."""
    numbers = isinstance(value, list) and all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in value)
    return numbers and len(value) == 3 and bool(np.isfinite(np.array(value, float)).all())


def records(lines: Iterator[tuple[int, Any]], path: str | os.PathLike) -> Iterator[dict[str, Any]]:
    """The buildings after the head."""
    for number, record in lines:
        if not isinstance(record, dict) or not isinstance(record.get("id"), str):
            raise InputError(
                f"expected a JSON object with an id in line {number} of {os.fspath(path)}, got {str(record)[:40]!r}; "
                "is it a parameters.jsonl that hiproof wrote?"
            )
        yield record
