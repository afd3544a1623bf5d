"""The heights of point files where they meet.

Files are joined as they are. One in another height system or unit puts its buildings elsewhere, and
cuts those at its border in two.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from itertools import chain, combinations
from pathlib import Path

import numpy as np

from ...errors import warn
from ...geometry.thin import thin_to_grid
from ...log import count_things
from .ground import fit_planes
from .sort import load_files

AROUND, AROUND_M = 8, 3.0  # points of one file that give the ground at a place of the other
FEWEST_PLACES, ENOUGH_PLACES = 30, 1000  # that show a step, and after which no more are looked at
STEP_M = 0.5  # between two files: that of strips, seasons and of most work on the ground is less
SPREAD = 0.5  # of a step that is the same everywhere: the middle half of its heights, as a share
APART_M = 10.0  # of that middle half: in feet, steps differ as much as the ground's heights


def warn_of_steps(points: Path, clouds: Sequence[str]) -> None:
    """Warn of point files that lie higher or lower than those which they touch.

    `points` is the folder of sorted points, in which the files of each work tile begin with their
    numbers among the `clouds`.
    """
    steps: dict[tuple[int, int], list[float]] = defaultdict(list)
    for tile in sorted({path.parent for path in points.rglob("*.npz")}):
        numbers = sorted({int(path.name.split("-")[0]) for path in tile.glob("[0-9]*.npz")})
        pairs = [pair for pair in combinations(numbers, 2) if len(steps[pair]) < ENOUGH_PLACES]
        ground = {}
        for number in {*chain(*pairs)}:
            loaded = load_files(sorted(tile.glob(f"{number}-*.npz")), ("ground", "low"))
            has_ground = len(loaded["ground"]) > 0
            ground[number] = thin_to_grid(loaded["ground" if has_ground else "low"], 1.0)
        for first, second in pairs:
            steps[first, second].extend(measure_steps(ground[first], ground[second]))
    for (first, second), heights in steps.items():
        low, step, high = np.quantile(heights or [0.0], (0.25, 0.5, 0.75))
        is_alike = high - low < SPREAD * abs(step) or low > APART_M or high < -APART_M
        if len(heights) >= FEWEST_PLACES and abs(step) > STEP_M and is_alike:
            warn(
                clouds[second],
                f"its ground lies {abs(step):.2f} m {'above' if step > 0 else 'below'} that of "
                f"{clouds[first]}, in {count_things(len(heights), 'place')} where the two "
                "meet, so the heights of one are of another system or unit; bring both to one, or "
                "leave one out",
            )


def measure_steps(first: np.ndarray, second: np.ndarray) -> list[float]:
    """Return how much (k,) higher points (n, 3) lie than planes through those (m, 3) around."""
    from scipy.spatial import KDTree

    index = KDTree(first[:, :2]).query(second[:, :2], AROUND, distance_upper_bound=AROUND_M)[1]
    around = np.vstack([first, np.full(3, np.nan)])[index]
    is_known = np.isfinite(around[:, 2, 2])
    xyz, around = second[is_known], around[is_known]
    return (xyz[:, 2] - fit_planes(xyz[:, :2], around)).tolist() if len(xyz) else []
