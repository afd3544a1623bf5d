"""Find drums: level discs that stand on other parts, or lie in them.

The search makes a few level rectangles of one. Its step follows a circle, which separates
level points from others. A ring is what a drum leaves of the level part around it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import numpy as np
import shapely

from ...geometry.arrays import compute_median
from ...geometry.rings import OVERLAY_GRID_M
from ...model import Part, Piece
from ...primitives.facets import CHORD_M, find_apothem, find_sides, make_rim
from .custom import MOST_DISTANCE_M
from .judged import JudgedRoof, make_flat, measure_gain, replace_parts, trim_parts
from .regions import exclude_parts, list_polygons, select_touching, unite_outlines
from .round_ends import TURRET_DEG, RoundEnd, cut_to_outline

SAME_LEVEL_M = 0.15  # Points so near to a level (m) belong to it.
BEYOND_DRUM = 1.5  # Points within so many radii show the step.
CIRCLE_ROUNDS = 3  # Rounds in which the circle is found.
EDGE_SOFTNESS_M = (0.3, 0.2, 0.1, 0.05)  # How far off its side (m) points may lie, round by round.
FEWEST_LEVEL_POINTS = 12  # Fewer show no circle.
LEAST_DRUM_NATS = 8.0  # A roof with a drum must be so much likelier (nats).
LEAST_DRUM_NATS_ON_ARC = 0.0  # The same over an arc of the outline, which speaks for the circle.
FEWEST_WRONG = 3  # Fewer points off the roof are stray ones.
RIGHT_SHARE = 0.95  # Share of the points around it on the right side of a drum's step.
HOPELESS_SHARE = 0.85  # A circle with fewer on the right side is given up.


def place_drums(roof: JudgedRoof, ends: list[RoundEnd]) -> JudgedRoof:
    """Return the roof with drums in place of level parts that points follow less.

    They are sought over the round `ends` of the outline, and around level parts.
    """
    for end in ends:
        for drum in list_end_drums(roof, end):
            gain, better = replace_level_parts(roof, drum)
            roof = better if gain > LEAST_DRUM_NATS_ON_ARC else roof
    for drum in list_drums(roof):
        gain, better = replace_level_parts(roof, drum)
        if gain > LEAST_DRUM_NATS:
            return place_drums(better, [])
    return roof


def replace_level_parts(roof: JudgedRoof, drum: Part) -> tuple[float, JudgedRoof]:
    """Return the likeliest roof with a drum, and what it gains (nats)."""
    options = [replace_parts(roof, drum, trimmed) for trimmed in (trim_parts(roof, drum), None)]
    return max([*options, *draw_ring(roof, drum)], key=lambda option: option[0])


def list_end_drums(roof: JudgedRoof, end: RoundEnd) -> Iterator[Part]:
    """Yield the drum over the circle of a round end, if points are level there."""
    inside = np.hypot(*(roof.points[:, :2] - end.centre).T) <= end.radius
    z = roof.points[inside, 2]
    if end.is_round and end.span_deg >= TURRET_DEG and len(z) >= FEWEST_LEVEL_POINTS:
        level = float(np.median(z))
        if np.mean(np.abs(z - level) <= SAME_LEVEL_M) >= RIGHT_SHARE:
            yield from cut_to_outline(make_drum(end.centre, end.radius, level), end, roof.outline)


def draw_ring(roof: JudgedRoof, drum: Part) -> list[tuple[float, JudgedRoof]]:
    """Return the roof with one level part around a drum, and what that gains (nats).

    They replace all level parts at the two levels. There is none where nothing lies around it.
    """
    xy, z = roof.points[:, :2], roof.points[:, 2]
    (plan,) = drum.outlines
    inside = shapely.contains_xy(plan, *xy.T)
    r = np.hypot(*(xy - drum.translation[:2]).T)
    is_around = ~inside & (r <= BEYOND_DRUM * 0.5 * drum.parameters["width"])
    if not is_around.any():
        return []
    level = float(np.median(z[is_around]))
    levels = level, float(drum.translation[2])
    group = [part for part in roof.parts if any(is_at_level(part, z) for z in levels)]
    ring = shapely.difference(unite_outlines(group), plan, grid_size=OVERLAY_GRID_M)
    judged = inside | shapely.contains_xy(ring, *xy.T)
    around = make_flat(list_polygons(ring), drum, z[judged & ~inside])
    if not around.pieces:
        return []
    new = replace(roof, parts=[*exclude_parts(roof.parts, group), around, drum])
    return [(measure_gain(roof, new, judged, MOST_DISTANCE_M), new)]


def is_at_level(part: Part, level: float) -> bool:
    """Return whether a part is flat and near a level (m)."""
    return part.type == "flat" and abs(part.translation[2] - level) <= SAME_LEVEL_M


def list_drums(roof: JudgedRoof) -> Iterator[Part]:
    """Yield drums around level parts.

    They lie around those that touch at one level together, or around one alone.
    """
    z, top = roof.points[:, 2], roof.highest[1]
    for k, part in enumerate(roof.parts):
        own = top == k
        if part.type == "flat" and np.count_nonzero(own) >= FEWEST_LEVEL_POINTS:
            level = compute_median(z[own])
            group = [other for other in roof.parts if is_at_level(other, level)]
            if len(group) > 1:
                group = select_touching(group, unite_outlines([part]))
            is_level = np.array([any(other is one for one in group) for other in roof.parts])
            starts = (is_level[top], own) if np.count_nonzero(is_level) > 1 else (own,)
            drums = (fit_drum(roof, level, start) for start in starts)
            yield from islice((drum for drum in drums if drum is not None), 1)


def fit_drum(roof: JudgedRoof, level: float, start: np.ndarray) -> Part | None:
    """Fit a drum at a `level` (m), beginning with the points `start` (n,) on it.

    There is none where hardly any points near it are off the roof.
    """
    circle, right_share = find_circle(roof.points, level, start)
    if right_share < RIGHT_SHARE:
        return None
    centre, radius = circle[:2], float(circle[2])
    drum = make_drum(centre, radius, level)
    is_near = np.hypot(*(roof.points[:, :2] - centre).T) <= BEYOND_DRUM * radius
    is_wrong = is_near & (roof.measure_distances(math.inf) > SAME_LEVEL_M)
    is_inside = shapely.covers(roof.outline, drum.outlines[0])
    return drum if is_inside and np.count_nonzero(is_wrong) >= FEWEST_WRONG else None


def find_circle(points: np.ndarray, level: float, start: np.ndarray) -> tuple[np.ndarray, float]:
    """Find the circle that best separates the points (n, 3) at a level from others.

    It begins with the disc that has the middle and the spread of the points `start` (n,). Returns
    its middle and radius (3,), and which share of the points around the start is on its right side.
    It is given up, and the share is 0, where too few are. Each step is one of a logistic fit:
    points nearer to the circle count more, the more so the smaller its softness.
    """
    centre = points[start, :2].mean(axis=0)
    squares = ((points[:, :2] - centre) ** 2).sum(axis=1)
    circle = np.array([*centre, math.sqrt(2.0 * squares[start].mean())])
    disc = points[squares <= (BEYOND_DRUM * circle[2]) ** 2]
    sign = np.where(np.abs(disc[:, 2] - level) <= SAME_LEVEL_M, 1.0, -1.0)
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
