"""LAS, LAZ and COPC files through laspy and lazrs, chunk by chunk; by path or by address (see remote.py)."""

from __future__ import annotations

import struct
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import laspy
import numpy as np

from ..errors import InputError, InputWarning
from .crs import combine
from .geokeys import heights_of_keys
from .remote import opened

Chunk = tuple[np.ndarray, np.ndarray | None]  # xyz (n, 3) float64, classification (n,) uint8 or None
EVLR_HEADER_BYTES = 60


@contextmanager
def explained(path: str | Path) -> Iterator[None]:
    """Turn whatever laspy and lazrs raise on a damaged file into one InputError."""
    try:
        yield
    except InputError:
        raise
    except BaseException as error:
        # A panic inside lazrs arrives as pyo3's PanicException, which is no Exception; interrupts must pass through.
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        reason = str(error) or type(error).__name__
        raise InputError(
            f"expected a complete LAS, LAZ or COPC file at {path}, got one that cannot be decoded ({reason}); "
            "it may be truncated: copy or download it again, and compare its size with the original's"
        ) from error


def read_las_header(path: str | Path) -> laspy.LasHeader:
    """The header of a LAS, LAZ or COPC file. Raises InputError when it cannot be read."""
    refuse_missing_records(path)
    with explained(path), opened(path) as file, laspy.open(file) as reader:
        return reader.header


def refuse_missing_records(path: str | Path) -> None:
    """Raise InputError where LAS 1.4's extended records reach beyond the file: laspy would read on, billions of times."""
    with explained(path), opened(path) as file:
        head = file.read(247)
        size = file.seek(0, 2)
        if len(head) < 247 or head[25] < 4:
            return
        start, count = struct.unpack_from("<QI", head, 235)
        if count and start + EVLR_HEADER_BYTES * count > size:
            raise ValueError(f"its header tells of {count} records from byte {start} on, the file has {size} bytes")


def las_crs(header: laspy.LasHeader, path: str | Path):
    """The header's pyproj CRS, None where it names none or none that pyproj understands (then with a warning)."""
    try:
        return combine(header.parse_crs(), heights_of_keys(header))
    except Exception as error:  # laspy lets through whatever pyproj makes of the records
        warnings.warn(
            f"{path}: its coordinate reference system cannot be understood ({error}); taken as unknown", InputWarning
        )
        return None


def las_chunks(
    path: str | Path,
    chunk_points: int,
    box: tuple[float, float, float, float] | None,
    runs: np.ndarray | None = None,
) -> Iterator[Chunk]:
    """Yield the chunks of `path`; of a COPC file with a `box` only the octree's nodes that meet the box are decoded.

    `runs` (k, 2) of points, [first, end), limit what is read of another file.
    """
    if box is not None and is_copc(path):
        yield copc_chunk(path, box)
        return
    selection = laspy.DecompressionSelection
    wanted = selection.base() | selection.Z | selection.CLASSIFICATION | selection.FLAGS
    found = 0
    with (
        explained(path),
        opened(path) as file,
        laspy.open(file, decompression_selection=wanted, read_evlrs=False) as reader,
    ):
        runs = np.array([[0, reader.header.point_count]]) if runs is None else runs
        expected = int((runs[:, 1] - runs[:, 0]).sum())
        for first, end in runs.tolist():
            if first:
                reader.seek(first)
            for start in range(first, end, chunk_points):
                record = reader.read_points(min(chunk_points, end - start))
                found += len(record)
                yield decode(record, path)
    if found != expected:
        raise InputError(
            f"expected {expected} points in {path} as its header says, got {found}; "
            "the file is truncated: copy or download it again"
        )


def is_copc(path: str | Path) -> bool:
    """Whether the file is cloud-optimised: the first VLR is COPC's by its standard."""
    with explained(path), opened(path) as file:
        head = file.read(400)
    return head[375 + 2 : 375 + 6] == b"copc"


def copc_chunk(path: str | Path, box: tuple[float, float, float, float]) -> Chunk:
    refuse_missing_records(path)
    with explained(path), opened(path) as file, laspy.CopcReader.open(file) as reader:
        low, high = reader.header.mins[2], reader.header.maxs[2]
        bounds = laspy.copc.Bounds(np.array([box[0], box[1], low]), np.array([box[2], box[3], high]))
        return decode(reader.query(bounds), path)


def decode(record, path: str | Path) -> Chunk:
    """World coordinates and classes of a laspy record without the points flagged as withheld, that is, deleted."""
    xyz = np.empty((len(record), 3))
    for axis, name in enumerate("XYZ"):
        np.multiply(record.array[name], record.scales[axis], out=xyz[:, axis])
        xyz[:, axis] += record.offsets[axis]
    classification = np.asarray(record["classification"], np.uint8)
    withheld = np.asarray(record["withheld"], bool)
    if withheld.any():
        warnings.warn(f"{path}: {int(withheld.sum())} points flagged as withheld were left out", InputWarning)
        xyz, classification = xyz[~withheld], classification[~withheld]
    return xyz, classification
