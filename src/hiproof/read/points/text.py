"""Points as text (XYZ, CSV, TXT, ASC, PTS), their header and delimiter by the first lines."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

from ...errors import InputError
from ...log import count_things
from ..names import READING
from ..remote import FilePath, open_binary
from .las import Chunk

COMMENTS = ("#", "//")


class TextLayout(NamedTuple):
    """A text file of points: lines to skip, delimiter (None: space), columns x, y, z, class."""

    skip: int
    delimiter: str | None
    columns: tuple[int, ...]


def text_chunks(path: FilePath, chunk_points: int) -> Iterator[Chunk]:
    """Yield the points of a text file; InputError names the first line without one."""
    layout = sniff(path)
    read = 0
    with (
        open_binary(path) as binary,
        io.TextIOWrapper(binary, encoding="utf-8-sig", errors="replace") as file,
    ):
        list(islice(file, layout.skip))
        while True:
            table = parse_rows(file, layout, chunk_points, path, read)
            read += len(table)
            if len(table):
                yield as_chunk(table)
            if len(table) < chunk_points:
                return


def parse_rows(file, layout: TextLayout, count: int, path: FilePath, read: int) -> np.ndarray:
    try:
        with warnings.catch_warnings():
            # NumPy warns of an empty rest, which is the normal end
            warnings.simplefilter("ignore", UserWarning)
            return np.loadtxt(
                file,
                delimiter=layout.delimiter,
                usecols=layout.columns,
                max_rows=count,
                comments=COMMENTS,
                ndmin=2,
            )
    except (ValueError, IndexError) as error:
        raise InputError(
            f"expected three numbers x y z on every line of {path}, got another after "
            f"{count_things(read, 'point')} ({error}); write one point a line with a decimal "
            "point, the columns separated by blanks, commas, semicolons or tabs"
        ) from error


def as_chunk(table: np.ndarray) -> Chunk:
    """Return the points of a table of x, y, z and, where there is one, class."""
    # in one piece, as from other files: what is compiled for these takes it
    xyz = np.ascontiguousarray(table[:, :3])
    if table.shape[1] < 4:
        return xyz, None
    return xyz, np.clip(np.nan_to_num(table[:, 3]), 0, 255).astype(np.uint8)


def sniff(path: FilePath) -> TextLayout:
    """Find the layout by the first lines; InputError without text or three numbers."""
    with open_binary(path) as file:
        head = file.read(65536)
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(
            f"expected text in UTF-8 in {path}, got UTF-16; save it as UTF-8 or plain text"
        )
    if head[:16].lstrip().lower().startswith(b"ncols"):
        raise InputError(
            f"expected lines of x y z in {path}, got an ESRI ASCII grid; convert a surface model "
            "to points (`gdal2xyz`), or name a model of the ground with --terrain"
        )
    if b"\0" in head:
        raise InputError(
            f"expected text with x y z on each line in {path}, got binary data; rename it"
        )
    lines = head.decode("utf-8-sig", errors="replace").splitlines()
    names: list[str] = []
    for number, line in enumerate(lines):
        text = line.strip().lstrip("#/").strip()
        delimiter = find_delimiter(text)
        fields, is_comment = text.split(delimiter), line.lstrip().startswith(COMMENTS)
        if len(fields) < 3:  # blank, or the count that starts a PTS file
            continue
        if not is_comment and all(map(is_number, fields[:3])):
            return TextLayout(number, delimiter, find_columns(names) or (0, 1, 2))
        if columns := find_columns(fields):
            names = fields
            following = next(filter(str.strip, lines[number + 1 :]), None)
            if following and not is_comment:
                return TextLayout(number + 1, find_delimiter(following), columns)
        elif number > 20:
            break
    start = lines[0][:60] if lines else ""
    raise InputError(
        f"expected lines of x y z in {path}, got {start!r} and nothing like a point after it; "
        "give LAS, LAZ, COPC, PLY or text with one point a line and decimal points"
    )


def is_of_points(path: FilePath) -> bool:
    """Return whether the first lines of a text file are points."""
    try:
        sniff(path)
    except (InputError, OSError):
        return False
    return True


def find_delimiter(line: str) -> str | None:
    return next((mark for mark in (";", "\t", ",") if mark in line), None)


def is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


NAMES: dict[str, list[str]] = READING["point_columns"]


def find_columns(header: Sequence[str]) -> tuple[int, ...] | None:
    """Return the indices of x, y, z and classification among column names.

    Classification is left out where there is none. Returns None unless x, y and z are named.

    >>> find_columns(["Intensity", "X", "Y", "Z", "Classification"])
    (1, 2, 3, 4)
    """
    names = [name.strip().strip("\"'").lower() for name in header]
    result = []
    for targets in NAMES.values():
        matches = [names.index(alias) for alias in targets if alias in names]
        result += matches[:1]
    return tuple(result) if len(result) >= 3 and names[result[2]] in NAMES["z"] else None
