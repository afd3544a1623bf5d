"""Scanner settings at random, for labelled buildings without end."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from .scanner import ScanSettings
from .scene import Defects


def random_settings(
    rng: np.random.Generator,
    area_m2: float,
    density: tuple[float, float],
    n_points: tuple[int, int],
    defects: Defects | None,
) -> ScanSettings:
    """Draw scanner settings for about `n_points` on `area_m2`, within `density`."""
    smallest = min(max(density[0], n_points[0] / area_m2), density[1])
    largest = max(min(density[1], 1.2 * n_points[1] / area_m2), smallest)
    logarithm, range_noise, horizontal, beam, angle, margin = rng.random(6)
    return replace(
        ScanSettings(),
        density=math.exp(math.log(smallest) + logarithm * (math.log(largest) - math.log(smallest))),
        range_noise_m=0.01 + 0.05 * range_noise,
        horizontal_noise_m=0.01 + 0.14 * horizontal**2,
        beam_radius_m=0.25 * beam,
        max_scan_angle_deg=5.0 + 22.0 * angle,
        margin_m=2.0 * margin**2,
        defects=Defects() if defects is None else defects,
    )
