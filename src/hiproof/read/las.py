"""LAS, LAZ and COPC files through lazrs, chunk by chunk.

Files are read by path or by address (remote.py).

Before points are decoded, `las_header` has held the header against the file's size; what is decoded
is held against the header.
"""

from __future__ import annotations

import functools
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from ..errors import InputError, InputWarning
from ..log import count_things
from .copc import check_nodes, copc_points
from .las_header import LasFacts, check_all_points, check_points, read_facts
from .las_points import Decoded, read_points
from .plausible import Implausible
from .remote import is_url, open_binary
from .runs import compute_run_boxes

# xyz (n, 3) float64, classification (n,) uint8 or None
Chunk = tuple[np.ndarray, np.ndarray | None]


@contextmanager
def translate_errors(path: str | Path) -> Iterator[None]:
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
            f"({reason}); "
            "it may be truncated: copy or download it again, and compare its size with the "
            "original's"
        ) from error


def read_checked_facts(path: str | Path) -> LasFacts:
    """Return the facts of a header that passed its checks.

    Raises InputError otherwise.
    """
    with translate_errors(path):
        return facts_at(str(path), None if is_url(path) else Path(path).stat().st_mtime_ns)


@functools.lru_cache(maxsize=64)
def facts_at(path: str, changed: int | None) -> LasFacts:
    """Return the header's facts, read once a process for each state of a file.

    `changed` is the file's time of change. An indexed file is opened for each of its squares.
    """
    with open_binary(path) as file:
        return read_facts(file)


def las_chunks(
    path: str | Path,
    chunk_points: int,
    box: tuple[float, float, float, float] | None = None,
    runs: np.ndarray | None = None,
    noted: list[np.ndarray] | None = None,
) -> Iterator[Chunk]:
    """Yield the chunks of `path`.

    Of a COPC file with a `box` only the octree's nodes that meet the box are decoded.

    `runs` (k, 2) of points, [first, end), limit what is read of another file. To `noted` go the
    boxes (k, 4) of the runs of each chunk (runs.py), of all its points.
    """
    if box is not None and is_copc(path):
        yield copc_chunk(path, box)
        return
    facts, left_out = read_checked_facts(path), 0
    lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
    parts = [(0, facts.count)] if runs is None else runs.tolist()
    with translate_errors(path), open_binary(path) as file:
        for points in read_points(file, facts, parts, chunk_points):
            xyz = points.xyz
            lowest, highest = check_points(xyz, facts)
            lower, upper = np.minimum(lower, lowest), np.maximum(upper, highest)
            if noted is not None:
                noted.append(compute_run_boxes(xyz))
            chunk = drop_withheld(xyz, points)
            left_out += len(xyz) - len(chunk[0])
            yield chunk
        if runs is None and facts.count:
            check_all_points(lower, upper, facts)
    log_withheld(left_out, path)


def is_copc(path: str | Path) -> bool:
    """Return whether the file is cloud-optimised: its first VLR is COPC's."""
    with translate_errors(path), open_binary(path) as file:
        head = file.read(400)
    return head[375 + 2 : 375 + 6] == b"copc"


def copc_chunk(path: str | Path, box: tuple[float, float, float, float]) -> Chunk:
    facts = read_checked_facts(path)
    with translate_errors(path), open_binary(path) as file:
        if facts.octree is None:
            raise Implausible(
                "its first record says that it is COPC, and none tells of an octree; it is damaged"
            )
        nodes, points = copc_points(file, facts, facts.octree, box)
        xyz = points.xyz
        lower, upper = check_points(xyz, facts)
        check_nodes(xyz, nodes, facts, facts.octree)
        if 0 < len(xyz) == facts.count:
            check_all_points(lower, upper, facts)
        chunk = drop_withheld(xyz, points)
    log_withheld(len(xyz) - len(chunk[0]), path)
    return chunk


def drop_withheld(xyz: np.ndarray, points: Decoded) -> Chunk:
    """Return coordinates (n, 3) and classes without withheld points.

    Withheld points are flagged as deleted.
    """
    if not points.is_withheld.any():
        return xyz, points.classes
    return xyz[~points.is_withheld], points.classes[~points.is_withheld]


def log_withheld(count: int, path: str | Path) -> None:
    """Log once how many points of a file were left out as withheld.

    By the chunk, a tile of a country would take a thousand lines.
    """
    if count:
        warnings.warn(
            f"{path}: {count_things(count, 'point')} flagged as withheld left out", InputWarning
        )
