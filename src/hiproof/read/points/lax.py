"""The spatial index that LAStools writes beside a LAS or LAZ file.

A `.lax` file is a quadtree whose cells name runs of points.

All of the file are little-endian words of four bytes: "LASX" and a version; "LASS" and a type (0:
quadtree); "LASQ", a version, levels, level_index, implicit_levels (0 here), min_x, max_x, min_y,
max_y as float32; "LASV", a version, the number of cells, and for each its index, its number of
runs, how many points are in it, and the first and last point of each run. Cells of a level are
numbered after those of all coarser ones, two bits a level (1: upper half in x, 2: in y). A run may
hold points of other cells, too. The layout is that of LASlib's lasindex, lasquadtree and
lasinterval (rapidlasso, open source).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import warn
from ..remote import FilePath, is_url
from .las import read_checked_facts
from .runs import RunIndex


def read_lax(path: FilePath) -> RunIndex | None:
    """Read the index beside the LAS or LAZ file at `path`, None without one.

    One that cannot be understood, or that tells of another number of points than the file, is left
    aside with an InputWarning. Raises InputError where the file's own header cannot be read.
    """
    if is_url(path):
        return None
    lax_path = next(
        (p for p in (Path(path).with_suffix(end) for end in (".lax", ".LAX")) if p.is_file()), None
    )
    if lax_path is None:
        return None
    points = read_checked_facts(path).count
    try:
        index, indexed_points = parse_index(np.fromfile(lax_path, "<u4"))
        if indexed_points != points or index.runs.max(initial=0) > points:
            raise ValueError(f"it tells of {indexed_points} points, the file has {points}")
    except (ValueError, IndexError, OSError) as error:
        warn(lax_path, f"is left aside as an index of {path} ({error}); make it again")
        return None
    return index


def parse_index(words: np.ndarray) -> tuple[RunIndex, int]:
    """Parse the index, and count its cells' points; ValueError or IndexError if it is none."""
    for place, mark in ((0, b"LASX"), (2, b"LASS"), (4, b"LASQ"), (13, b"LASV")):
        if words[place : place + 1].tobytes() != mark:
            raise ValueError(f"expected {mark.decode()} in its word {place}")
    if words[3] or words[7] or words[8] or words[14]:
        raise ValueError("expected a whole quadtree with counts of 32 bits")
    lower, upper = words[9:13].view("<f4").reshape(2, 2).T
    boxes, intervals, indexed_points, position = [], [], 0, 16
    for _ in range(int(words[15])):
        index, count, points = words[position : position + 3].tolist()
        position += 3 + 2 * count
        intervals.append(words[position - 2 * count : position].reshape(count, 2))
        boxes += [cell_box(index, lower, upper)] * count
        indexed_points += points
    if not intervals:
        raise ValueError("it has no cells")
    runs = np.concatenate(intervals).astype(np.int64) + [0, 1]
    return RunIndex(np.reshape(boxes, (-1, 4)), runs), indexed_points


def cell_box(index: int, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Return a cell's box, halved in float32 as the writer does, and that much wider."""
    blur = 2 * float(np.spacing(np.abs([lower, upper]).max()))
    level = 0
    while index >= 4**level:
        index -= 4**level
        level += 1
    for step in range(level - 1, -1, -1):
        middle = (lower + upper) / np.float32(2)
        is_upper = (index >> 2 * step & np.array([1, 2])) > 0
        lower, upper = np.where(is_upper, middle, lower), np.where(is_upper, upper, middle)
    return np.r_[lower.astype(float) - blur, upper.astype(float) + blur]
