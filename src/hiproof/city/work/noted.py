"""The places of each file's points, noted when the file is read whole.

Whoever needs those of some buildings later (a run with other overrides, the page of `hiproof edit`)
decodes the runs near them alone.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from ...read.points.runs import RunIndex, make_index
from ...write.files import atomic_file

NOTED_FOLDER = "noted"


def noted_file(state: Path, number: int) -> Path:
    """Return where the runs of point file `number` are noted.

    The run's state is in `state`.
    """
    return state / NOTED_FOLDER / f"{number}.npz"


def save_run_boxes(path: Path, boxes: list[np.ndarray], points: int) -> None:
    """Note where the runs of a file of so many `points` lie.

    `boxes` are arrays (k, 4) one after the other.
    """
    with atomic_file(path) as file:
        np.savez(file, boxes=np.concatenate([np.zeros((0, 4)), *boxes]), points=np.int64(points))


def load_run_boxes(path: Path, points: int) -> RunIndex | None:
    """Load the note of a file that has so many `points`, None without a usable one."""
    try:
        with np.load(path, allow_pickle=False) as arrays:
            boxes, noted_points = arrays["boxes"], int(arrays["points"])
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile):
        return None
    return make_index(boxes, points) if noted_points == points else None
