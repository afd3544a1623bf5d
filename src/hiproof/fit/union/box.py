"""Describe upright boxes in the plan's axes.

Windows and blocks are such boxes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely


class Box(NamedTuple):
    """A box from u0 to u1 and from v0 to v1 (m)."""

    u0: float
    u1: float
    v0: float
    v1: float

    def split(self, axis: int, place: float) -> tuple[Box, Box]:
        """Cut the box in two at a `place` of an axis (0 for u, 1 for v)."""
        if axis == 0:
            return self._replace(u1=place), self._replace(u0=place)
        return self._replace(v1=place), self._replace(v0=place)


EMPTY_BOX = Box(np.inf, -np.inf, np.inf, -np.inf)  # The box of nothing.


def clip_to_box(geometry: shapely.Geometry, box: Box) -> shapely.Geometry:
    """Return the part of a geometry inside a box."""
    return shapely.clip_by_rect(geometry, box.u0, box.v0, box.u1, box.v1)


def measure_box(geometry: shapely.Geometry) -> Box:
    """Return the box around a geometry, EMPTY_BOX around an empty one."""
    if geometry.is_empty:
        return EMPTY_BOX
    u0, v0, u1, v1 = geometry.bounds
    return Box(u0, u1, v0, v1)
