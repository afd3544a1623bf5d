"""First outlines: the points' alpha shape, pushed out by half their spacing.

There is one with few corners, one with more and one with many.

Places in it without points, 4 m2 or more, are courts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely

from ...geometry.alpha_shape import SPACINGS, alpha_shape, default_radius
from ..walls import on_walls
from .lines import BACK, SHARPEST, find_corners, make_lines

# points for each of the roof, beyond which walls below wide eaves, as drones see them, would make
# the spacing half the roof's; airborne scans have fewer, and all that is told in spacings was
# chosen by those
MOST_A_ROOF_POINT = 1.5
NARROWER = 0.8  # of the usual radius of alpha shapes: bays of two spacings stay open
# spacings of points: bays closed, outline pushed out since a wall stands beyond its outermost
# points
CLOSING_SPACINGS, PUSH_SPACINGS = 1.0, 0.5
# spacings of points within which corners are dropped: few are left, more, and many
SIMPLIFY_SPACINGS = (0.7, 0.4, 0.2)
# m; closer points drop corners like those: of twice as many no drawing gets better, all take longer
LEAST_SPACING_M = 0.35
COARSER, RADII_TRIED = 1.3, 12  # factor between tries at few corners, and how many tries
LEAST_COURT_M2 = 4.0  # m2; a smaller hole is a gap between points, not a court
MOST_CORNERS = 90  # to begin with; the time grows with the square of them


class Rough(NamedTuple):
    """The rings from which an outline is drawn.

    `rings` are that of the outline, then of each court in it: corners (n, 2) to begin with, few,
    more and many, no two neighbouring sides parallel. The outline's run counter-clockwise, courts'
    clockwise. `spacing` (m) is that of the points, `shape` their alpha shape.
    """

    rings: list[list[np.ndarray]]
    spacing: float
    shape: shapely.Polygon


def rough_outline(points: np.ndarray) -> Rough:
    """Return the rings from which `points` (m, 2 or 3) are drawn.

    Raises FitError for points that span no area.
    """
    xy = points[:, :2]
    radius = default_radius(xy)
    thinner = math.sqrt(len(xy) / telling_count(points, radius / SPACINGS))
    shape = with_large_holes(alpha_shape(xy, NARROWER * thinner * radius, holes=True))
    spacing = thinner * math.sqrt(shape.area / len(xy))
    closed = shapely.buffer(shape, CLOSING_SPACINGS * spacing, join_style="mitre")
    pushed = shapely.buffer(
        closed, (PUSH_SPACINGS - CLOSING_SPACINGS) * spacing, join_style="mitre"
    )
    pushed = with_large_holes(largest(pushed))
    filled = [
        from_farthest_corner(shapely.Polygon(ring)) for ring in (pushed.exterior, *pushed.interiors)
    ]
    unit = max(spacing, LEAST_SPACING_M)
    rings = [
        [simplify_corners(ring, spacings * unit) for spacings in SIMPLIFY_SPACINGS]
        for ring in filled
    ]
    return Rough(
        rings[:1] + [[corners[::-1].copy() for corners in court] for court in rings[1:]],
        spacing,
        shape,
    )


def telling_count(points: np.ndarray, spacing: float) -> int:
    """Return how many of `points` show their `spacing` (m).

    They are (m, 2 or 3). It is all or, where many stand one over another on walls, those of the
    roof.
    """
    if points.shape[1] < 3 or len(points) < 3:
        return max(len(points), 1)
    roof = int((~on_walls(points, points, spacing)).sum())
    return roof if 0 < MOST_A_ROOF_POINT * roof < len(points) else len(points)


def with_large_holes(polygon: shapely.Polygon) -> shapely.Polygon:
    holes = [ring for ring in polygon.interiors if shapely.Polygon(ring).area >= LEAST_COURT_M2]
    return shapely.Polygon(polygon.exterior, holes)


def simplify_corners(polygon: shapely.Polygon, tolerance_m: float) -> np.ndarray:
    """Return the corners less those near a straight line.

    Near is within `tolerance_m`, and more where they are too many.
    """
    for k in range(RADII_TRIED):
        simple = largest(shapely.simplify(polygon, tolerance_m * COARSER**k))
        corners = without_straight_corners(counter_clockwise(simple))
        if 3 < len(corners) <= MOST_CORNERS and find_corners(
            make_lines(corners), np.empty_like(corners), -1
        ):
            return corners
    return counter_clockwise(shapely.minimum_rotated_rectangle(polygon))


def from_farthest_corner(polygon: shapely.Polygon) -> shapely.Polygon:
    """Return the polygon without holes, its farthest corner first.

    That corner is farthest from its middle, however the polygon is turned: what is simplified keeps
    its first corner.
    """
    ring = counter_clockwise(polygon)
    first = int(np.argmax(np.hypot(*(ring - shapely.get_coordinates(polygon.centroid)).T)))
    return shapely.Polygon(np.roll(ring, -first, axis=0))


def largest(geometry: shapely.Geometry) -> shapely.Polygon:
    return max(shapely.get_parts(geometry), key=lambda part: part.area)


def counter_clockwise(polygon: shapely.Polygon) -> np.ndarray:
    return shapely.get_coordinates(shapely.geometry.polygon.orient(polygon).exterior)[:-1]


def without_straight_corners(corners: np.ndarray) -> np.ndarray:
    """Drop corners at which the outline goes straight on, or back.

    The straightest go first.
    """
    while len(corners) > 4:
        azimuth = make_lines(corners)[:, 0]
        turn = azimuth - np.roll(azimuth, 1)
        bend = np.where(np.cos(turn) < BACK, 0.0, np.abs(np.sin(turn)))
        if bend.min() > SHARPEST + 0.02:
            break
        corners = np.delete(corners, bend.argmin(), axis=0)
    return corners
