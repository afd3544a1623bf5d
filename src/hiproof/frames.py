"""The only place that shifts, turns and scales coordinates.

Files count in the unit of their reference system; `Units` makes them metres where they are read and
the files' own again where they are written. In between, the world is in metres, and each building
has a local origin, so that all geometry runs on small float64; the search for its roof turns that
into the roof's own axes.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

Box = tuple[float, float, float, float]  # xmin, ymin, xmax, ymax


@dataclass(frozen=True)
class Units:
    """Metres in one unit of a file's coordinates, in plan and in height.

    The names of these units come with them.

    >>> feet = Units(0.3048, 0.3048, "foot", "foot")
    >>> feet.to_metres([[10, 20, 30]]).round(4).tolist()
    [[3.048, 6.096, 9.144]]
    >>> str(Units(0.3048, 1.0, "foot", "metre"))
    'foot, heights in metre'
    """

    plan: float = 1.0
    height: float = 1.0
    plan_name: str = "metre"
    height_name: str = "metre"

    @property
    def are_metres(self) -> bool:
        return self.plan == self.height == 1.0

    def to_metres(self, coordinates: ArrayLike) -> np.ndarray:
        """Convert a file's coordinates (n, 2) or (n, 3), or boxes (n, 4), to world metres."""
        coordinates = np.asarray(coordinates, float)
        return coordinates * self.factors(coordinates.shape[-1])

    def from_metres(self, world: np.ndarray) -> np.ndarray:
        """Convert world metres (n, 2), (n, 3) or (n, 4), boxes, to a file's coordinates."""
        world = np.asarray(world, float)
        return world / self.factors(world.shape[-1])

    def factors(self, columns: int) -> np.ndarray:
        """Return what one unit is in metres, by column: places in space have three."""
        return np.array([self.plan, self.plan, self.height] if columns == 3 else [self.plan])

    def __str__(self) -> str:
        return (
            self.plan_name
            if self.plan == self.height
            else f"{self.plan_name}, heights in {self.height_name}"
        )


METRES = Units()


def turn_points(xy: np.ndarray, angle: float) -> np.ndarray:
    """Turn plan points (..., 2) by `angle` (rad) about the origin."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return xy @ np.array([(cosine, sine), (-sine, cosine)])


@dataclass(frozen=True)
class LocalFrame:
    """A frame with the world's axes and its origin at `origin` (3,).

    The origin is in metres of the world frame (the paper's T_G).

    >>> frame = LocalFrame.around(np.array([[85000.0, 446000.0, 3.0], [85002.0, 446002.0, 5.0]]))
    >>> frame.to_local(np.array([[85001.0, 446001.0, 4.0]])).tolist()
    [[0.0, 0.0, 0.0]]
    """

    origin: np.ndarray

    @classmethod
    def around(cls, points_world: np.ndarray) -> "LocalFrame":
        """Return the frame at points' centroid, rounded to the millimetre to write out exactly."""
        return cls(np.round(np.asarray(points_world, float)[:, :3].mean(axis=0), 3))

    def to_local(self, world: np.ndarray) -> np.ndarray:
        """Shift (n, 2) or (n, 3) world coordinates into this frame."""
        world = np.asarray(world, float)
        return world - self.origin[: world.shape[-1]]

    def to_world(self, local: np.ndarray) -> np.ndarray:
        """Shift (n, 2) or (n, 3) local coordinates back to the world."""
        local = np.asarray(local, float)
        return local + self.origin[: local.shape[-1]]


@dataclass(frozen=True)
class PlanFrame:
    """A roof's axes: an origin (3,), a (2, 2) `rotation` with uv = rotation @ (xy - origin)."""

    origin: np.ndarray
    rotation: np.ndarray

    def to_plan(self, xyz_local: np.ndarray) -> np.ndarray:
        """Convert (n, 3) local coordinates to (n, 3) u, v, z."""
        return np.column_stack([self.uv_plan(xyz_local[:, :2]), xyz_local[:, 2] - self.origin[2]])

    def uv_plan(self, xy_local: np.ndarray) -> np.ndarray:
        """Convert (n, 2) local coordinates to (n, 2) plan coordinates."""
        return (xy_local - self.origin[:2]) @ self.rotation.T

    def xy_local(self, uv: np.ndarray) -> np.ndarray:
        """Convert (n, 2) plan coordinates back to local x, y."""
        return uv @ self.rotation + self.origin[:2]
