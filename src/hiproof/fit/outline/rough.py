"""A first outline to be redrawn: the points' alpha shape, pushed out by half their spacing, with few corners."""

from __future__ import annotations

import math

import numpy as np
import shapely

from ..alpha_shape import alpha_shape, default_radius
from .lines import SHARPEST, find_corners, lines_through

NARROWER = 0.8  # of the usual radius of alpha shapes: bays of two spacings stay open
# spacings of points: bays closed, outline pushed out since a wall stands beyond its outermost points, corners dropped
CLOSING_SPACINGS, PUSH_SPACINGS, SIMPLIFY_SPACINGS = 1.0, 0.5, 0.7
COARSER, TRIES = 1.3, 12  # factor between tries at few corners, and how many tries
MOST_CORNERS = 90  # to begin with; the time grows with the square of them


def rough_outline(xy: np.ndarray) -> tuple[np.ndarray, float, shapely.Polygon]:
    """Corners (n, 2), counter-clockwise, of a simple polygon about points `xy` (m, 2), no two neighbouring sides parallel;
    the points' spacing (m); and their alpha shape. Raises FitError for points that span no area."""
    shape = alpha_shape(xy, NARROWER * default_radius(xy))
    spacing = math.sqrt(shape.area / len(xy))
    closed = shapely.buffer(shape, CLOSING_SPACINGS * spacing, join_style="mitre")
    closed = largest(shapely.buffer(closed, (PUSH_SPACINGS - CLOSING_SPACINGS) * spacing, join_style="mitre"))
    filled = shapely.Polygon(closed.exterior)
    for k in range(TRIES):
        tolerance = SIMPLIFY_SPACINGS * spacing * COARSER**k
        corners = without_straight_corners(counter_clockwise(largest(shapely.simplify(filled, tolerance))))
        if 3 < len(corners) <= MOST_CORNERS and find_corners(lines_through(corners), np.empty_like(corners)):
            return corners, spacing, shape
    return counter_clockwise(shapely.minimum_rotated_rectangle(filled)), spacing, shape


def largest(geometry: shapely.Geometry) -> shapely.Polygon:
    return max(shapely.get_parts(geometry), key=lambda part: part.area)


def counter_clockwise(polygon: shapely.Polygon) -> np.ndarray:
    return shapely.get_coordinates(shapely.geometry.polygon.orient(polygon).exterior)[:-1]


def without_straight_corners(corners: np.ndarray) -> np.ndarray:
    """The corners less those at which the outline all but goes straight on, or back, the straightest first."""
    while len(corners) > 4:
        azimuth = lines_through(corners)[:, 0]
        bend = np.abs(np.sin(azimuth - np.roll(azimuth, 1)))
        if bend.min() > SHARPEST + 0.02:
            break
        corners = np.delete(corners, bend.argmin(), axis=0)
    return corners
