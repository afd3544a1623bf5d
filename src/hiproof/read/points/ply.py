"""Points of PLY files, ascii and binary: only the vertices' scalars are needed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ...errors import InputError
from ...log import count_things
from ..names import READING
from ..remote import open_binary
from .las import Chunk
from .text import TextLayout, find_columns, parse_rows, read_classes

PLY_TYPES: dict[str, str] = READING["ply_types"]
PLAIN_COUNT = re.compile("[0-9]{1,18}")
BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True)
class PlyLayout:
    """The header of a PLY file, with the columns of x, y, z and class.

    The byte order "" is ascii. Properties are (name, NumPy type).
    """

    byte_order: str
    count: int
    properties: tuple[tuple[str, str], ...]
    columns: tuple[int, ...]


def ply_chunks(path: str | Path, chunk_points: int) -> Iterator[Chunk]:
    """Yield the vertices of a PLY file; raises InputError for a header or body of none."""
    with open_binary(path) as file:
        layout = read_ply_header(file, path)
        refuse_missing_bytes(file, layout, path)
        remaining = layout.count
        while remaining:
            table = read_vertices(
                file, layout, min(remaining, chunk_points), path, layout.count - remaining
            )
            yield np.ascontiguousarray(table[:, :3]), read_classes(table)
            remaining -= len(table)


def refuse_missing_bytes(file: BinaryIO, layout: PlyLayout, path: str | Path) -> None:
    """Hold the count against the file's size before room is made for so many."""
    start, end = file.tell(), file.seek(0, 2)
    file.seek(start)
    count = len("0 0 0") if layout.byte_order == "" else record_type(layout).itemsize
    if layout.count * count > end - start:
        raise InputError(
            f"expected {count_things(layout.count, 'vertex', 'vertices')} in {path} as its header "
            f"says, got {end - start} bytes of them; the file is truncated: copy or download it "
            "again"
        )


def record_type(layout: PlyLayout) -> np.dtype:
    """Return the NumPy type of a vertex of a binary file."""
    return np.dtype([(name, layout.byte_order + kind) for name, kind in layout.properties])


def read_vertices(
    file: BinaryIO, layout: PlyLayout, count: int, path: str | Path, read: int
) -> np.ndarray:
    """Read the next `count` vertices (float64): x, y, z and, where there is one, class."""
    if layout.byte_order == "":
        table = parse_rows(file, TextLayout(0, None, layout.columns), count, path, read)
        result = len(table)
    else:
        dtype = record_type(layout)
        buffer = file.read(dtype.itemsize * count)
        result = len(buffer) // dtype.itemsize
        records = np.frombuffer(buffer, dtype, result)
        table = np.column_stack(
            [records[layout.properties[column][0]].astype(float) for column in layout.columns]
        )
    if result < count:
        raise InputError(
            f"expected {count_things(layout.count, 'vertex', 'vertices')} in {path} as its header "
            f"says, got {read + result}; the file is truncated: copy or download it again"
        )
    return table


def read_ply_header(file: BinaryIO, path: str | Path) -> PlyLayout:
    """Read up to `end_header`, leaving `file` at the first vertex."""
    properties: list[tuple[str, str]] = []
    byte_order, count, element = None, None, None
    for words in header_lines(file, path):
        if words[0] == "format" and len(words) > 1:
            byte_order = BYTE_ORDERS.get(words[1])
        elif words[0] == "element" and len(words) == 3:
            if count is None and words[1] != "vertex":
                raise unreadable(path, f"the element {words[1]!r} before the vertices")
            element = words[1]
            if element == "vertex":
                if count is not None or not PLAIN_COUNT.fullmatch(words[2]):
                    raise unreadable(path, f"{words[2][:20]!r} vertices")
                count = int(words[2])
        elif words[0] == "property" and element == "vertex":
            if len(words) != 3 or words[1] not in PLY_TYPES:
                raise unreadable(path, f"the vertex property {' '.join(words[1:])!r}")
            if words[2] in dict(properties):
                raise unreadable(path, f"the vertex property {words[2]!r} twice")
            properties.append((words[2], PLY_TYPES[words[1]]))
    columns = find_columns([name for name, _ in properties])
    if byte_order is None or count is None or columns is None:
        raise unreadable(path, "a header without format, vertices or their x, y, z")
    return PlyLayout(byte_order, count, tuple(properties), columns)


def header_lines(file: BinaryIO, path: str | Path) -> Iterator[list[str]]:
    for _ in range(1000):
        line = file.readline(4096)
        words = line.decode("latin-1").split()
        if words == ["end_header"]:
            return
        if not line:
            break
        if words and words[0] not in ("ply", "comment", "obj_info"):
            yield words
    raise unreadable(path, "a header that does not end")


def unreadable(path: str | Path, got: str) -> InputError:
    return InputError(
        f"expected a PLY file whose first element is the vertices with scalar x, y, z in {path}, "
        f"got {got}; export the points alone, or write them as LAZ"
    )
