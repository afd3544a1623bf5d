"""Find drums: level discs that stand on other parts, or lie in them.

The search makes a few level rectangles of one. Its step follows a circle, which separates
level points from others. A ring is what a drum leaves of the level part around it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely

from ...model import Part, Piece
from ...primitives.facets import CHORD_M, find_apothem, find_sides, make_rim
from ..prices import CORNER_UNITS, UNKNOWN_UNITS
from .accept import CIRCLE_NUMBERS, SAME_LEVEL_M, PartsRoof
from .arcs import TURRET_DEG, Arc, cut_to_outline
from .regions import select_touching, unite_outlines

# Numbers of a drum: those of its circle, and what the corners of a box cost, which is as simple.
DRUM_NUMBERS = CIRCLE_NUMBERS + round(4.0 * CORNER_UNITS / UNKNOWN_UNITS)
BEYOND_DRUM = 1.5  # Points within so many radii show the step.
CIRCLE_ROUNDS = 3  # Rounds in which the circle is found.
EDGE_SOFTNESS_M = (0.3, 0.2, 0.1, 0.05)  # How far off its side (m) points may lie, round by round.
FEWEST_LEVEL_POINTS = 12  # Fewer show no circle.
HOPELESS_SHARE = 0.85  # A circle with fewer points on the right side is given up.


def list_arc_drums(roof: PartsRoof, arc: Arc) -> Iterator[tuple[Part, int]]:
    """Yield the drum over the circle of an arc."""
    z = roof.points[np.hypot(*(roof.points[:, :2] - arc.centre).T) <= arc.radius, 2]
    if arc.is_round and arc.span_deg >= TURRET_DEG and len(z) >= FEWEST_LEVEL_POINTS:
        drum = make_drum(arc.centre, arc.radius, float(np.median(z)))
        yield from ((part, 0) for part in cut_to_outline(drum, arc, roof.outline))


def list_drums(roof: PartsRoof, part: Part, own: np.ndarray) -> Iterator[tuple[Part, int]]:
    """Yield drums around a level part, and around all that touch it at its level."""
    if part.type != "flat":
        return
    level = float(part.translation[2])
    group = [
        other
        for other in select_touching(roof.parts, unite_outlines([part]))
        if other.type == "flat" and abs(other.translation[2] - level) <= SAME_LEVEL_M
    ]
    for start in (own, roof.find_seen(group)) if len(group) > 1 else (own,):
        circle, right_share = find_circle(roof, level, start)
        drum = make_drum(circle[:2], float(circle[2]), level)
        if right_share > 0.0 and shapely.covers(roof.outline, drum.outlines[0]):
            yield drum, DRUM_NUMBERS


def find_circle(roof: PartsRoof, level: float, start: np.ndarray) -> tuple[np.ndarray, float]:
    """Find the circle that best separates the points at a level from others.

    It begins with the disc that has the middle and the spread of the points `start` (k,). Returns
    its middle and radius (3,), and which share of the points around the start is on its right side.
    It is given up, and the share is 0, where too few are. Each step is one of a logistic fit:
    points nearer to the circle count more, the more so the smaller its softness.
    """
    centre = roof.points[start, :2].mean(axis=0)
    squares = ((roof.points[start, :2] - centre) ** 2).sum(axis=1)
    circle = np.array([*centre, math.sqrt(2.0 * squares.mean())])
    near = roof.find_near(centre, BEYOND_DRUM * circle[2])
    disc = roof.points[near]
    sign = np.where(np.abs(disc[:, 2] - level) <= SAME_LEVEL_M, 1.0, -1.0)
    if not roof.is_worth(near, roof.misfits[near[sign < 0.0]].sum(), CIRCLE_NUMBERS):
        return circle, 0.0
    right_share = measure_right_share(disc, sign, circle)
    for softness in EDGE_SOFTNESS_M:
        if right_share < HOPELESS_SHARE:
            return circle, 0.0
        for _ in range(CIRCLE_ROUNDS):
            way = disc[:, :2] - circle[:2]
            r = np.maximum(np.hypot(*way.T), softness)
            wrong = 0.5 + 0.5 * np.tanh(0.5 * sign * (r - circle[2]) / softness)
            design = np.column_stack([way / r[:, None], np.ones_like(r)])
            weight = wrong * (1.0 - wrong) / softness**2
            normal = np.eye(3) + design.T @ (weight[:, None] * design)
            step = np.linalg.solve(normal, design.T @ (sign * wrong / softness))
            circle = circle + np.clip(step, -softness, softness)
        right_share = measure_right_share(disc, sign, circle)
    return circle, right_share


def measure_right_share(points: np.ndarray, sign: np.ndarray, circle: np.ndarray) -> float:
    """Return which share of points (n, 3) is on the right side of a circle, 1 for its inside."""
    is_inside = ((points[:, :2] - circle[:2]) ** 2).sum(axis=1) <= circle[2] ** 2
    return float(np.mean(is_inside == (sign > 0.0)))


def make_drum(centre: np.ndarray, radius: float, level: float) -> Part:
    """Return the level part over a circle."""
    sides = find_sides(radius, CHORD_M)
    rim = centre + radius * np.array(make_rim(sides, find_apothem(sides)))
    pieces = (Piece(shapely.Polygon(rim), np.array([[0.0, 0.0, level]])),)
    size = {"width": 2.0 * radius, "length": 2.0 * radius}
    return Part("flat", pieces, size, 0.0, np.array([*centre, level]))
