"""False alarms controlled over all buildings of an update.

The method is that of Benjamini and Hochberg (1995).

Every building is judged once before any is changed, since the largest chance that makes a change
depends on the chances of all. The tiles then judge by it: no building's answer depends on them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..city.plan.work_plan import WorkPlan
from .tile import judge_tile


def find_largest_chance(chances: np.ndarray, significance: float) -> float:
    """Return the chance (exclusive) below which a building counts as changed.

    `chances` (n,) bound the probabilities that the buildings look like this unchanged. Of the
    buildings called changed, a share of `significance` at most is expected to be unchanged.

    >>> find_largest_chance(np.array([0.001, 0.02, 0.9, 0.8]), 0.05)
    0.025
    >>> find_largest_chance(np.array([0.9, 0.8]), 0.05)
    0.025
    """
    if not len(chances):
        return significance
    ranks = np.arange(1, len(chances) + 1)
    below = ranks[np.sort(chances) < ranks * significance / len(chances)]
    return float(below.max(initial=1) * significance / len(chances))


def judge_city(state: Path, plan: WorkPlan, terrain: str | None, executor: Any) -> np.ndarray:
    """Return the chances (n,) of all buildings that were tested, tile by tile.

    The surveys in the folder `state` say what a tile is judged by.
    """
    tasks = ((str(state.absolute()), tile, terrain) for tile in plan.tiles)
    chances: list[float] = []
    for _, found, error in executor.run(judge_tile, tasks):
        if error is not None:
            raise error
        chances += found
    return np.array(chances)
