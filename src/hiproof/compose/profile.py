"""Heights of the terrain along an outline, from its terrain lines."""

from __future__ import annotations

import math

import numpy as np
import shapely

SPACING_M = 1.0  # between samples along a wall; the lines have a vertex at least as often
# m; a wall's foot follows the terrain so closely. Ground points are no more accurate.
FOOT_TOLERANCE_M = 0.05


class Profile:
    """The heights along closed `lines` (m, 3)."""

    def __init__(self, lines: tuple[np.ndarray, ...]) -> None:
        self.lines = lines
        self.plans = np.array([shapely.linestrings(line[:, :2]) for line in lines])
        self.lengths = [
            np.append(0.0, np.hypot(*np.diff(line[:, :2], axis=0).T).cumsum()) for line in lines
        ]

    def height_at(self, xy: np.ndarray) -> np.ndarray:
        """Return the height (n,) of the nearest place on the lines at `xy` (n, 2)."""
        points = shapely.points(xy)
        nearest = shapely.distance(points[:, None], self.plans[None]).argmin(axis=1)
        along = shapely.line_locate_point(self.plans[nearest], points)
        return np.array(
            [
                np.interp(at, self.lengths[k], self.lines[k][:, 2])
                for k, at in zip(nearest, along, strict=True)
            ]
        )

    def place_knots(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return places (k, 2) between two ends of a wall where its foot bends.

        They are the same from either end.
        """
        if tuple(end) < tuple(start):
            start, end = end, start
        count = math.ceil(math.dist(start, end) / SPACING_M)
        share = np.linspace(0.0, 1.0, count + 1)
        xy = start + share[:, None] * (end - start)
        bends = find_bends(share, self.height_at(xy), FOOT_TOLERANCE_M)
        return xy[bends]


def find_bends(t: np.ndarray, z: np.ndarray, tolerance: float) -> list[int]:
    """Return the samples at which a profile bends (Douglas and Peucker).

    Profiles of heights `z` (n,) at `t` (n,) stay within `tolerance` of the line through their ends
    and bends.

    >>> find_bends(np.arange(4.0), np.array([0.0, 0.0, 0.0, 3.0]), 0.05)
    [2]
    """
    off = np.abs(z - np.interp(t, t[[0, -1]], z[[0, -1]]))
    worst = int(off.argmax())
    if off[worst] <= tolerance:
        return []
    before = find_bends(t[: worst + 1], z[: worst + 1], tolerance)
    after = find_bends(t[worst:], z[worst:], tolerance)
    return [*before, worst, *(worst + bend for bend in after)]
