"""Walls that cut a corner of a volume off: planes over these too, as a bay with slanted sides or an eight-sided tower has them.

A volume's own planes face along its axes or a little off them. Where another wall of the outline ends it, a further plane that
rises square from this wall is tried: through the point in which others meet and from their eaves' height, or with a slope or an eave of
its own, each fitted together with all planes of the volume to its points. It stays where that explains more than its parameters cost.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import shapely

from ...geometry.rings import counterclockwise
from ...primitives.cants import MOST_CANTS
from .finish import (
    FLATTEST,
    Planes,
    Wall,
    cost_of,
    finished_volume,
    least_squares,
    points_of,
    proper,
    shown_points,
)
from .members import lies_inside
from .objective import misfits
from .plan import Plan
from .prices import PARAMETER_COST
from .scene import Scene
from .sides import Side
from .volumes import DIRECTION, LEVEL, SIDES

SHORTEST_M = 0.6  # of a wall
FEWEST_INCLINED = 2  # planes of a volume with cants: one slope alone is cut off by walls and runs on
OFF_RAD = math.radians(12.0)  # by which it faces another way than each of the volume's sides
NEAR_M = 0.1  # m inside the wall, in its middle, where the volume must be
APART_M, DEEP_M = 0.1, 0.5  # points in which planes meet are one within; they lie so far before the wall at least
MEET_M = 0.05  # m by which the roof may be lower than the point in which three planes meet
SLOPES = (0.5, 0.8, 1.2)  # rise over run to begin with, besides those of the volume's planes


class Way(NamedTuple):
    """A further plane as linear in p unknowns of all (3, p), the last `more` of which are its own."""

    design: np.ndarray
    more: int


# Planes and roofs by all that they depend on in one scene: planes by their volume, its sides, and
# the points over which it shows, roofs by their volumes.
Known = dict[Any, Any]


def finished(
    volumes: np.ndarray, sides: list[list[Side]], walls: np.ndarray, scene: Scene, known: Known
) -> list[Planes]:
    """The planes of every volume, in its direction's axes, over its sides and over those of the outline's `walls` (m, 2, 2) that cut
    its corners off; those `known` are not fitted again, those found become known."""
    planes = []
    for volume, own, members in zip(volumes, sides, shown_points(volumes, scene), strict=True):
        key = volume.tobytes(), tuple(own), members.tobytes()
        if key not in known:
            found = finished_volume(volume, own, scene, members)
            if found.inclined >= FEWEST_INCLINED and found.design.shape[2]:
                beside = own_walls(walls, own, scene.turn[int(volume[DIRECTION])])
                found = canted(found, beside, own, points_of(volume, members, scene), scene)
            known[key] = found
        planes.append(known[key])
    return planes


def walls_of(outline: shapely.Polygon, plan: Plan) -> np.ndarray:
    """Starts and ends (m, 2, 2) of the outline's outer walls, the inside to the left, in the first direction's axes."""
    ring = (counterclockwise(outline.exterior) - plan.frame.origin[:2]) @ plan.frame.rotation.T
    ends = np.stack([ring[:-1], ring[1:]], axis=1)
    return ends[np.hypot(*(ends[:, 1] - ends[:, 0]).T) > SHORTEST_M]


def seen_along(walls: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The middles (m, 2) of `walls` (m, 2, 2) in the axes of the direction at `turn`, and which way they look out (m, 2)."""
    c, s = turn
    ends = walls @ np.array([[c, -s], [s, c]])
    ways = ends[:, 1] - ends[:, 0]
    return ends.mean(axis=1), np.column_stack([ways[:, 1], -ways[:, 0]]) / np.hypot(*ways.T)[:, None]


def own_walls(walls: np.ndarray, sides: list[Side], turn: np.ndarray) -> list[Wall]:
    """Those of the `walls` (m, 2, 2) that end a volume and face another way than its sides, in its own axes at `turn`."""
    middle, outwards = seen_along(walls, turn)
    facing = np.arctan2(outwards[:, 1], outwards[:, 0])
    off = np.abs(np.remainder(facing[:, None] - facings_of(sides) + np.pi, 2.0 * np.pi) - np.pi).min(axis=1)
    kept = np.flatnonzero(lies_inside(middle - NEAR_M * outwards, sides) & (off > OFF_RAD))
    if len(kept) > MOST_CANTS:  # of a round wall
        return []
    return [Wall(float(f), float(x)) for f, x in zip(facing[kept], (outwards * middle).sum(axis=1)[kept], strict=True)]


def facings_of(sides: list[Side]) -> np.ndarray:
    """The directions (4,) in which the sides look (rad)."""
    left, right, front, back = (math.atan(side.lean) for side in sides)
    return np.array([math.pi - left, -right, -0.5 * math.pi + front, 0.5 * math.pi + back])


def canted(planes: Planes, walls: list[Wall], sides: list[Side], points: np.ndarray, scene: Scene) -> Planes:
    """The planes with one over each of the `walls` that pays, the best first; `points` (3, m) are the volume's."""
    left = list(walls)
    while left and len(planes.walls) < MOST_CANTS:
        if misfit_below(planes, points, scene) <= scene.evidence * PARAMETER_COST:
            break
        best = min(with_one_more(planes, left, sides, points, scene), key=worth, default=planes)
        if worth(best) >= worth(planes):
            break
        left.remove(best.walls[-1])
        planes = best
    return planes


def worth(planes: Planes) -> float:
    return planes.cost + planes.price


def with_one_more(
    planes: Planes, walls: list[Wall], sides: list[Side], points: np.ndarray, scene: Scene
) -> Iterator[Planes]:
    """The planes with one more over one of the `walls`, in every way."""
    places = meeting_places(planes, sides)
    for wall in walls:
        start = start_over(wall, planes, points, scene)
        for way in ways_over(wall, planes, places):
            found = fitted_with(planes, wall, way, start, points, scene)
            if proper(found.rows, found.walls):
                yield found


def misfit_below(planes: Planes, points: np.ndarray, scene: Scene) -> float:
    """What the points (3, m) below the planes cost: no more can further planes gain."""
    z = np.nanmin(planes.rows @ np.vstack([points[:2], np.ones(points.shape[1])]), axis=0)
    return float(misfits(points[2], np.maximum(z, points[2]), scene).sum())


def ways_over(wall: Wall, planes: Planes, places: list[np.ndarray]) -> Iterator[Way]:
    """Ways for a plane to rise from `wall`, through one of the `places` in which others meet or free, the more regular ones first."""
    count, depth = planes.design.shape[2], wall.depth
    own, eave = np.eye(count + 2), level_eave(planes)
    eaves = [own[count + 1]] if eave is None else [own[eave], own[count + 1]]
    for place in places:
        deep = float(depth @ (*place, 1.0))
        if deep > DEEP_M:
            top = np.append(height_by_unknowns(planes, place), [0.0, 0.0])
            for low in eaves:
                yield trimmed(np.outer(depth, (top - low) / deep) + np.outer([0.0, 0.0, 1.0], low), count)
    for low in eaves:
        yield trimmed(np.outer(depth, own[count]) + np.outer([0.0, 0.0, 1.0], low), count)


def trimmed(design: np.ndarray, count: int) -> Way:
    """The way by all unknowns and only those of the two further ones after `count` that it has."""
    used = design[:, count:].any(axis=0)
    return Way(np.hstack([design[:, :count], design[:, count:][:, used]]), int(used.sum()))


def level_eave(planes: Planes) -> int | None:
    """The unknown that is the height of all level eaves; None where there are none."""
    shared = (planes.design[:SIDES, 2] == 1.0).sum(axis=0)
    return int(shared.argmax()) if shared.max() > 1 else None


def meeting_places(planes: Planes, sides: list[Side]) -> list[np.ndarray]:
    """Where (2,) three or more of the inclined planes meet on the roof."""
    there = [k for k in np.flatnonzero(np.isfinite(planes.rows[:, 2])).tolist() if k != LEVEL]
    found: list[np.ndarray] = []
    for three in combinations(there, 3):
        a, b, c = planes.rows[list(three)]
        apart = np.array([a - b, a - c])
        if abs(np.linalg.det(apart[:, :2])) < FLATTEST**2:
            continue
        place = np.linalg.solve(apart[:, :2], -apart[:, 2])
        heights = planes.rows[there] @ (*place, 1.0)
        if a @ (*place, 1.0) > heights.min() + MEET_M or not lies_inside(place[None], sides)[0]:
            continue
        if all(np.hypot(*(place - other)) > APART_M for other in found):
            found.append(place)
    return found


def height_by_unknowns(planes: Planes, place: np.ndarray) -> np.ndarray:
    """The roof's height (p,) at a place in which planes meet, by their unknowns: the mean of theirs."""
    at = np.array([*place, 1.0])
    heights = planes.rows @ at
    meet = np.flatnonzero(heights < np.nanmin(heights) + MEET_M)
    return (at @ planes.design[meet]).mean(axis=0)


def fitted_with(planes: Planes, wall: Wall, way: Way, start: np.ndarray, points: np.ndarray, scene: Scene) -> Planes:
    """All planes of a volume fitted with one more over `wall`, from `start` (3,) on."""
    count, _, width = planes.design.shape
    design = np.zeros((count + 1, 3, width + way.more))
    design[:count, :, :width], design[count] = planes.design, way.design
    begun = np.vstack([planes.rows, start])
    rows, covariance, cost = least_squares(begun, design, points, scene.dead, scene.width)
    price = planes.price + scene.evidence * PARAMETER_COST * max(way.more, 1)
    return Planes(rows, cost, design, covariance, (*planes.walls, wall), price)


def quantiles(values: np.ndarray, shares: tuple[float, ...]) -> list[float]:
    """What so large `shares` of the values (n,) lie below: between two of these, on a line."""
    ordered, found = np.sort(values).tolist(), []
    for share in shares:
        k, rest = divmod((len(ordered) - 1) * share, 1.0)
        low, high = ordered[int(k)], ordered[min(int(k) + 1, len(ordered) - 1)]
        step = high - low
        found.append(low + step * rest if rest < 0.5 else high - step * (1.0 - rest))
    return found


def start_over(wall: Wall, planes: Planes, points: np.ndarray, scene: Scene) -> np.ndarray:
    """The plane (3,) over `wall` that explains most of `points` (3, m), of some slopes and heights."""
    inclined = planes.rows[np.isfinite(planes.rows[:, 2])][:, :2]
    slopes = {round(x, 2) for x in np.hypot(*inclined.T).tolist() if x > FLATTEST} | set(SLOPES)
    deep = wall.depth[:2] @ points[:2] + wall.depth[2]
    (near_m,) = quantiles(deep, (0.2,))
    lows = quantiles(points[2, deep < near_m], (0.02, 0.25, 0.5))
    rows = np.vstack([planes.rows, np.zeros(3)])
    tried = [slope * wall.depth + [0.0, 0.0, low] for slope in sorted(slopes) for low in lows]
    costs = []
    for row in tried:
        rows[-1] = row
        costs.append(cost_of(rows, points, scene.dead, scene.width))
    return tried[int(np.argmin(costs))]
