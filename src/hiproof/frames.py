"""The only place that shifts coordinates: a local origin per building, so that all geometry runs on small float64."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class LocalFrame:
    """A frame with the world's axes and its origin at `origin` (3,), in metres of the world frame (the paper's T_G).

    >>> frame = LocalFrame.around(np.array([[85000.0, 446000.0, 3.0], [85002.0, 446002.0, 5.0]]))
    >>> frame.to_local(np.array([[85001.0, 446001.0, 4.0]])).tolist()
    [[0.0, 0.0, 0.0]]
    """

    origin: np.ndarray

    @classmethod
    def around(cls, points_world: np.ndarray) -> "LocalFrame":
        """Frame at the centroid of `points_world` (n, 3), rounded to the millimetre so that it writes out exactly."""
        return cls(np.round(np.asarray(points_world, float)[:, :3].mean(axis=0), 3))

    def to_local(self, world: np.ndarray) -> np.ndarray:
        """Shift (n, 2) or (n, 3) world coordinates into this frame."""
        world = np.asarray(world, float)
        return world - self.origin[: world.shape[-1]]

    def to_world(self, local: np.ndarray) -> np.ndarray:
        """Shift (n, 2) or (n, 3) local coordinates back to the world."""
        local = np.asarray(local, float)
        return local + self.origin[: local.shape[-1]]
