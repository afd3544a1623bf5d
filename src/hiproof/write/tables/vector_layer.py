"""A layer of a vector file, written through GDAL (pyogrio).

Its rows wait until the last building has settled every column's type.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice
from typing import Any, BinaryIO

import numpy as np

from ...data_files import Values
from ...errors import OutputError
from ..attribute_list import OWN, TABLES

CONFIGURATION = {
    # a GeoPackage notes when a table last changed; the same input gives the same file
    "OGR_CURRENT_DATE": "2000-01-01T00:00:00.000Z",
    "OGR_GPKG_ALLOW_THREADED_RTREE": False,
    "OGR_SQLITE_SYNCHRONOUS": "OFF",  # the file is seen once it is whole
}
GEOPACKAGE: Values = {
    "driver": "GPKG",
    "dataset_options": {"VERSION": "1.2"},
    "layer_options": {"GEOMETRY_NAME": "geom"},
}


def write_layer(
    path: str | os.PathLike[str],
    layer: str,
    columns: Mapping[str, type],
    rows: Iterable[Sequence[Any]],
    wkb: Iterable[bytes | None] | None = None,
    **options: Any,
) -> None:
    """Write or append `rows`, values by column, with their geometries as WKB.

    `columns` are names and types; `options` are pyogrio's own. Raises what pyogrio does.
    """
    import pyogrio

    pyogrio.set_gdal_config_options(CONFIGURATION)
    values = list(zip(*rows, strict=True)) or [()] * len(columns)
    data = [make_column(*pair) for pair in zip(values, columns.values(), strict=True)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # on a file's hidden name, and on an unknown CRS
        pyogrio.raw.write(
            os.fspath(path),
            None if wkb is None else make_objects([*wkb]),
            [column for column, _ in data],
            list(columns),
            [mask for _, mask in data],
            layer=layer,
            **options,
        )


@contextmanager
def translate_write_errors(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn errors of GDAL into an OutputError about the file `path`."""
    try:
        yield
    except (RuntimeError, OSError) as error:  # pyogrio's own are RuntimeErrors
        raise OutputError(
            f"expected to write {os.fspath(path)}, got: {error}; check the permissions and the "
            "space left"
        ) from error


def make_column(values: Sequence[Any], kind: type) -> tuple[np.ndarray, np.ndarray]:
    """Return values (n,) of one type, and where they are unknown (n,)."""
    mask = np.array([value is None for value in values], dtype=bool)
    if kind is str:
        return make_objects([None if v is None else str(v) for v in values]), mask
    dtype = {bool: np.bool_, int: np.int64, float: np.float64}[kind]
    return np.array([kind(0) if v is None else kind(v) for v in values], dtype=dtype), mask


def make_objects(values: Sequence[Any]) -> np.ndarray:
    """Return an array (n,) of the values themselves, whatever their types."""
    array = np.empty(len(values), dtype=object)
    array[:] = values
    return array


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

    def batches(self, kinds: Mapping[str, type]) -> Iterator[list[tuple[bytes | None, list[Any]]]]:
        """Yield geometries and values of columns, some thousand rows at a time, or none at once."""
        self.file.seek(0)
        rows = (
            (
                wkb and bytes.fromhex(wkb),
                [
                    None if (value := values.get(name)) is None else kind(value)
                    for name, kind in kinds.items()
                ],
            )
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


def name_columns(
    kinds: Iterable[tuple[str, type]], reserved: Iterable[str] = ()
) -> dict[str, type]:
    """Return types of columns by names that SQLite can hold beside the `reserved` ones.

    SQLite does not tell upper from lower case.

    >>> list(name_columns([("id", str), ("Year", int), ("year", int), ("fid", int)], ["fid"]))
    ['id', 'Year', 'year_2', 'fid_2']
    """
    accepted, columns = set(reserved), {}
    for name, kind in kinds:
        candidate, number = name, 1
        while candidate.lower() in accepted:
            number += 1
            candidate = f"{name}_{number}"
        accepted.add(candidate.lower())
        columns[candidate] = kind
    return columns
