"""The outline of a building without a footprint, from its points, as a draughtsman would draw it.

rough   the points' alpha shape, pushed out and with few corners
spread  how evenly points are spread, by which prices go
soft    how soft a side is
lines   a polygon as the lines of its sides
cost    how well an outline explains where points are and are not, and what its lines cost
moves   lines dropped, joined, turned into common directions and moved until nothing is gained
steps   bays and notches of a side or of a run of them, wherever points pay for them
settle  each side to the place that the points across it give it, without the bias of outermost points
"""

from __future__ import annotations

import math

import numpy as np
import shapely

from ..direction import main_direction
from ..walls import on_walls
from .cost import Border, Drawing, drawing_of
from .lines import find_corners, lines_through, quarter_gap
from .moves import redrawn
from .rough import rough_outline
from .settle import settled
from .spread import unevenness
from .steps import RUN, stepped

__all__ = ["estimate_outline"]

# m over which a side is soft: the scanner's noise in plan; density outside over that inside: points of walls and trees
BLUR_M, STRAY = 0.15, math.exp(-4.0)
# nats: of a line, of a further direction, of a line in that, of a sharp corner, where points are spread by chance
PRICES = (3.0, 3.0, 1.0, 6.0)
# m from the border of the points' shape within which a wall is an outer one: the scanner's noise, doubled
OUTER_M = 0.25
# points a square metre; of more only every second, third, ... bears on what is drawn: no finer for them
MOST_DENSE = 8.0
SAME_DIRECTION_RAD = math.radians(1.5)  # rad; within it the direction of slopes and that of the outline are one
STEP_SPACINGS = 0.2  # spacings of points that lines are moved by first


def estimate_outline(points: np.ndarray, kappa: float | None = None) -> shapely.Polygon:
    """Outline (a polygon without holes) of `points` (n, 3) or (n, 2) in metres, mostly along `kappa` (rad) and across.

    With heights, points of walls are known, and the outline runs through them. Where the rough outline has another main direction
    than `kappa`, that is tried too, and the cheaper drawing taken; without `kappa` it is the only one. Raises FitError for
    points that span no area.

    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0.25, 12, 0.5), np.arange(0.25, 7, 0.5)))
    >>> outline = estimate_outline(np.column_stack([x, y]))
    >>> len(outline.exterior.coords) - 1, bool(abs(outline.area - 84) < 4)
    (4, True)
    """
    points = np.ascontiguousarray(points, float)
    corners, spacing, shape = rough_outline(points[:, :2])
    rough = shapely.Polygon(corners)
    own = main_direction(rough)
    directions = [own] if kappa is None else [kappa]
    if kappa is not None and abs(quarter_gap(kappa - own)) > SAME_DIRECTION_RAD:
        directions.append(own)
    wall = on_walls(points, points, spacing) if points.shape[1] > 2 else np.zeros(len(points), bool)
    outer = wall.copy()
    outer[wall] = shapely.dwithin(shape.exterior, shapely.points(points[wall, :2]), OUTER_M)
    density = (~wall).sum() / rough.area
    telling, dearness = ~wall | outer, unevenness(points[~wall, :2], shape, spacing)
    border = border_of(points[telling, :2], wall[telling], density, dearness)
    drawings = [drawn(lines_through(corners), angle, border, STEP_SPACINGS * spacing) for angle in directions]
    place = settled(min(drawings, key=lambda drawing: drawing.cost).lines, points[:, :2], density)
    corners = np.empty_like(place)
    find_corners(place, corners)
    return shapely.Polygon(corners)


def border_of(xy: np.ndarray, wall: np.ndarray, density: float, dearness: float) -> Border:
    """What bears on the border: some of the points `xy` (n, 2), of which `wall` (n,) lie on outer walls; and the prices."""
    step = math.ceil(density / MOST_DENSE)
    order = np.argsort(xy[::step, 1], kind="stable") * step
    x, y = np.ascontiguousarray(xy[order].T)
    return Border(x, y, wall[order], density / step, BLUR_M, STRAY, *(dearness * price for price in PRICES))


def drawn(lines: np.ndarray, kappa: float, border: Border, step_m: float) -> Drawing:
    """The cheapest drawing found from `lines` (n, 2) on: few of them at first, then with what breaks them."""
    drawing = redrawn(drawing_of(lines, kappa, border), border, step_m)
    for longest in (1, RUN):  # bays of single sides come first: fewer runs go wrong
        drawing = redrawn(stepped(drawing, border, longest), border, step_m)
    return drawing
