"""The ground under an earlier roof: a plane where the model meets a slope."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..frames import LocalFrame
from ..model import Building


@dataclass(frozen=True)
class Ground:
    """The ground under a roof, in the roof's frame.

    It is the `plane` (3,) within the heights `low` and `high` (m).
    """

    plane: np.ndarray
    low: float
    high: float

    @staticmethod
    def under(building: Building, frame: LocalFrame) -> Ground:
        """Return the plane through a building's lines on the terrain, or its level ground."""
        if not building.terrain_intersection:
            level = building.z_ground - frame.origin[2]
            return Ground(np.array([0.0, 0.0, level]), level, level)
        x, y, z = frame.to_local(np.concatenate(building.terrain_intersection)).T
        design = np.column_stack([x, y, np.ones(len(x))])
        return Ground(np.linalg.lstsq(design, z, rcond=None)[0], float(z.min()), float(z.max()))

    def height_at(self, xy: np.ndarray) -> np.ndarray:
        """Return the height (n,) at `xy` (n, 2 or 3)."""
        return np.asarray(np.clip(xy[:, :2] @ self.plane[:2] + self.plane[2], self.low, self.high))
