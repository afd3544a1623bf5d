"""Find the arcs of an outline.

An arc is a run of short sides that turn alike. It gives the middle and the radius of the shape over
it: of an apse from half a circle, and of a turret from more.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import affinity

from ...geometry.rings import counterclockwise, intersect, join, subtract
from ...model import Part
from ...primitives.facets import CHORD_M
from ...primitives.ribs import draw_facets
from .regions import cut_part, list_polygons

# Turns (degrees) between sides that follow a circle, or a polygon of six sides or more.
LEAST_TURN_DEG, MOST_TURN_DEG = 3.0, 65.0
FEWEST_ROUND_SIDES = 11  # A circle has as many sides or more.
FEWEST_CORNERS = 4  # Fewer lie on some circle by chance.
SHORTEST_ARC_DEG = 120.0  # Shorter arcs are round corners of a roof, not shapes of their own.
APSE_DEG = (140.0, 220.0)  # Arcs of half discs.
TURRET_DEG = 150.0  # Shortest arc of a whole disc.
ON_CIRCLE = 0.03  # Farthest that a corner lies off its circle, in shares of the radius.
WHOLE_CIRCLE_DEG = 359.0  # Longer arcs are whole circles.
SECTOR_REACH = 2.0  # A sector of so many radii holds all of a shape beyond its arc.
LARGEST_RADIUS_M = 30.0  # Larger circles are bent facades.


@dataclass(frozen=True)
class Arc:
    """An arc of an outline: the `centre` (2,) and `radius` (m) of its circle.

    `kappa` (rad) leads from the centre to the middle of the arc, and `facing` to that of a side.
    `span_deg` is the arc's length, and the polygon `area` lies between it and its chord. `sides`
    are those of a whole circle of its kind.
    """

    area: shapely.Polygon
    centre: np.ndarray
    radius: float
    kappa: float
    facing: float
    span_deg: float
    sides: int

    @property
    def is_round(self) -> bool:
        """Whether the arc stands for a circle rather than for a polygon."""
        return self.sides >= FEWEST_ROUND_SIDES

    @property
    def way(self) -> np.ndarray:
        """The unit vector (2,) of `kappa`."""
        return np.array([math.cos(self.kappa), math.sin(self.kappa)])


def find_arcs(outline: shapely.Polygon) -> list[Arc]:
    """Find the arcs of an outline that are long enough for a roof of their own."""
    ring = counterclockwise(outline.exterior)
    x, y = (ring[1:] - ring[:-1]).T
    angles = np.arctan2(y, x)
    before = np.concatenate([angles[-1:], angles[:-1]])
    turns = np.degrees((angles - before + math.pi) % (2.0 * math.pi) - math.pi)
    is_bend = (turns >= LEAST_TURN_DEG) & (turns <= MOST_TURN_DEG)
    if np.count_nonzero(is_bend) < FEWEST_CORNERS:
        return []
    arcs = (fit_arc(ring[:-1][run]) for run in list_runs(is_bend))
    return [arc for arc in arcs if arc is not None]


def list_runs(mask: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the places of each run of true values around a ring.

    There is one more at each arc.
    """
    if mask.all():
        yield np.arange(len(mask) + 1) % len(mask)
        return
    start = int(np.argmin(mask))
    order = (start + np.arange(len(mask))) % len(mask)
    breaks = np.flatnonzero(~mask[order])
    for first, last in zip(breaks, [*breaks[1:], len(mask)], strict=True):
        if last - first - 1 >= FEWEST_CORNERS:
            yield order[np.arange(first, last + 1) % len(mask)]


def fit_arc(corners: np.ndarray) -> Arc | None:
    """Return the arc of a run of corners (n, 2), None if they lie on none.

    Its first and last corner may lie off the circle.
    """
    inner = corners[1:-1]
    design = np.column_stack([2.0 * inner, np.ones(len(inner))])
    origin = inner.mean(axis=0)
    design[:, :2] -= 2.0 * origin
    x, y, rest = np.linalg.lstsq(design, ((inner - origin) ** 2).sum(axis=1), rcond=None)[0]
    radius = math.sqrt(max(rest + x * x + y * y, 0.0))
    centre = origin + (x, y)
    distances = np.abs(np.hypot(*(corners - centre).T) - radius)
    if radius > LARGEST_RADIUS_M or distances[1:-1].max() > ON_CIRCLE * radius:
        return None
    arc = corners[distances <= ON_CIRCLE * radius]
    way = np.unwrap(np.arctan2(*(arc - centre).T[::-1]))
    span = math.degrees(way[-1] - way[0])
    if span < SHORTEST_ARC_DEG:
        return None
    step = math.radians(span / (len(arc) - 1))
    radius *= math.sqrt(math.sin(step) / step)  # of the circle with the same area
    area = shapely.make_valid(shapely.Polygon(arc))
    sides = round(2.0 * math.pi / step)
    middle, facing = (float(0.5 * (way[0] + way[k])) for k in (-1, 1))
    return Arc(area, centre, radius, middle, facing, span, sides)


def cut_to_outline(shape: Part, arc: Arc, outline: shapely.Polygon) -> Iterator[Part]:
    """Yield the shape over its plan and up to the arc, as far as the outline reaches."""
    plan = follow_arc(shape.pieces[0].outline, arc)
    polygons = list_polygons(intersect(plan, outline))
    if polygons:
        part = cut_part(shape, max(polygons, key=lambda polygon: polygon.area))
        yield draw_facets(part, outline, CHORD_M)


def follow_arc(plan: shapely.Polygon, arc: Arc) -> shapely.Geometry:
    """Return a plan over the circle of an arc with its corners."""
    if arc.span_deg >= WHOLE_CIRCLE_DEG or not isinstance(arc.area, shapely.Polygon):
        return join(plan, arc.area)
    corners = shapely.get_coordinates(arc.area.exterior)[:-1]
    sector = shapely.make_valid(shapely.Polygon([arc.centre, *corners]))
    beyond = affinity.scale(sector, SECTOR_REACH, SECTOR_REACH, origin=tuple(arc.centre))
    rest = subtract(plan, beyond)
    return join(rest, sector)
