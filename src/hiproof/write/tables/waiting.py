"""Rows of a table that wait until every column's type is known.

The last building settles it.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import BinaryIO

from ..attribute_list import OWN, TABLES
from .rows import Row

HISTORY = "history"  # a table that only runs have in which models ended
BATCH_ROWS = 10_000  # rows handed on at once: the overhead is a call's, the memory a row's


class WaitingRows:
    """Rows of a table, text of its buildings, in a temporary file, and its columns' types."""

    def __init__(self, layer: str, file: BinaryIO) -> None:
        self.layer, self.file, self.count = layer, file, 0
        self.found: dict[str, set[type]] = {
            name: set() for name in (TABLES[layer].names if layer in TABLES else ())
        }

    def put(self, line: bytes) -> None:
        """Store a building's rows, as a line of `Rows.to_text`."""
        for _, values in json.loads(line):
            self.count += 1
            for name, value in values.items():
                self.found.setdefault(name, set()).add(
                    # whole numbers beyond 64 bits count as text
                    str if type(value) is int and abs(value) >= 2**63 else type(value)
                )
        self.file.write(line + b"\n")

    @property
    def is_needed(self) -> bool:
        """Whether a run has this table."""
        return self.layer != HISTORY or self.count > 0

    def kinds(self, prefix: str, limit: int | None = None) -> dict[str, type]:
        """Return each column's one type; above `limit`, the last of the input's own go."""
        names = [self.layer] if self.layer in TABLES else ["roofer", "hiproof", "osm"]
        prefixes = {"roofer": prefix, "hiproof": OWN}
        declared = {
            prefixes.get(name, "") + a.name: a.kind
            for name in names
            for a in TABLES[name].attributes
        }
        kinds = {
            name: column_kind(result, declared.get(name, "text"))
            for name, result in self.found.items()
        }
        excess = len(kinds) - (limit or len(kinds))
        if excess > 0:
            selected_kinds = [name for name in kinds if name not in declared and name != "id"]
            left_out = set(selected_kinds[-excess:])
            kinds = {name: kind for name, kind in kinds.items() if name not in left_out}
        return kinds or {"id": str}

    def batches(self) -> Iterator[list[Row]]:
        """Yield the rows, some thousands at a time, or one empty batch."""
        self.file.seek(0)
        rows = (
            (wkb and bytes.fromhex(wkb), values)
            for line in self.file
            for wkb, values in json.loads(line)
        )
        yield list(islice(rows, BATCH_ROWS))
        while batch := list(islice(rows, BATCH_ROWS)):
            yield batch


def column_kind(result: set[type], declared: str) -> type:
    """Return the one type of all values, as `declared` where all are unknown."""
    kinds = result - {type(None)}
    if not kinds:
        return {"text": str, "count": int}.get(declared, float)
    if len(kinds) == 1:
        return kinds.pop()
    return str if str in kinds else float if float in kinds else int


def column_names(names: Iterable[str], reserved: Iterable[str] = ()) -> list[str]:
    """Return names that SQLite can hold beside the `reserved` ones.

    SQLite does not tell upper from lower case.

    >>> column_names(["id", "Year", "year", "fid"], ["fid"])
    ['id', 'Year', 'year_2', 'fid_2']
    """
    accepted, unique = set(reserved), []
    for name in names:
        candidate, number = name, 1
        while candidate.lower() in accepted:
            number += 1
            candidate = f"{name}_{number}"
        accepted.add(candidate.lower())
        unique.append(candidate)
    return unique
