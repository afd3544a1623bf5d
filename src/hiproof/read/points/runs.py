"""The runs of a file's points that lie in given boxes.

The rest of the file need not be decoded.

They come from an index beside the file (lax.py), or were noted while the file was read from end to
end: airborne scanners leave points in the order of their flight, so that neighbours in a file are
neighbours on the ground.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely

# LAZ is decoded by chunks of so many: skipping less costs as much as reading on
RUN_POINTS = 50_000


@dataclass(frozen=True)
class RunIndex:
    """The `runs` (r, 2), [first, end), of points that lie in `boxes` (r, 4)."""

    boxes: np.ndarray
    runs: np.ndarray

    def find_runs(self, boxes: np.ndarray) -> np.ndarray:
        """Return ascending runs (k, 2) with all points, and others, inside `boxes` (m, 4)."""
        tree = shapely.STRtree(shapely.box(*self.boxes.T))
        return join_runs(self.runs[np.unique(tree.query(shapely.box(*boxes.T))[1])])


def join_runs(runs: np.ndarray) -> np.ndarray:
    """Join ascending runs (k, 2) that overlap or are less than RUN_POINTS apart."""
    if not len(runs):
        return runs
    runs = runs[np.argsort(runs[:, 0], kind="stable")]
    reached = np.maximum.accumulate(runs[:, 1])
    first = np.flatnonzero(np.r_[True, runs[1:, 0] - reached[:-1] >= RUN_POINTS])
    return np.column_stack([runs[first, 0], np.maximum.reduceat(runs[:, 1], first)])


def compute_run_boxes(xyz: np.ndarray) -> np.ndarray:
    """Return plan boxes (k, 4) of every RUN_POINTS of the points (n, 3).

    Points are in their order in the file.

    >>> compute_run_boxes(np.array([[3.0, 4.0, 0.0], [1.0, 9.0, 0.0]])).tolist()
    [[1.0, 4.0, 3.0, 9.0]]
    """
    starts = np.arange(0, len(xyz), RUN_POINTS)
    lower, upper = (
        reduced.reduceat(xyz[:, :2], starts, axis=0) for reduced in (np.minimum, np.maximum)
    )
    return np.hstack([lower, upper])


def make_index(boxes: np.ndarray, points: int) -> RunIndex | None:
    """Make the index of runs of RUN_POINTS in `boxes` (k, 4); None if their numbers differ."""
    if not len(boxes) == math.ceil(points / RUN_POINTS) > 0:
        return None
    first = np.arange(len(boxes)) * RUN_POINTS
    return RunIndex(boxes, np.column_stack([first, np.minimum(first + RUN_POINTS, points)]))
