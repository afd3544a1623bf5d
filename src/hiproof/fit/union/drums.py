"""Find drums: level discs that stand on other parts, or lie in them.

The search makes a few level rectangles of one. Its step follows a circle, which separates
level points from others. A ring is what a drum leaves of the level part around it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import shapely

from ...geometry.rings import OVERLAY_GRID_M
from ...model import Part, Piece
from ...primitives.facets import CHORD_M, find_apothem, find_sides, make_rim
from .judged import JudgedRoof, make_flat, measure_gain, replace_parts, trim_parts
from .own import MOST_DISTANCE_M
from .regions import exclude_parts, list_polygons, unite_outlines
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
HOPELESS_SHARE = 0.85  # A circle with fewer on the right side after a round is given up.


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
    group = [*select_level(roof, level), *select_level(roof, float(drum.translation[2]))]
    ring = shapely.difference(unite_outlines(group), plan, grid_size=OVERLAY_GRID_M)
    judged = inside | shapely.contains_xy(ring, *xy.T)
    around = make_flat(list_polygons(ring), drum, z[judged & ~inside])
    if not around.pieces:
        return []
    new = replace(roof, parts=[*exclude_parts(roof.parts, group), around, drum])
    return [(measure_gain(roof, new, judged, MOST_DISTANCE_M), new)]


def select_level(roof: JudgedRoof, level: float) -> list[Part]:
    """Return the flat parts near a level (m)."""
    return [
        part
        for part in roof.parts
        if part.type == "flat" and abs(part.translation[2] - level) <= SAME_LEVEL_M
    ]


def list_drums(roof: JudgedRoof) -> Iterator[Part]:
    """Yield drums around level parts."""
    wrong = roof.points[roof.measure_distances(math.inf) > SAME_LEVEL_M, :2]
    for k, part in enumerate(roof.parts):
        own = roof.highest[1] == k
        if part.type == "flat" and np.count_nonzero(own) >= FEWEST_LEVEL_POINTS:
            middle = roof.points[own, :2].mean(axis=0)
            reach = BEYOND_DRUM * np.hypot(*(roof.points[own, :2] - middle).T).max()
            if np.count_nonzero(np.hypot(*(wrong - middle).T) <= reach) >= FEWEST_WRONG:
                yield from fit_drum(roof, float(np.median(roof.points[own, 2])))


def fit_drum(roof: JudgedRoof, level: float) -> Iterator[Part]:
    """Yield the drum of the level parts at a `level` (m)."""
    areas = list_polygons(unite_outlines(select_level(roof, level)))
    if not areas:
        return
    largest = max(areas, key=lambda polygon: polygon.area)
    centre, radius = np.array(largest.centroid.coords[0]), math.sqrt(largest.area / math.pi)
    near = np.hypot(*(roof.points[:, :2] - centre).T) <= BEYOND_DRUM * radius
    xy, z = roof.points[near, :2], roof.points[near, 2]
    is_level = np.abs(z - level) <= SAME_LEVEL_M
    for softness in EDGE_SOFTNESS_M:
        centre, radius = separate_by_circle(xy, is_level, centre, radius, softness)
        right_share = np.mean((np.hypot(*(xy - centre).T) <= radius) == is_level)
        if right_share < HOPELESS_SHARE:
            return
    drum = make_drum(centre, radius, level)
    if right_share >= RIGHT_SHARE and shapely.covers(roof.outline, drum.outlines[0]):
        yield drum


def separate_by_circle(
    xy: np.ndarray, is_level: np.ndarray, centre: np.ndarray, radius: float, softness: float
) -> tuple[np.ndarray, float]:
    """Move a circle to where it best separates level points from others.

    It is a logistic fit of points at `xy` (n, 2). Those nearer to the circle count more, the more
    so the smaller its `softness` (m).
    """
    sign = np.where(is_level, 1.0, -1.0)
    for _ in range(CIRCLE_ROUNDS):
        way = xy - centre
        r = np.maximum(np.hypot(*way.T), softness)
        wrong = 0.5 + 0.5 * np.tanh(0.5 * sign * (r - radius) / softness)  # the logistic curve
        change = np.column_stack([way.T[0] / r, way.T[1] / r, np.ones_like(r)]) / softness
        hessian = (change.T * (wrong * (1.0 - wrong))) @ change + np.eye(3)
        move = np.linalg.solve(hessian, change.T @ (sign * wrong))
        dx, dy, wider = np.clip(move, -softness, softness).tolist()
        centre, radius = centre + (dx, dy), radius + wider
    return centre, radius


def make_drum(centre: np.ndarray, radius: float, level: float) -> Part:
    """Return the level part over a circle."""
    sides = find_sides(radius, CHORD_M)
    rim = centre + radius * np.array(make_rim(sides, find_apothem(sides)))
    pieces = (Piece(shapely.Polygon(rim), np.array([[0.0, 0.0, level]])),)
    size = {"width": 2.0 * radius, "length": 2.0 * radius}
    return Part("flat", pieces, size, 0.0, np.array([*centre, level]))
