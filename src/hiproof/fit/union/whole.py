"""Hold the points of a large roof, sorted so that a window on it costs what the window holds."""

from __future__ import annotations

import numpy as np
import shapely

from .box import Box, measure_box
from .plan import Plan
from .scene import Scene


class Whole:
    """The points and the outline of one large building while its blocks are searched.

    `scene` is that of all points. `u`, `v`, `z` (n,) are the points, ascending by u, and `outline`
    is in the plan's axes.
    """

    def __init__(self, scene: Scene, plan: Plan, outline: shapely.Polygon):
        self.scene, self.plan = scene, plan
        order = scene.order[0, 0]
        order = order[order < scene.n]
        self.u, self.v, self.z = scene.U[0][order], scene.V[0][order], scene.z[order]
        self.outline = shapely.transform(
            outline, lambda xy: (xy - plan.frame.origin[:2]) @ plan.frame.rotation.T
        )
        self.box, self.area = measure_box(self.outline), outline.area

    def find_points(self, box: Box) -> np.ndarray:
        """Return the numbers (m,) of the points in a box, among those sorted by u."""
        first, last = np.searchsorted(self.u, box.u0), np.searchsorted(self.u, box.u1, side="right")
        v = self.v[first:last]
        return first + np.flatnonzero((v >= box.v0) & (v <= box.v1))
