"""A building's texts, ready to be joined into the files of a run, and how they are kept until then.

A work tile's buildings are one file of plain arrays: bytes one after the other with the ends of each, and numbers. A
file that somebody else could have written is only ever read as data.
"""

from __future__ import annotations

import itertools
import json
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..errors import OutputError
from .citygml import Member
from .cityjson import Feature
from .table_rows import Rows

NOTHING = [np.nan] * 6


@dataclass(frozen=True)
class Fragments:
    """One building as each file of a run holds it."""

    gml: Member
    cityjson: Feature
    parameters: bytes
    rows: Rows


def save_fragments(file: BinaryIO, parts: Sequence[Fragments]) -> None:
    """Write the buildings `parts` to `file`, without compression."""
    texts = {
        "gml": [part.gml.text for part in parts],
        "cityjson": [part.cityjson.line for part in parts],
        "parameters": [part.parameters for part in parts],
        "rows": [rows_text(part.rows) for part in parts],
    }
    arrays = {
        "gml_extent": np.array([[*part.gml.low, *part.gml.high] for part in parts], float).reshape(-1, 6),
        "cityjson_extent": np.array([part.cityjson.extent or NOTHING for part in parts], float).reshape(-1, 6),
    }
    for name, several in texts.items():
        arrays[name] = np.frombuffer(b"".join(several), np.uint8)
        arrays[f"{name}_ends"] = np.cumsum([len(text) for text in several], dtype=np.int64)
    np.savez(file, **arrays)


def load_fragments(path: Path) -> Iterator[Fragments]:
    """The buildings that `save_fragments` wrote to `path`. Raises OutputError for a file that is not whole."""
    try:
        with np.load(path, allow_pickle=False) as arrays:
            names = ("gml", "cityjson", "parameters", "rows")
            texts = zip(*(cut(arrays[name], arrays[f"{name}_ends"]) for name in names), strict=True)
            extents = zip(arrays["gml_extent"], arrays["cityjson_extent"].tolist(), strict=True)
            for (gml, line, parameters, rows), (box, extent) in zip(texts, extents, strict=True):
                feature = Feature(line, None if np.isnan(extent[0]) else extent)
                yield Fragments(Member(gml, box[:3], box[3:]), feature, parameters, rows_of(rows))
    except (OSError, EOFError, ValueError, TypeError, KeyError, zipfile.BadZipFile) as error:
        raise OutputError(
            f"expected a work tile's buildings in {path}, got: {error}; begin anew with --restart"
        ) from error


def rows_text(rows: Rows) -> bytes:
    """Rows as JSON, geometries in hexadecimal digits."""
    return json.dumps([[[wkb and wkb.hex(), values] for wkb, values in table] for table in rows]).encode()


def rows_of(text: bytes) -> Rows:
    """The rows that `rows_text` wrote."""
    return Rows(*(tuple((wkb and bytes.fromhex(wkb), values) for wkb, values in table) for table in json.loads(text)))


def cut(joined: np.ndarray, ends: np.ndarray) -> list[bytes]:
    """The texts whose bytes stand one after the other in `joined` (n,), each up to its end."""
    content, starts = joined.tobytes(), [0, *ends.tolist()]
    return [content[start:end] for start, end in itertools.pairwise(starts)]
