"""The attributes of buildings in a tile.

They are a class and a table of EXT_structural_metadata, numbers as float64, all else as text.

The extension knows no null: what is unknown is `NO_NUMBER` or empty text, and the class says so.
One class serves all tiles, so that a style made for one works on every other.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...attribute_list import TABLES
from ...naming import UniqueNames
from ..gltf import GlbDocument

EXTENSION = "EXT_structural_metadata"
CLASS = "building"
NO_NUMBER = -9999.0  # stands for what is not known, as GDAL's files use it; no attribute has it
WHOLE = 2**53  # a larger whole number would not survive as a decimal: it is told as text
DESCRIBED_TABLES = ("roofer", "hiproof", "osm", "enriched", "enriched_3dbag", "enriched_sun")
DESCRIPTIONS = {
    "id": "the building's id",
    "type": "roof type of the part that shows the largest area",
    "parameters": "the roof's parts with types, parameters, positions and rotations, as JSON (see "
    "docs/parameters.md)",
} | {
    table.prefix + a.name: f"{a.meaning} ({a.unit})" if a.unit else a.meaning
    for table in map(TABLES.__getitem__, DESCRIBED_TABLES)
    for a in table.attributes
}


class Property(NamedTuple):
    """A column: its `id` in the class, its attribute's `name`, whether it holds numbers."""

    id: str
    name: str
    is_number: bool


class Found:
    """The attributes met so far, and whether all values of each are numbers."""

    def __init__(self) -> None:
        self.are_numbers: dict[str, bool | None] = {}  # None of what had no value so far

    def add(self, values: dict[str, Any]) -> None:
        for name, value in values.items():
            was_number = self.are_numbers.setdefault(name, None)
            if value is not None:
                self.are_numbers[name] = was_number is not False and is_number(value)

    def properties(self) -> list[Property]:
        """Return the columns, named of letters, digits and underscores for the extension."""
        names = UniqueNames()
        return [
            Property(property_id(names, name), name, bool(kind))
            for name, kind in self.are_numbers.items()
        ]


def is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= WHOLE


def property_id(names: UniqueNames, name: str) -> str:
    """Return `name` without what an id forbids, unique among `names`."""
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)
    return names.take(plain if re.match("[A-Za-z_]", plain) else f"_{plain}").replace("..", "_")


def make_schema(properties: Iterable[Property]) -> dict[str, Any]:
    """Return the schema: one class, a property a column."""
    kinds: dict[bool, dict[str, Any]] = {
        True: {"type": "SCALAR", "componentType": "FLOAT64", "noData": NO_NUMBER},
        False: {"type": "STRING", "noData": ""},
    }
    by_id = {
        p.id: {"name": p.name, "description": DESCRIPTIONS.get(p.name, "as given")}
        | kinds[p.is_number]
        for p in properties
    }
    return {"id": "hiproof", "classes": {CLASS: {"properties": by_id}}}


def add_table(
    document: GlbDocument, properties: Sequence[Property], rows: Sequence[dict[str, Any]]
) -> dict[str, Any]:
    """Add the table of `rows`, values by attribute's name."""
    columns = {p.id: add_column(document, p, [row.get(p.name) for row in rows]) for p in properties}
    return {"name": "buildings", "class": CLASS, "count": len(rows), "properties": columns}


def add_column(document: GlbDocument, column: Property, values: list[Any]) -> dict[str, Any]:
    if column.is_number:
        numbers = np.array([NO_NUMBER if v is None else v for v in values], "<f8")
        return {"values": document.view(numbers.tobytes())}
    texts = [format_value(value).encode() for value in values]
    ends = np.cumsum([0, *map(len, texts)]).astype("<u4")
    return {
        # A view may not be empty, so that a column of empty texts holds one byte that none of them
        # uses.
        "values": document.view(b"".join(texts) or b"\0"),
        "stringOffsets": document.view(ends.tobytes()),
        "stringOffsetType": "UINT32",
    }


def format_value(value: Any) -> str:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)
