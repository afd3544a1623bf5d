"""Hold the points of a large roof, sorted so that a window on it costs what the window holds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from .plan import Plan
from .scene import Scene


class Box(NamedTuple):
    """An upright box in the plan's axes, from u0 to u1 and from v0 to v1 (m)."""

    u0: float
    u1: float
    v0: float
    v1: float

    def split(self, axis: int, place: float) -> tuple[Box, Box]:
        """Cut the box in two at a `place` of an axis (0 for u, 1 for v)."""
        if axis == 0:
            return self._replace(u1=place), self._replace(u0=place)
        return self._replace(v1=place), self._replace(v0=place)


def clip_to_box(geometry: shapely.Geometry, box: Box) -> shapely.Geometry:
    """Return the part of a geometry inside a box."""
    return shapely.clip_by_rect(geometry, box.u0, box.v0, box.u1, box.v1)


class Whole:
    """The points and the outline of a building. A large one is searched block by block.

    `scene` is that of all points. `u`, `v`, `z` (n,) are the points, ascending by u, and `outline`
    is in the plan's axes.
    """

    def __init__(self, scene: Scene, plan: Plan, outline: shapely.Polygon):
        self.scene, self.plan = scene, plan
        order = scene.order[0, 0]
        order = order[order < scene.n]
        self.u, self.v, self.z = scene.U[0][order], scene.V[0][order], scene.z[order]
        self.outline = shapely.transform(outline, plan.frame.uv_plan)
        u0, v0, u1, v1 = self.outline.bounds
        self.box, self.area = Box(u0, u1, v0, v1), outline.area

    def find_points(self, box: Box) -> np.ndarray:
        """Return the numbers (m,) of the points in a box, among those sorted by u."""
        first, last = np.searchsorted(self.u, box.u0), np.searchsorted(self.u, box.u1, side="right")
        v = self.v[first:last]
        return first + np.flatnonzero((v >= box.v0) & (v <= box.v1))
