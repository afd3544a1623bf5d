"""Estimate the outline of a building that comes without one."""

from __future__ import annotations

import numpy as np
import shapely

from ..direction import slope_direction
from ..outline import estimate_outline

SLOPE_PLACES = 150  # Places at which slopes are measured.
SLOPE_NEIGHBOURS = 9  # Points around each of these places.
SURE = 0.5  # Confidence (0 to 1) from which on the direction of slopes is the outline's.


def draw_outline(points_local: np.ndarray) -> shapely.Polygon:
    """Draw an outline around `points_local` (n, 3).

    It mostly follows the roof's slopes and runs across them, if it has any. Raises FitError for
    points that span no area.
    """
    ascending = points_local[np.argsort(points_local[:, 0], kind="stable")]
    kappa, confidence = slope_direction(ascending, SLOPE_PLACES, SLOPE_NEIGHBOURS)
    return estimate_outline(points_local, kappa if confidence > SURE else None)
