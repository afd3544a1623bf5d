"""Where the points of a file lie, run by run: which runs hold the points of some boxes, so that the
rest need not be decoded.

Told by an index that stands beside a file (lax.py), or noted while the file was read from end to
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
    """`boxes` (c, 4) of the cells (xmin, ymin, xmax, ymax);

    `runs` (r, 2) of points, [first, end), of cells `cell_of` (r,).
    """

    boxes: np.ndarray
    cell_of: np.ndarray
    runs: np.ndarray

    def find_runs(self, boxes: np.ndarray) -> np.ndarray:
        """Runs (k, 2) in ascending order that hold every point inside any of `boxes` (m, 4), and
        others.
        """
        cells = shapely.STRtree(shapely.box(*self.boxes.T))
        met = np.zeros(len(self.boxes), bool)
        met[cells.query(shapely.box(*boxes.T))[1]] = True
        return join_runs(self.runs[met[self.cell_of]])


def join_runs(runs: np.ndarray) -> np.ndarray:
    """Runs (k, 2) in ascending order, those that overlap or are less than RUN_POINTS apart made
    one.
    """
    if not len(runs):
        return runs
    runs = runs[np.argsort(runs[:, 0], kind="stable")]
    reached = np.maximum.accumulate(runs[:, 1])
    first = np.flatnonzero(np.r_[True, runs[1:, 0] - reached[:-1] >= RUN_POINTS])
    return np.column_stack([runs[first, 0], np.maximum.reduceat(runs[:, 1], first)])


def compute_run_boxes(xyz: np.ndarray) -> np.ndarray:
    """Boxes (k, 4) in plan of every RUN_POINTS of the points (n, 3), in their order.

    >>> compute_run_boxes(np.array([[3.0, 4.0, 0.0], [1.0, 9.0, 0.0]])).tolist()
    [[1.0, 4.0, 3.0, 9.0]]
    """
    starts = np.arange(0, len(xyz), RUN_POINTS)
    lower, upper = (
        reduced.reduceat(xyz[:, :2], starts, axis=0) for reduced in (np.minimum, np.maximum)
    )
    return np.hstack([lower, upper])


def make_index(boxes: np.ndarray, points: int) -> RunIndex | None:
    """The index of a file of so many `points` whose every RUN_POINTS lie in one of `boxes` (k, 4),
    in their order; None where there are more or fewer boxes than that.
    """
    if not len(boxes) == math.ceil(points / RUN_POINTS) > 0:
        return None
    first = np.arange(len(boxes)) * RUN_POINTS
    return RunIndex(
        boxes,
        np.arange(len(boxes)),
        np.column_stack([first, np.minimum(first + RUN_POINTS, points)]),
    )
