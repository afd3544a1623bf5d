"""The outline of a building without a footprint, from its points, as a draughtsman would draw it.

rough   the points' alpha shape, pushed out, with few corners and with more
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
from operator import itemgetter

import numpy as np
import shapely

from ..direction import main_direction
from ..walls import on_walls
from .cost import Border, Drawing, drawing_of
from .lines import find_corners, lines_through, quarter_gap
from .moves import redrawn
from .rough import rough_outlines
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

    With heights, points of walls are known, and the outline runs through them. It is the cheaper of two drawings, one from few
    corners on and one from more, along another main direction where the corners have one; without `kappa` both are along theirs.
    Raises FitError for points that span no area.

    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0.25, 12, 0.5), np.arange(0.25, 7, 0.5)))
    >>> outline = estimate_outline(np.column_stack([x, y]))
    >>> len(outline.exterior.coords) - 1, bool(abs(outline.area - 84) < 4)
    (4, True)
    """
    points = np.ascontiguousarray(points, float)
    starts, spacing, shape = rough_outlines(points[:, :2])
    rough = shapely.Polygon(starts[0])
    own = main_direction(rough)
    kappa = own if kappa is None else kappa
    ways = (kappa, own if abs(quarter_gap(kappa - own)) > SAME_DIRECTION_RAD else kappa)
    wall = on_walls(points, points, spacing) if points.shape[1] > 2 else np.zeros(len(points), bool)
    outer = wall.copy()
    outer[wall] = shapely.dwithin(shape.exterior, shapely.points(points[wall, :2]), OUTER_M)
    density = (~wall).sum() / rough.area
    telling, dearness = ~wall | outer, unevenness(points[~wall, :2], shape, spacing)
    drawings = []
    for corners, angle in zip(starts, ways, strict=True):
        border = border_of(turned_back(points[telling, :2], angle), wall[telling], density, dearness)
        found = drawn(lines_through(turned_back(corners, angle)), border, STEP_SPACINGS * spacing)
        drawings.append((found.cost, found.lines + [angle, 0.0]))
    _, lines = min(drawings, key=itemgetter(0))
    lines = settled(lines, points[:, :2], density)
    corners = np.empty_like(lines)
    find_corners(lines, corners)
    return shapely.Polygon(corners)


def border_of(xy: np.ndarray, wall: np.ndarray, density: float, dearness: float) -> Border:
    """What bears on the border: some of the points `xy` (n, 2), of which `wall` (n,) lie on outer walls; and the prices."""
    step = math.ceil(density / MOST_DENSE)
    order = np.argsort(xy[::step, 1], kind="stable") * step
    x, y = np.ascontiguousarray(xy[order].T)
    return Border(x, y, wall[order], density / step, BLUR_M, STRAY, *(dearness * price for price in PRICES))


def turned_back(xy: np.ndarray, angle: float) -> np.ndarray:
    """Places (n, 2) in axes turned by `angle` (rad): along these a side is near few points only, and what it costs soon known."""
    c, s = math.cos(angle), math.sin(angle)
    return xy @ np.array([[c, -s], [s, c]])


def drawn(lines: np.ndarray, border: Border, step_m: float) -> Drawing:
    """The cheapest drawing found from `lines` (n, 2) on, mostly along the axes: few of them at first, then with what breaks them."""
    drawing = redrawn(drawing_of(lines, 0.0, border), border, step_m)
    for longest in (1, RUN):  # bays of single sides come first: fewer runs go wrong
        drawing = redrawn(stepped(drawing, border, longest), border, step_m)
    return drawing
