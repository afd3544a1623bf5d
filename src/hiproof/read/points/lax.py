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
from ...frames import Box
from ..remote import is_url
from .las import read_checked_facts
from .runs import RunIndex


def read_lax(path: str | Path) -> RunIndex | None:
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
    min_x, max_x, min_y, max_y = words[9:13].view("<f4")
    boxes, cell_of, runs, indexed_points, position = [], [], [], 0, 16
    for cell in range(int(words[15])):
        index, count, fixed = (int(word) for word in words[position : position + 3])
        intervals = words[position + 3 : position + 3 + 2 * count].reshape(count, 2)
        boxes.append(cell_box(index, (min_x, min_y, max_x, max_y)))
        cell_of.append(np.full(count, cell))
        runs.append(intervals.astype(np.int64) + [0, 1])
        indexed_points, position = indexed_points + fixed, position + 3 + 2 * count
    if not boxes:
        raise ValueError("it has no cells")
    return RunIndex(np.array(boxes), np.concatenate(cell_of), np.concatenate(runs)), indexed_points


def cell_box(index: int, root: tuple[np.float32, ...]) -> Box:
    """Return a cell's box, halved in float32 as the writer does, and that much wider."""
    level = 0
    while index >= 4**level:
        index -= 4**level
        level += 1
    lower, upper = list(root[:2]), list(root[2:])
    for step in range(level - 1, -1, -1):
        for axis in (0, 1):
            middle = (lower[axis] + upper[axis]) / np.float32(2)
            (lower if index >> 2 * step & 1 + axis else upper)[axis] = middle
    blur = 2 * float(np.spacing(np.abs(np.array(root)).max()))
    return (
        float(lower[0]) - blur,
        float(lower[1]) - blur,
        float(upper[0]) + blur,
        float(upper[1]) + blur,
    )
