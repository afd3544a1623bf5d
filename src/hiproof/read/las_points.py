"""Points of LAS and LAZ files, decoded by laspy.

Of a point's record hiproof needs the coordinates, the class and one flag.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

import laspy
import numpy as np
from laspy import DecompressionSelection, LazBackend

from .las_header import LasFacts

SELECTION = (
    DecompressionSelection.XY_RETURNS_CHANNEL
    | DecompressionSelection.Z
    | DecompressionSelection.CLASSIFICATION
    | DecompressionSelection.FLAGS
)
"""What is decompressed of points of formats 6 to 10; older formats come whole."""


class Decoded(NamedTuple):
    """Coordinates (n, 3), classes (n,), and whether a point is withheld (n,)."""

    xyz: np.ndarray
    classes: np.ndarray
    is_withheld: np.ndarray


def read_points(
    file: BinaryIO, facts: LasFacts, runs: list[tuple[int, int]], chunk_points: int
) -> Iterator[Decoded]:
    """Yield the points of the `runs`, [first, end), at most `chunk_points` at once.

    Raises what laspy and lazrs raise where a file ends too early or is damaged.
    """
    # threads need points in chunks, which files of before 2011 have not
    is_chunked = facts.compressed and struct.unpack_from("<H", facts.laszip)[0] >= 2
    file.seek(0)
    reader = laspy.LasReader(
        file,
        closefd=False,
        laz_backend=LazBackend.LazrsParallel if is_chunked else LazBackend.Lazrs,
        read_evlrs=False,
        decompression_selection=SELECTION,
    )
    for first, end in runs:
        if first:
            reader.seek(first)
        for start in range(first, end, chunk_points):
            yield take_fields(reader.read_points(min(chunk_points, end - start)), facts)


def take_fields(points: laspy.PackedPointRecord, facts: LasFacts) -> Decoded:
    """Take from the records of points what hiproof needs."""
    xyz = np.column_stack([points.X, points.Y, points.Z]) * facts.scales + facts.offsets
    classes = np.array(points.classification, np.uint8)
    return Decoded(xyz, classes, np.array(points.withheld, bool))
