"""Points of LAS, LAZ and COPC files, decoded by lazrs.

Of a point's record hiproof needs the coordinates, the class and one flag, whose bytes are those of
ASPRS' LAS 1.4 R15. laspy is not imported for them: it takes as long as reading a small file.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any, BinaryIO

import lazrs
import numpy as np

from ..log import count_things
from .decoded import Decoded
from .las_header import LasFacts

SELECTION = lazrs.DecompressionSelection(
    lazrs.SELECTIVE_DECOMPRESS_XY_RETURNS_CHANNEL
    | lazrs.SELECTIVE_DECOMPRESS_Z
    | lazrs.SELECTIVE_DECOMPRESS_CLASSIFICATION
    | lazrs.SELECTIVE_DECOMPRESS_FLAGS
)
"""What is decompressed of points of formats 6 to 10; older formats come whole."""

FIRST_EXTENDED = 6
"""The first of the point formats in which classes have a byte of their own."""


def read_points(
    file: BinaryIO, facts: LasFacts, runs: list[tuple[int, int]], chunk_points: int
) -> Iterator[Decoded]:
    """Yield the points of the `runs`, [first, end), at most `chunk_points` at once.

    Raises ValueError where an uncompressed file ends too early, and what lazrs raises where a
    compressed one is damaged.
    """
    source = open_decompressor(file, facts) if facts.compressed and facts.count else None
    for first, end in runs:
        if source and first:
            source.seek(first)
        for start in range(first, end, chunk_points):
            size = min(chunk_points, end - start) * facts.point_bytes
            yield take_fields(
                decompress(source, size) if source else read_plain(file, facts, start, size), facts
            )


def open_decompressor(file: BinaryIO, facts: LasFacts) -> Any:
    """Return lazrs' decompressor, which has threads where points come in chunks."""
    file.seek(facts.data_start)
    is_chunked = struct.unpack_from("<H", facts.laszip)[0] >= 2
    kind = lazrs.ParLasZipDecompressor if is_chunked else lazrs.LasZipDecompressor
    return kind(file, facts.laszip, SELECTION)


def decompress(source: Any, size: int) -> bytearray:
    content = bytearray(size)
    source.decompress_many(content)
    return content


def read_plain(file: BinaryIO, facts: LasFacts, first: int, size: int) -> bytes:
    file.seek(facts.data_start + first * facts.point_bytes)
    content = file.read(size)
    if missing := -(-(size - len(content)) // facts.point_bytes):
        raise ValueError(f"it ends {count_things(missing, 'point')} too early")
    return content


def take_fields(content: bytes | bytearray | np.ndarray, facts: LasFacts) -> Decoded:
    """Take from the records of points what hiproof needs."""
    records = np.frombuffer(content, np.uint8).reshape(-1, facts.point_bytes)
    steps = np.ascontiguousarray(records[:, :12]).view("<i4")
    is_extended = facts.point_format >= FIRST_EXTENDED
    classes = records[:, 16].copy() if is_extended else records[:, 15] & np.uint8(0x1F)
    is_withheld = records[:, 15] & np.uint8(0x04 if is_extended else 0x80) != 0
    return Decoded(steps, classes, is_withheld, facts.scales, facts.offsets)
