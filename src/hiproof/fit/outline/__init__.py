"""The outline of a building without a footprint, from the plan positions of its points, as a draughtsman would draw it.

rough   the points' alpha shape, pushed out and with few corners
lines   a polygon as the lines of its sides
cost    how well an outline explains where points are and are not, and what its lines cost
moves   lines dropped, joined, turned into common directions and moved until nothing is gained
settle  each side to the place that the points across it give it, without the bias of outermost points
"""

from __future__ import annotations

import math

import numpy as np
import shapely

from ..direction import outline_direction
from .cost import Border, drawing_of
from .lines import find_corners, lines_through, quarter_gap
from .moves import redrawn
from .rough import rough_outline
from .settle import settled

__all__ = ["estimate_outline", "iou"]

# m over which a side is soft: the scanner's noise in plan; density outside over that inside: points of walls and trees
BLUR_M, STRAY = 0.15, math.exp(-4.0)
LINE, DIRECTION, SKEW = 2.5, 3.0, 1.0  # prices in nats
MOST_DENSE = (
    8.0  # points a square metre; of more only every second, third, ... bears on what is drawn: no finer for them
)
REACH_M, REACH_SPACINGS = 2.0, 3.0  # of points that bear on the border
SAME_DIRECTION_RAD = math.radians(1.5)  # rad; within it the direction of slopes and that of the outline are one
STEP_SPACINGS = 0.2  # spacings of points that lines are moved by first


def estimate_outline(xy: np.ndarray, kappa: float | None = None) -> shapely.Polygon:
    """Outline (a polygon without holes) of points `xy` (n, 2) in metres, mostly along `kappa` (rad) and across.

    Where the rough outline has another main direction, that is tried too, and the cheaper drawing taken; without `kappa` it
    is the only one. Raises FitError for points that span no area.

    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0.25, 12, 0.5), np.arange(0.25, 7, 0.5)))
    >>> outline = estimate_outline(np.column_stack([x, y]))
    >>> len(outline.exterior.coords) - 1, bool(abs(outline.area - 84) < 4)
    (4, True)
    """
    xy = np.asarray(xy, float)
    corners, spacing = rough_outline(xy)
    rough = shapely.Polygon(corners)
    density = len(xy) / rough.area
    near = xy[shapely.distance(shapely.points(xy), rough.exterior) < max(REACH_M, REACH_SPACINGS * spacing)]
    few = near[:: math.ceil(density / MOST_DENSE)]
    x, y = np.ascontiguousarray(few.T)
    border = Border(x, y, density * len(few) / len(near), BLUR_M, STRAY, LINE, DIRECTION, SKEW)
    own = outline_direction(rough)
    directions = [own] if kappa is None else [kappa]
    if kappa is not None and abs(quarter_gap(kappa - own)) > SAME_DIRECTION_RAD:
        directions.append(own)
    lines = lines_through(corners)
    drawings = [redrawn(drawing_of(lines, angle, border), border, STEP_SPACINGS * spacing) for angle in directions]
    best = min(drawings, key=lambda drawing: drawing.cost)
    place = settled(best.lines, near, density)
    corners = np.empty_like(place)
    find_corners(place, corners)
    return shapely.Polygon(corners)
