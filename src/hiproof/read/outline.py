"""A rough plan outline from points alone: their alpha shape at the points' own scale, its edges straightened.

The main direction is the one most of the outline's length runs along or across (as the four-fold harmonic tells). Edges
near it or near its normal are turned into it, short ones merged into their neighbours, oblique long ones kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from ..errors import FitError
from ..fit.alpha_shape import alpha_shape

RADIUS_SPACINGS = 3.0
CLOSING_SPACINGS = 1.5
LOST_SPACINGS = 0.35
"""By how much the alpha shape of points strewn evenly falls short of the border (measured on simulated outlines)."""

SIMPLIFY_SPACINGS = 0.8
SHORT_SPACINGS = 2.0
SHORT_M = 0.6
AXIS_TOLERANCE_DEG = 25.0
INTERIOR_CELL_SPACINGS = 2.5
INTERIOR_CELLS = 2
MOST_CELLS = 20_000_000
LEAST_IOU = 0.85
"""A straightened outline that shares less with the outline it came from is not used."""


def plan_density(xy: np.ndarray) -> float:
    """Points a square metre where there are points: the median over occupied cells, large enough for four points."""
    xy = np.asarray(xy, float)[:, :2]
    for cell_m in (1.0, 2.0, 4.0, 8.0):
        cells = np.floor(xy / cell_m).astype(np.int64)
        cells -= cells.min(axis=0)
        counts = np.unique(cells[:, 1] * (cells[:, 0].max() + 1) + cells[:, 0], return_counts=True)[1]
        if np.median(counts) >= 4:
            break
    return float(np.median(counts)) / cell_m**2


def estimate_outline(xy: np.ndarray) -> shapely.Polygon:
    """Rough outline of one building's roof points `xy` (n, 2 or 3), world or local metres; courtyards become holes.

    Empty where the points span no area. Wider than their alpha shape by about a third of their spacing.

    >>> grid = np.stack(np.meshgrid(np.arange(0, 10, 0.5), np.arange(0, 6, 0.5)), axis=-1).reshape(-1, 2)
    >>> [round(side, 1) for side in estimate_outline(grid).bounds]
    [-0.2, -0.2, 9.7, 5.7]
    """
    xy = np.asarray(xy, float)[:, :2]
    xy = xy[np.lexsort(xy.T)]  # the same points give the same outline, in whatever order they come
    if len(xy) < 3:
        return shapely.Polygon()
    origin = np.floor(xy.mean(axis=0))
    spacing = 1.0 / np.sqrt(plan_density(xy))
    try:
        shape = alpha_shape(without_interior(xy - origin, spacing), RADIUS_SPACINGS * spacing, holes=True)
    except FitError:
        return shapely.Polygon()
    # Out, and back in to where the border is expected: bays narrower than the closing are gaps between points, not the roof's.
    shape = shapely.buffer(shape, (CLOSING_SPACINGS + LOST_SPACINGS) * spacing, join_style="mitre", mitre_limit=2)
    shape = shapely.buffer(shape, -CLOSING_SPACINGS * spacing, join_style="mitre", mitre_limit=2)
    shape = largest(shapely.simplify(shape, SIMPLIFY_SPACINGS * spacing))
    straight = straightened(shape, max(SHORT_SPACINGS * spacing, SHORT_M))
    return shapely.transform(straight, lambda local: local + origin)


def without_interior(xy: np.ndarray, spacing: float) -> np.ndarray:
    """`xy` (n, 2) with a single point left in each cell far from every empty one: the alpha shape's border stays.

    Cells are 2.5 spacings wide: the few triangles that this makes too wide for the radius, the closing fills again.
    """
    from scipy.ndimage import binary_erosion

    cells = np.floor(xy / (INTERIOR_CELL_SPACINGS * spacing)).astype(np.int64)
    cells -= cells.min(axis=0)
    shape = cells.max(axis=0) + 1
    if shape.prod() > MOST_CELLS:
        return xy
    occupied = np.zeros(shape, bool)
    occupied[cells[:, 0], cells[:, 1]] = True
    interior = binary_erosion(occupied, np.ones((3, 3), bool), iterations=INTERIOR_CELLS)[cells[:, 0], cells[:, 1]]
    first_of_cell = np.unique(cells[:, 0] * shape[1] + cells[:, 1], return_index=True)[1]
    kept = ~interior
    kept[first_of_cell] = True
    return xy[kept]


def largest(geometry: shapely.Geometry) -> shapely.Polygon:
    return max(shapely.get_parts(geometry), key=lambda part: part.area, default=shapely.Polygon())


def straightened(polygon: shapely.Polygon, short_m: float) -> shapely.Polygon:
    """`polygon` with edges turned into the main direction or its normal; itself where that would distort it."""
    if polygon.is_empty:
        return polygon
    angle = main_direction(polygon)
    turned = shapely.transform(polygon, lambda xy: xy @ rotation(-angle).T)
    rings = [straight_ring(np.asarray(ring.coords)[:-1], short_m) for ring in (turned.exterior, *turned.interiors)]
    holes = [ring for ring in rings[1:] if ring is not None]
    candidate = shapely.Polygon() if rings[0] is None else shapely.Polygon(rings[0], holes)
    if not candidate.is_valid or candidate.is_empty:
        return polygon
    common = candidate.intersection(turned).area
    if common < LEAST_IOU * (candidate.area + turned.area - common):
        return polygon
    return shapely.transform(candidate, lambda xy: xy @ rotation(angle).T)


def main_direction(polygon: shapely.Polygon) -> float:
    """Angle in radians, modulo 90 degrees, that most of the outline's length runs along or across."""
    edges = np.concatenate([np.diff(np.asarray(r.coords), axis=0) for r in (polygon.exterior, *polygon.interiors)])
    length, direction = np.hypot(*edges.T), np.arctan2(edges[:, 1], edges[:, 0])
    # Squared lengths: long edges know the direction, the many short ones between points do not.
    return float(np.angle(np.sum(length**2 * np.exp(4j * direction))) / 4)


def rotation(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@dataclass(frozen=True)
class Side:
    """A straight side of a ring in the turned frame, from `start` to `end` (2,).

    `axis` is the coordinate that stays constant at `level` (0: x, 1: y), or -1 where the side runs obliquely.
    """

    start: np.ndarray
    end: np.ndarray
    axis: int
    level: float

    @property
    def length(self) -> float:
        """Along its axis; an oblique side's own."""
        run = np.abs(self.end - self.start)
        return float(np.hypot(*run) if self.axis < 0 else run[1 - self.axis])


def straight_ring(vertices: np.ndarray, short_m: float) -> np.ndarray | None:
    """Vertices (m, 2) of the ring with straightened sides, None where fewer than three remain."""
    sides = [side_between(start, end, short_m) for start, end in zip(vertices, np.roll(vertices, -1, 0), strict=True)]
    sides = join_neighbours(sides, short_m)
    while len(sides) > 4:
        shortest = min(range(len(sides)), key=lambda i: sides[i].length)
        if sides[shortest].length >= short_m:
            break
        sides = join_neighbours(sides[:shortest] + sides[shortest + 1 :], short_m)
    if len(sides) < 3:
        return None
    corners = [
        corner for side, following in zip(sides, sides[1:] + sides[:1], strict=True) for corner in meet(side, following)
    ]
    return np.array(corners)


def side_between(start: np.ndarray, end: np.ndarray, short_m: float) -> Side:
    run = np.abs(end - start)
    axis = 1 if run[0] >= run[1] else 0
    oblique = np.degrees(np.arctan2(run[axis], run[1 - axis])) > AXIS_TOLERANCE_DEG and np.hypot(*run) >= 2 * short_m
    return Side(start, end, -1 if oblique else axis, float((start[axis] + end[axis]) / 2))


def join_neighbours(sides: list[Side], short_m: float) -> list[Side]:
    """Consecutive sides along the same axis joined where their levels differ by less than `short_m`."""
    joined: list[Side] = []
    for side in sides:
        if joined and joins(joined[-1], side, short_m):
            side = join(joined.pop(), side)
        joined.append(side)
    if len(joined) > 1 and joins(joined[-1], joined[0], short_m):
        joined = [join(joined[-1], joined[0]), *joined[1:-1]]
    return joined


def joins(side: Side, following: Side, short_m: float) -> bool:
    return side.axis == following.axis >= 0 and abs(side.level - following.level) < short_m


def join(side: Side, following: Side) -> Side:
    weights = np.array([side.length, following.length]) + 1e-9
    level = float(weights @ [side.level, following.level] / weights.sum())
    return Side(side.start, following.end, side.axis, level)


def meet(side: Side, following: Side) -> list[np.ndarray]:
    """The corner where two consecutive sides meet; two corners, joined by a step, where both run along one axis."""
    between = (side.end + following.start) / 2
    if side.axis < 0 and following.axis < 0:
        return [between]
    if side.axis < 0 or following.axis < 0:
        straight, oblique = (following, side) if side.axis < 0 else (side, following)
        run = oblique.end - oblique.start
        corner = oblique.start + run * (straight.level - oblique.start[straight.axis]) / run[straight.axis]
        return [corner]
    if side.axis == following.axis:
        step = [between.copy(), between.copy()]
        step[0][side.axis], step[1][side.axis] = side.level, following.level
        return step
    corner = np.empty(2)
    corner[side.axis], corner[following.axis] = side.level, following.level
    return [corner]
