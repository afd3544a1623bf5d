"""The outline of a building that comes without one."""

from __future__ import annotations

import math

import numpy as np
import shapely

from ...errors import FitError
from ...model import Fit
from ...settings import Settings
from ..outline import estimate_outline, is_rectangular
from ..single import fit_roof


def outline_of_points(points_local: np.ndarray, settings: Settings) -> shapely.Polygon:
    """Outline around `points_local` (n, 3): the rectangle of one primitive where that is it, else drawn around the points.

    Raises FitError for points that span no area.
    """
    try:
        fit = fit_roof(points_local, settings=settings)
    except FitError:
        return estimate_outline(points_local[:, :2])
    rectangle = plan_rectangle(fit)
    if is_rectangular(rectangle, points_local[:, :2]):
        return rectangle
    return estimate_outline(points_local[:, :2], fit.kappa)


def plan_rectangle(fit: Fit) -> shapely.Polygon:
    """The rectangle that a fitted primitive covers, all its teeth together."""
    half = 0.5 * np.array([fit.parameters["length"], fit.parameters["width"]])
    c, s = math.cos(fit.kappa), math.sin(fit.kappa)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    centre = fit.translation[:2] + fit.global_translation[:2]
    return shapely.Polygon(corners @ np.array([[c, s], [-s, c]]) + centre)
