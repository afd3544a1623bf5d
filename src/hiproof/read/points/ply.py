"""Points of PLY files, ascii and binary: only the vertices' scalars are needed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

import numpy as np

from ...errors import InputError
from ...log import count_things
from ..names import READING
from ..remote import FilePath, open_binary
from .las import Chunk
from .text import TextLayout, as_chunk, find_columns, parse_rows

PLY_TYPES: dict[str, str] = READING["ply_types"]
PLAIN_COUNT = re.compile("[0-9]{1,18}")
BYTE_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


class PlyLayout(NamedTuple):
    """The header: how many `vertices`, their `record` (None: ascii), columns x, y, z, class."""

    vertices: int
    record: np.dtype | None
    columns: tuple[int, ...]


def ply_chunks(path: FilePath, chunk_points: int) -> Iterator[Chunk]:
    """Yield the vertices of a PLY file; raises InputError for a header or body of none."""
    with open_binary(path) as file:
        layout = read_ply_header(file, path)
        start, end = file.tell(), file.seek(0, 2)
        file.seek(start)
        # the count is held against the file's size before room is made for so many
        least_bytes = len("0 0 0") if layout.record is None else layout.record.itemsize
        if layout.vertices * least_bytes > end - start:
            raise explain_truncation(layout, path, f"{end - start} bytes of them")
        for read in range(0, layout.vertices, chunk_points):
            count = min(chunk_points, layout.vertices - read)
            table = read_vertices(file, layout, count, path, read)
            if len(table) < count:
                raise explain_truncation(layout, path, read + len(table))
            yield as_chunk(table)


def explain_truncation(layout: PlyLayout, path: FilePath, got: object) -> InputError:
    return InputError(
        f"expected {count_things(layout.vertices, 'vertex', 'vertices')} in {path} as its header "
        f"says, got {got}; the file is truncated: copy or download it again"
    )


def read_vertices(
    file: BinaryIO, layout: PlyLayout, count: int, path: FilePath, read: int
) -> np.ndarray:
    """Read up to `count` more vertices (float64): x, y, z and, where there is one, class."""
    record = layout.record
    if record is None:
        return parse_rows(file, TextLayout(0, None, layout.columns), count, path, read)
    buffer = file.read(record.itemsize * count)
    rows = np.frombuffer(buffer, record, len(buffer) // record.itemsize)
    names = np.array(record.names)[list(layout.columns)]
    return np.column_stack([rows[name].astype(float) for name in names])


def read_ply_header(file: BinaryIO, path: FilePath) -> PlyLayout:
    """Read up to `end_header`, leaving `file` at the first vertex."""
    types: dict[str, str] = {}
    byte_order, count, element = None, None, None
    for words in header_lines(file, path):
        match words:
            case ["format", name, *_]:
                byte_order = BYTE_ORDERS.get(name)
            case ["element", name, number]:
                if count is None and name != "vertex":
                    raise unreadable(path, f"the element {name!r} before the vertices")
                element = name
                if name == "vertex":
                    if count is not None or not PLAIN_COUNT.fullmatch(number):
                        raise unreadable(path, f"{number[:20]!r} vertices")
                    count = int(number)
            case ["property", kind, name] if element == "vertex" and kind in PLY_TYPES:
                if name in types:
                    raise unreadable(path, f"the vertex property {name!r} twice")
                types[name] = PLY_TYPES[kind]
            case ["property", *others] if element == "vertex":
                raise unreadable(path, f"the vertex property {' '.join(others)!r}")
    columns = find_columns(list(types))
    if byte_order is None or count is None or columns is None:
        raise unreadable(path, "a header without format, vertices or their x, y, z")
    record = [(name, byte_order + kind) for name, kind in types.items()]
    return PlyLayout(count, np.dtype(record) if byte_order else None, columns)


def header_lines(file: BinaryIO, path: FilePath) -> Iterator[list[str]]:
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


def unreadable(path: FilePath, got: str) -> InputError:
    return InputError(
        f"expected a PLY file whose first element is the vertices with scalar x, y, z in {path}, "
        f"got {got}; export the points alone, or write them as LAZ"
    )
