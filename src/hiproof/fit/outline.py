"""The outline of a building without a footprint, from the plan positions of its points."""

from __future__ import annotations

import numpy as np
import shapely

from .alpha_shape import alpha_shape, default_radius

CLOSING_SPACINGS = 1.0
SIMPLIFY_SPACINGS = 0.6


def estimate_outline(xy: np.ndarray) -> shapely.Polygon:
    """Outline (a polygon without holes) of points `xy` (n, 2) in metres.

    The alpha shape runs through the outermost points, on average half a spacing inside the true edge: its edges are
    pushed out by that much. Raises FitError for points that span no area.
    """
    xy = np.asarray(xy, float)
    shape = alpha_shape(xy, 1.2 * default_radius(xy))
    spacing = float(np.sqrt(shape.area / max(len(xy), 1)))
    shape = shapely.buffer(shape, CLOSING_SPACINGS * spacing, join_style="mitre")
    shape = shapely.buffer(shape, (0.5 - CLOSING_SPACINGS) * spacing, join_style="mitre")
    shape = shapely.simplify(max(shapely.get_parts(shape), key=lambda part: part.area), SIMPLIFY_SPACINGS * spacing)
    return shapely.Polygon(shape.exterior)
