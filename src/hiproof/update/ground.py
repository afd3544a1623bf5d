"""The ground under an earlier roof: a plane where the model meets a slope."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

import numpy as np

from ..model import Building


class Ground:
    """The ground under a roof, in the roof's frame.

    It is `lowest` (m) everywhere, or a plane through the terrain's lines (m, 3) that `read_lines`
    gives, within their heights. They are read when a height is first asked for.
    """

    def __init__(
        self, lowest: float, read_lines: Callable[[], Sequence[np.ndarray]] = tuple
    ) -> None:
        self.lowest, self.read_lines = lowest, read_lines

    @staticmethod
    def under(building: Building) -> Ground:
        """Return the ground under a building with a model."""
        lines, frame = building.terrain_intersection, building.roof.frame
        return Ground(building.local_ground, lambda: [frame.to_local(line) for line in lines])

    @functools.cached_property
    def plane(self) -> tuple[np.ndarray, float, float]:
        """The plane (3,), and the lowest and the highest height."""
        lines = self.read_lines()
        if not lines:
            return np.array([0.0, 0.0, self.lowest]), self.lowest, self.lowest
        x, y, z = np.concatenate(lines).T
        design = np.column_stack([x, y, np.ones(len(x))])
        return np.linalg.lstsq(design, z, rcond=None)[0], float(z.min()), float(z.max())

    def height_at(self, xy: np.ndarray) -> np.ndarray:
        """Return the height (n,) at `xy` (n, 2 or 3)."""
        plane, low, high = self.plane
        return np.asarray(np.clip(xy[:, :2] @ plane[:2] + plane[2], low, high))
