"""What the shapes' own draws share: slopes and plans as real roofs have them."""

from __future__ import annotations

import math

import numpy as np


def drawn_slope(rng: np.random.Generator, low_deg: float, high_deg: float) -> float:
    """Draw a slope (rise by run) whose angle lies between two, in degrees."""
    return math.tan(math.radians(rng.uniform(low_deg, high_deg)))


def drawn_plan(
    rng: np.random.Generator, width: float, lower: float = 1.05, upper: float = 2.2
) -> dict[str, float]:
    """Draw a plan of that width (m), `lower` to `upper` times as long."""
    return {"width": width, "length": width * float(rng.uniform(lower, upper))}
