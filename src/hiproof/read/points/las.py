"""LAS, LAZ and COPC files through lazrs, chunk by chunk.

Files are read by path or by address (remote.py).

Before points are decoded, `las_header` has held the header against the file's size; what is decoded
is held against the header.
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import laspy
import lazrs
import numpy as np
from laspy import DecompressionSelection, LazBackend

from ...errors import InputError, warn
from ...frames import Box
from ...log import count_things
from ..plausible import Implausible
from ..remote import FilePath, is_url, open_binary
from .las_header import LasFacts, Octree, check_all_points, check_points, read_facts
from .runs import compute_run_boxes


def find_nodes(octree: Octree, box: Box) -> Octree:
    """Return the nodes with points that meet `box` (xmin, ymin, xmax, ymax) in plan."""
    lower, upper = octree.lower[:, :2], octree.upper[:, :2]
    meets = (lower <= box[2:]).all(axis=1) & (upper >= box[:2]).all(axis=1)
    return Octree(*(values[meets] for values in octree))


def read_nodes(file: BinaryIO, nodes: np.ndarray, facts: LasFacts) -> Decoded:
    """Read the points of `nodes`, node after node."""
    file.seek(0)
    form = laspy.LasHeader.read_from(file, read_evlrs=False).point_format
    points = laspy.PackedPointRecord.zeros(int(nodes["points"].sum()), form)
    bodies = []
    for start, size in zip(nodes["start"].tolist(), nodes["bytes"].tolist(), strict=True):
        file.seek(start)
        bodies.append(file.read(size))
    if bodies:
        lazrs.decompress_points_with_chunk_table(
            np.frombuffer(b"".join(bodies), np.uint8),
            np.frombuffer(facts.laszip, np.uint8),
            points.array.view(np.uint8),
            nodes[["points", "bytes"]].tolist(),
            SELECTION.to_lazrs(),
        )
    return take_fields(points, facts)


def check_nodes(xyz: np.ndarray, octree: Octree) -> None:
    """Raise Implausible where points `xyz` (n, 3), node after node, leave their cubes."""
    starts = np.cumsum([0, *octree.nodes["points"][:-1]])
    lowest, highest = (f.reduceat(xyz, starts) for f in (np.minimum, np.maximum))
    outside = ((lowest < octree.lower) | (highest > octree.upper)).any(axis=1)
    if outside.any():
        level, *place = octree.nodes["key"][np.argmax(outside)].tolist()
        raise Implausible(
            f"its octree's node {place} of level {level} has points outside its bounds; it is "
            "damaged"
        )


def read_box(file: BinaryIO, facts: LasFacts, box: Box) -> Iterator[Decoded]:
    """Yield the points of the octree's nodes that meet `box`, all at once."""
    if facts.octree is None:
        raise Implausible(
            "its first record says that it is COPC, and none tells of an octree; it is damaged"
        )
    octree = find_nodes(facts.octree, box)
    decoded = xyz, _, _ = read_nodes(file, octree.nodes, facts)
    check_points(xyz, facts)
    if len(xyz):
        check_nodes(xyz, octree)
    yield decoded


# What is decompressed of points of formats 6 to 10; older formats come whole.
SELECTION = (
    DecompressionSelection.XY_RETURNS_CHANNEL
    | DecompressionSelection.Z
    | DecompressionSelection.CLASSIFICATION
    | DecompressionSelection.FLAGS
)


Decoded = tuple[np.ndarray, np.ndarray, np.ndarray]  # xyz (n, 3), classes (n,), withheld (n,)


def read_points(
    file: BinaryIO, facts: LasFacts, runs: list[tuple[int, int]], chunk_points: int
) -> Iterator[Decoded]:
    """Yield points of `runs`, [first, end), in chunks; raises as laspy and lazrs."""
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
    return xyz, np.array(points.classification, np.uint8), np.array(points.withheld, bool)


# xyz (n, 3) float64, classification (n,) uint8 or None
Chunk = tuple[np.ndarray, np.ndarray | None]


@contextmanager
def translate_errors(path: FilePath) -> Iterator[None]:
    """Turn whatever lazrs raises on a damaged file into one InputError."""
    try:
        yield
    except InputError:
        raise
    except Implausible as error:
        raise InputError(
            f"expected a LAS, LAZ or COPC file that is what its header says at {path}, got "
            f"another: {error}; copy or download it "
            "again, or have its header written anew (`pdal translate`)"
        ) from error
    except BaseException as error:
        # A panic inside lazrs arrives as pyo3's PanicException, which is no Exception; interrupts
        # must pass through.
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        reason = str(error) or type(error).__name__
        raise InputError(
            f"expected a complete LAS, LAZ or COPC file at {path}, got one that cannot be decoded "
            f"({reason}); it may be truncated: copy or download it again, and compare its size "
            "with the original's"
        ) from error


def read_checked_facts(path: FilePath) -> LasFacts:
    """Return the facts of a header that passed its checks; raises InputError otherwise."""
    with translate_errors(path):
        return facts_at(str(path), None if is_url(path) else Path(path).stat().st_mtime_ns)


@functools.lru_cache(maxsize=64)
def facts_at(path: str, changed: int | None) -> LasFacts:
    """Return a header's facts, read once for each time of change: squares open it again."""
    with open_binary(path) as file:
        return read_facts(file)


def las_chunks(
    path: FilePath,
    chunk_points: int,
    box: Box | None = None,
    runs: np.ndarray | None = None,
    noted: list[np.ndarray] | None = None,
) -> Iterator[Chunk]:
    """Yield the chunks of `path`.

    Of a COPC file with a `box` only the octree's nodes that meet the box are decoded. `runs` (k, 2)
    of points, [first, end), limit what is read of another file. To `noted` go the boxes (k, 4) of
    the runs of each chunk (runs.py), of all its points.
    """
    facts, left_out, count = read_checked_facts(path), 0, 0
    lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
    parts = [(0, facts.count)] if runs is None else runs.tolist()
    with translate_errors(path), open_binary(path) as file:
        chunks = read_points(file, facts, parts, chunk_points)
        if box is not None and is_copc(path):
            chunks = read_box(file, facts, box)
        for xyz, classes, is_withheld in chunks:
            lowest, highest = check_points(xyz, facts)
            lower, upper = np.minimum(lower, lowest), np.maximum(upper, highest)
            if noted is not None:
                noted.append(compute_run_boxes(xyz))
            left_out += int(is_withheld.sum())
            count += len(xyz)
            yield xyz[~is_withheld], classes[~is_withheld]
        if runs is None and 0 < count == facts.count:
            check_all_points(lower, upper, facts)
    if left_out:
        warn(path, f"{count_things(left_out, 'point')} flagged as withheld left out")


def is_copc(path: FilePath) -> bool:
    """Return whether the file is cloud-optimised: its first VLR is COPC's."""
    with translate_errors(path), open_binary(path) as file:
        head = file.read(400)
    return head[375 + 2 : 375 + 6] == b"copc"
