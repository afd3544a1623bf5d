"""The terrain under a simulated scene: a sloping plane, or endless hills."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .raycast import cast_waves


@dataclass(frozen=True)
class Plane:
    """Terrain z = a x + b y + c."""

    a: float = 0.0
    b: float = 0.0
    c: float = 0.0

    def height_at(self, xy: np.ndarray) -> np.ndarray:
        return xy @ (self.a, self.b) + self.c

    def hit(self, xy0: np.ndarray, slope: np.ndarray) -> np.ndarray:
        """Return the height (n,) where beams p(z) = xy0 + slope z meet the terrain."""
        return self.height_at(xy0) / (1.0 - slope @ (self.a, self.b))


@dataclass(frozen=True)
class Relief:
    """Hills: plane `waves` (w, 4) = (kx, ky, phase, amplitude (m)) on `base`, by `origin`."""

    waves: np.ndarray
    base: float
    origin: np.ndarray

    @classmethod
    def random(cls, rng: np.random.Generator, base: float, origin: np.ndarray) -> Relief:
        """Draw waves of 140 to 1500 m whose slopes together stay under about eight percent."""
        length = np.array([1500.0, 800.0, 420.0, 230.0, 140.0])
        direction, phase = rng.uniform(0.0, 2 * np.pi, (2, len(length)))
        k = 2 * np.pi / length
        amplitude = np.array([0.014, 0.016, 0.016, 0.014, 0.010]) / k
        waves = np.column_stack([k * np.cos(direction), k * np.sin(direction), phase, amplitude])
        return cls(waves, base, np.asarray(origin, float))

    def height_at(self, xy: np.ndarray) -> np.ndarray:
        """Return the terrain height (n,) at `xy` (n, 2)."""
        x, y = (np.asarray(xy, float) - self.origin).T
        return self.base + sum(
            amplitude * np.sin(kx * x + ky * y + phase) for kx, ky, phase, amplitude in self.waves
        )

    def move(self, shift: np.ndarray) -> Relief:
        """Return the same terrain in a frame whose points are these plus `shift` (3,)."""
        return Relief(self.waves, self.base + float(shift[2]), self.origin + shift[:2])

    def hit(self, xy0: np.ndarray, slope: np.ndarray) -> np.ndarray:
        """Return the height (n,) where beams p(z) = xy0 + slope z meet the terrain."""
        return cast_waves(xy0 - self.origin, slope, self.waves, self.base)
