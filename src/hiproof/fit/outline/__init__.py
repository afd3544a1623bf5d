"""The outline of a building without a footprint, from its points.

It is drawn as a draughtsman would draw it.

rough   the points' alpha shape, pushed out, with few corners, with more and with many
spread  how evenly points are spread, by which prices go
soft    how soft a side is
lines   a polygon as the lines of its sides
cost    how well an outline explains where points are and are not, and what its lines cost
moves   lines dropped, joined, turned into common directions and moved until nothing is gained
steps   bays and notches of a side or of a run of them, wherever points pay for them
settle  each side to the place that the points across it give it, without the bias of outermost
        points
"""

from __future__ import annotations

import math
from operator import itemgetter
from typing import NamedTuple

import numpy as np
import shapely

from ...geometry.rings import join, subtract
from ..direction import main_direction
from ..walls import on_walls
from .cost import Border, Drawing, costs_by_depth, make_drawing
from .lines import compute_area, find_corners, make_lines, quarter_gap
from .moves import redraw
from .rough import LEAST_COURT_M2, Rough, counter_clockwise, largest, rough_outline
from .settle import settle_lines
from .spread import unevenness
from .steps import RUN, add_steps

__all__ = ["estimate_outline"]

# m over which a side is soft: the scanner's noise in plan; density outside over that inside: points
# of walls and trees
OUTLINE_BLUR_M, STRAY = 0.15, math.exp(-4.0)
# nats: of a line, of a further direction, of a line in that, of a sharp corner, where points are
# spread by chance
PRICES = (3.0, 3.0, 1.0, 6.0)
# m from the border of the points' shape within which a wall is an outer one: the scanner's noise,
# doubled
OUTER_M = 0.25
# points a square metre up to which chance makes borders ragged; beyond, plants, gutters and what
# hangs out do, all points alike: prices grow with these powers of the density
CHANCE_DENSE, GROWTH = 8.0, (0.5, 0.5, 0.5, 1.0)
# points a square metre; of more only every second, third, ... bears on what is drawn: it takes time
MOST_DENSE = 40.0
# rad; within it the direction of slopes and that of the outline are one
SAME_DIRECTION_RAD = math.radians(1.5)
# m around a court's first drawing in which its corners lie; points of twice that bear on it
BORDER_REACH_M = 2.0
MOSTLY_INSIDE = 0.8  # of a court's area has to lie inside the outline to be cut out
STEP_SPACINGS = 0.2  # spacings of points that lines are moved by first
# m; a narrower bay is no part of an outline but a gap between points, as beside a high wall
# (without footprints, edges of The Hague's even places: 85.3, 85.5, 86.1, 85.7 % at 0, 1, 1.5, 2)
SLIT_M = 1.5
SLIT_TRACE_M2, SLIT_TRACE_M = 0.05, 0.02  # slits and jogs that rounding leaves
GRID_M = 1e-4  # m; on it, sides that nearly coincide leave no spikes


def estimate_outline(points: np.ndarray, kappa: float | None = None) -> shapely.Polygon:
    """Estimate the outline of `points`, courts included.

    Points are (n, 3) or (n, 2) in metres. Sides run mostly along `kappa` (rad) and across.

    With heights, points of walls are known, and the outline runs through them. Each ring is the
    cheapest of three drawings, from few corners on, from more and from many, these along another
    main direction where the corners have one; without `kappa` all are along theirs. Raises FitError
    for points that span no area.

    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0.25, 12, 0.5), np.arange(0.25, 7,
    ...     0.5)))
    >>> outline = estimate_outline(np.column_stack([x, y]))
    >>> len(outline.exterior.coords) - 1, bool(abs(outline.area - 84) < 4)
    (4, True)
    """
    points = np.ascontiguousarray(points, float)
    rough = rough_outline(points)
    direction = main_direction(shapely.Polygon(rough.rings[0][0]))
    kappa = direction if kappa is None else kappa
    other = direction if abs(quarter_gap(kappa - direction)) > SAME_DIRECTION_RAD else kappa
    ways = (kappa, other, other)
    cloud = make_cloud(points, rough)
    outline, *courts = [draw_ring(starts, ways, cloud) for starts in rough.rings]
    return with_courts(close_slits(outline), courts)


def close_slits(outline: shapely.Polygon) -> shapely.Polygon:
    """Close bays narrower than SLIT_M where that leaves fewer corners.

    >>> slit = shapely.difference(shapely.box(0, 0, 9, 6), shapely.box(4, 1, 5, 6))
    >>> bool(shapely.equals(close_slits(slit), shapely.box(0, 0, 9, 6)))
    True
    """
    wide = shapely.buffer(outline, 0.5 * SLIT_M, join_style="mitre")
    closed = largest(shapely.buffer(wide, -0.5 * SLIT_M, join_style="mitre"))
    for slit in shapely.get_parts(subtract(closed, outline, GRID_M)):
        if slit.area > SLIT_TRACE_M2:
            ring = largest(join(outline, slit, GRID_M)).exterior
            corners = counter_clockwise(shapely.simplify(shapely.Polygon(ring), SLIT_TRACE_M))
            if len(corners) < len(outline.exterior.coords) - 1:
                outline = shapely.Polygon(corners)
    return outline


class Cloud(NamedTuple):
    """The points by which all rings are drawn.

    `xy` (n, 2) are points; `wall` and `telling` say which are a wall's, and which are not those of
    inner walls. `density` is in points of the roof a square metre, `spacing` in m, and `dearness`
    is that of structure.
    """

    xy: np.ndarray
    wall: np.ndarray
    telling: np.ndarray
    density: float
    spacing: float
    dearness: float


def make_cloud(points: np.ndarray, rough: Rough) -> Cloud:
    """Prepare `points` (n, 2 or 3) for the drawing of rings."""
    xy = points[:, :2]
    wall = (
        on_walls(points, points, rough.spacing)
        if points.shape[1] > 2
        else np.zeros(len(points), bool)
    )
    outer = wall.copy()
    outer[wall] = shapely.dwithin(rough.shape.boundary, shapely.points(xy[wall]), OUTER_M)
    density = (~wall).sum() / sum(compute_area(starts[0]) for starts in rough.rings)
    return Cloud(
        xy,
        wall,
        ~wall | outer,
        density,
        rough.spacing,
        unevenness(xy[~wall], rough.shape, rough.spacing),
    )


def draw_ring(starts: list[np.ndarray], ways: tuple[float, ...], cloud: Cloud) -> shapely.Polygon:
    """Draw one ring, the cheapest of several drawings.

    They begin with `starts`, each along one of the `ways` (rad).
    """
    drawings = []
    for corners, way in zip(starts, ways, strict=True):
        angle = along_y(corners, way)
        border = make_border(cloud, corners, angle)
        outline = draw_outline(
            make_lines(turned_back(corners, angle)), border, STEP_SPACINGS * cloud.spacing
        )
        drawings.append((outline.cost, outline.lines + [angle, 0.0]))
    _, lines = min(drawings, key=itemgetter(0))
    # walls well inside stand below eaves that reach out
    lines = settle_lines(lines, cloud.xy[cloud.telling], cloud.density)
    corners = np.empty_like(lines)
    find_corners(lines, corners, -1)
    return shapely.Polygon(corners)


def along_y(corners: np.ndarray, way: float) -> float:
    """Return `way` (rad), or that across it, for which the corners reach far in y.

    `corners` (n, 2) are turned by it. Then fewer sides are as high as a point.
    """
    x, y = np.ptp(turned_back(corners, way), axis=0)
    return way if y >= x else way + 0.5 * math.pi


def make_border(cloud: Cloud, corners: np.ndarray, angle: float) -> Border:
    """Prepare what bears on a ring that begins with `corners` (n, 2).

    It is some of the points, and the prices, in axes turned by `angle` (rad).
    """
    xy, wall = turned_back(cloud.xy[cloud.telling], angle), cloud.wall[cloud.telling]
    start, court = turned_back(corners, angle), compute_area(corners) < 0.0
    lower, upper = start.min(axis=0) - BORDER_REACH_M, start.max(axis=0) + BORDER_REACH_M
    if court:
        mask = ((xy > lower - BORDER_REACH_M) & (xy < upper + BORDER_REACH_M)).all(axis=1)
        xy, wall = xy[mask], wall[mask]
    step = math.ceil(cloud.density / MOST_DENSE)
    order = np.argsort(xy[::step, 1], kind="stable") * step
    x, y = np.ascontiguousarray(xy[order].T)
    density = cloud.density / step
    dense = max(density / CHANCE_DENSE, 1.0)
    prices = (
        cloud.dearness * price * dense**growth for price, growth in zip(PRICES, GROWTH, strict=True)
    )
    box = lower[0], upper[0], lower[1], upper[1]
    return Border(
        x, y, wall[order], density, court, box, OUTLINE_BLUR_M, costs_by_depth(STRAY), *prices
    )


def with_courts(outline: shapely.Polygon, courts: list[shapely.Polygon]) -> shapely.Polygon:
    """Return the outline less its courts.

    One that is drawn as a bay already, or would cut a roof in two, is left out.
    """
    for court in courts:
        roof = largest(shapely.difference(outline, court))
        missing = outline.area - roof.area
        if MOSTLY_INSIDE * court.area < missing < court.area + LEAST_COURT_M2:
            outline = roof
    return outline


def turned_back(xy: np.ndarray, angle: float) -> np.ndarray:
    """Return places (n, 2) in axes turned by `angle` (rad).

    Along these a side is near few points only, and its cost is soon known.
    """
    c, s = math.cos(angle), math.sin(angle)
    return xy @ np.array([[c, -s], [s, c]])


def draw_outline(lines: np.ndarray, border: Border, step_m: float) -> Drawing:
    """Return the cheapest drawing found from `lines` (n, 2) on.

    It runs mostly along the axes. It has few lines at first, then those that break them.
    """
    drawing = redraw(make_drawing(lines, 0.0, border), border, step_m)
    for longest in (1, RUN):  # bays of single sides come first: fewer runs go wrong
        broken = add_steps(drawing, border, longest)
        drawing = redraw(broken, border, step_m) if broken.cost < drawing.cost else drawing
    return drawing
