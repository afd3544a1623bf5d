"""Describe upright boxes in the plan's axes.

Windows, blocks and the extents of volumes are such boxes.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import shapely

# What lies inside a box may reach so far (m) beyond it: what hides an edge is no nearer.
BOX_SLACK_M = 0.3


class Box(NamedTuple):
    """A box from u0 to u1 and from v0 to v1 (m)."""

    u0: float
    u1: float
    v0: float
    v1: float

    @property
    def area(self) -> float:
        return (self.u1 - self.u0) * (self.v1 - self.v0)

    def widen(self, by_m: float) -> Box:
        """Move every side out by `by_m`."""
        return Box(self.u0 - by_m, self.u1 + by_m, self.v0 - by_m, self.v1 + by_m)

    def contains(self, other: Box) -> bool:
        """Return whether another box lies inside this one, but for BOX_SLACK_M."""
        return (
            other.u0 >= self.u0 - BOX_SLACK_M
            and other.u1 <= self.u1 + BOX_SLACK_M
            and other.v0 >= self.v0 - BOX_SLACK_M
            and other.v1 <= self.v1 + BOX_SLACK_M
        )

    def overlaps(self, other: Box) -> bool:
        return (
            self.u0 < other.u1 and self.u1 > other.u0 and self.v0 < other.v1 and self.v1 > other.v0
        )

    def find_inside(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return which of the places u, v (n,) lie in the box (n,)."""
        return (self.u0 <= u) & (u <= self.u1) & (self.v0 <= v) & (v <= self.v1)

    def split(self, axis: int, place: float) -> tuple[Box, Box]:
        """Cut the box in two at a `place` of an axis (0 for u, 1 for v)."""
        if axis == 0:
            return self._replace(u1=place), self._replace(u0=place)
        return self._replace(v1=place), self._replace(v0=place)


EMPTY_BOX = Box(np.inf, -np.inf, np.inf, -np.inf)  # The box of nothing.


def enclose_boxes(boxes: Iterable[Box]) -> Box:
    """Return the smallest box around several."""
    limits = np.array(list(boxes))
    return Box(
        float(limits[:, 0].min()),
        float(limits[:, 1].max()),
        float(limits[:, 2].min()),
        float(limits[:, 3].max()),
    )


def clip_to_box(geometry: shapely.Geometry, box: Box) -> shapely.Geometry:
    """Return the part of a geometry inside a box."""
    return shapely.clip_by_rect(geometry, box.u0, box.v0, box.u1, box.v1)


def measure_box(geometry: shapely.Geometry) -> Box:
    """Return the box around a geometry, EMPTY_BOX around an empty one."""
    if geometry.is_empty:
        return EMPTY_BOX
    u0, v0, u1, v1 = geometry.bounds
    return Box(u0, u1, v0, v1)
