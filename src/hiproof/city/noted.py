"""Where the points of each file of a run lie, noted when it is read from end to end: whoever asks
for those of some buildings later (a run with other overrides, the page of `hiproof edit`) decodes
the runs near them alone.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from ..read.runs import RunIndex, make_index
from ..write.files import atomic_file

NOTED_FOLDER = "noted"


def noted_file(state: Path, number: int) -> Path:
    """Where it is noted of point file `number` of the run whose state is in `state`."""
    return state / NOTED_FOLDER / f"{number}.npz"


def save_run_boxes(path: Path, boxes: list[np.ndarray], points: int) -> None:
    """Note of a file of so many `points` where its runs lie: `boxes`, arrays (k, 4) one after the
    other.
    """
    with atomic_file(path) as file:
        np.savez(file, boxes=np.concatenate([np.zeros((0, 4)), *boxes]), points=np.int64(points))


def load_run_boxes(path: Path, points: int) -> RunIndex | None:
    """What was noted of a file that has so many `points`, None where nothing usable was."""
    try:
        with np.load(path, allow_pickle=False) as arrays:
            boxes, noted_points = arrays["boxes"], int(arrays["points"])
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile):
        return None
    return make_index(boxes, points) if noted_points == points else None
