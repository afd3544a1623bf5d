"""Add planes over walls that cut a corner of a volume off.

A bay with slanted sides and an eight-sided tower have such planes. A volume's own planes face along
its axes or a little off them. Where another wall of the outline ends the volume, a further plane
that rises square from this wall is tried. It starts at the eaves of the others and passes through
the point in which they meet, or has a slope or an eave of its own. It is fitted together with all
planes of the volume, and stays if it explains more than its parameters cost.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import shapely

from ...compiled import compiled
from ...geometry.rings import counterclockwise
from ...primitives.cants import MOST_CANTS
from .finish import (
    FLATTEST,
    OutlineWall,
    Planes,
    find_visible_points,
    fit_volume_planes,
    is_proper,
    solve_least_squares,
    take_points,
)
from .members import is_inside_sides
from .objective import compute_misfits, compute_point_cost
from .plan import Plan
from .planes import find_lowest_row
from .prices import PARAMETER_COST
from .scene import Scene
from .sides import Side
from .volumes import DIRECTION, LEVEL, N_SIDES

SHORTEST_WALL_M = 0.6  # Shortest length (m) of a wall with a plane.
# Fewest planes of a volume with cants. A single slope is cut off by walls and continues.
FEWEST_INCLINED = 2
OFF_RAD = math.radians(12.0)  # Least angle (rad) between a wall and each of the volume's sides.
INSIDE_WALL_M = 0.1  # The volume must reach to this distance (m) from the middle of the wall.
MEETING_GAP_M = 0.1  # Places nearer (m) in which planes meet are one.
MEETING_DEPTH_M = 0.5  # Least depth (m) of such a place inside the wall.
MEET_M = 0.05  # The roof may be lower by this (m) than the point in which three planes meet.
# Slopes (rise over run) to begin with, besides those of the volume's planes.
START_SLOPES = (0.5, 0.8, 1.2)


class PlaneForm(NamedTuple):
    """A further plane as linear in all p unknowns: `design` (3, p).

    The last `n_own` unknowns are its own.
    """

    design: np.ndarray
    n_own: int


# Planes and roofs by all that they depend on in one scene: planes by their volume, its sides, and
# the points over which it is visible, roofs by their volumes.
Cache = dict[Any, Any]


def fit_planes(
    volumes: np.ndarray, sides: list[list[Side]], walls: np.ndarray, scene: Scene, cache: Cache
) -> list[Planes]:
    """Fit the planes of every volume, in its direction's axes.

    They rise over its sides and over those of the outline's `walls` (m, 2, 2) that cut its corners
    off. Planes in the `cache` are not fitted again.
    """
    planes = []
    for volume, volume_sides, members in zip(
        volumes, sides, find_visible_points(volumes, scene), strict=True
    ):
        key = volume.tobytes(), tuple(volume_sides), members.tobytes()
        if key not in cache:
            fit = fit_volume_planes(volume, volume_sides, scene, members)
            if fit.inclined >= FEWEST_INCLINED and fit.design.shape[2]:
                cutting_walls = select_cutting_walls(
                    walls, volume_sides, scene.turn[int(volume[DIRECTION])]
                )
                fit = add_cants(
                    fit, cutting_walls, volume_sides, take_points(volume, members, scene), scene
                )
            cache[key] = fit
        planes.append(cache[key])
    return planes


def list_walls(outline: shapely.Polygon, plan: Plan) -> np.ndarray:
    """Return starts and ends (m, 2, 2) of the outline's outer walls.

    The inside is to their left. They are in the first direction's axes.
    """
    ring = (counterclockwise(outline.exterior) - plan.frame.origin[:2]) @ plan.frame.rotation.T
    ends = np.stack([ring[:-1], ring[1:]], axis=1)
    return ends[np.hypot(*(ends[:, 1] - ends[:, 0]).T) > SHORTEST_WALL_M]


def orient_walls(walls: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the middles (m, 2) of `walls` and the way that they face outwards (m, 2).

    The walls are (m, 2, 2), and the result is in the axes of the direction at `turn`.
    """
    c, s = turn
    ends = walls @ np.array([[c, -s], [s, c]])
    ways = ends[:, 1] - ends[:, 0]
    return ends.mean(axis=1), np.column_stack([ways[:, 1], -ways[:, 0]]) / np.hypot(*ways.T)[
        :, None
    ]


def select_cutting_walls(
    walls: np.ndarray, sides: list[Side], turn: np.ndarray
) -> list[OutlineWall]:
    """Select the `walls` (m, 2, 2) that cut a volume's corners off.

    They end the volume and face another way than its sides. They are returned in its own axes, at
    `turn`.
    """
    middle, outwards = orient_walls(walls, turn)
    facing = np.arctan2(outwards[:, 1], outwards[:, 0])
    angles = np.abs(
        np.remainder(facing[:, None] - measure_facings(sides) + np.pi, 2.0 * np.pi) - np.pi
    ).min(axis=1)
    numbers = np.flatnonzero(
        is_inside_sides(middle - INSIDE_WALL_M * outwards, sides) & (angles > OFF_RAD)
    )
    if len(numbers) > MOST_CANTS:  # of a round wall
        return []
    return [
        OutlineWall(float(f), float(x))
        for f, x in zip(facing[numbers], (outwards * middle).sum(axis=1)[numbers], strict=True)
    ]


def measure_facings(sides: list[Side]) -> np.ndarray:
    """Return the directions (4,) in which the sides face (rad)."""
    left, right, front, back = (math.atan(side.lean) for side in sides)
    return np.array([math.pi - left, -right, -0.5 * math.pi + front, 0.5 * math.pi + back])


def add_cants(
    planes: Planes, walls: list[OutlineWall], sides: list[Side], points: np.ndarray, scene: Scene
) -> Planes:
    """Add a plane over each of the `walls` where it pays, the best first.

    `points` (3, m) are the volume's.
    """
    remaining = list(walls)
    while remaining and len(planes.walls) < MOST_CANTS:
        if bound_gain(planes, points, scene) <= scene.evidence * PARAMETER_COST:
            break
        best = min(
            add_one_cant(planes, remaining, sides, points, scene), key=price_planes, default=planes
        )
        if price_planes(best) >= price_planes(planes):
            break
        remaining.remove(best.walls[-1])
        planes = best
    return planes


def price_planes(planes: Planes) -> float:
    return planes.cost + planes.price


def add_one_cant(
    planes: Planes, walls: list[OutlineWall], sides: list[Side], points: np.ndarray, scene: Scene
) -> Iterator[Planes]:
    """Yield the planes with one more over one of the `walls`, in every form.

    Over a wall where no plane to begin with explains more, none is fitted.
    """
    places = find_meeting_places(planes, sides)
    for wall in walls:
        start = find_start_plane(wall, planes, points, scene)
        if start is None:
            continue
        for form in list_forms(wall, planes, places):
            trial = fit_with_cant(planes, wall, form, start, points, scene)
            if is_proper(trial.rows, trial.walls):
                yield trial


def bound_gain(planes: Planes, points: np.ndarray, scene: Scene) -> float:
    """Return what the points (3, m) below the planes cost.

    Further planes cannot gain more.
    """
    z = np.nanmin(planes.rows @ np.vstack([points[:2], np.ones(points.shape[1])]), axis=0)
    return float(compute_misfits(points[2], np.maximum(z, points[2]), scene).sum())


def list_forms(wall: OutlineWall, planes: Planes, places: list[np.ndarray]) -> Iterator[PlaneForm]:
    """Yield forms of a plane over `wall`, the more regular ones first.

    It passes through one of the `places` in which others meet, or is free.
    """
    count, depth = planes.design.shape[2], wall.depth
    unit_rows, eave = np.eye(count + 2), find_level_eave(planes)
    eaves = [unit_rows[count + 1]] if eave is None else [unit_rows[eave], unit_rows[count + 1]]
    for place in places:
        deep = float(depth @ (*place, 1.0))
        if deep > MEETING_DEPTH_M:
            top = np.append(express_height(planes, place), [0.0, 0.0])
            for eave_form in eaves:
                yield trim_form(
                    np.outer(depth, (top - eave_form) / deep)
                    + np.outer([0.0, 0.0, 1.0], eave_form),
                    count,
                )
    for eave_form in eaves:
        yield trim_form(
            np.outer(depth, unit_rows[count]) + np.outer([0.0, 0.0, 1.0], eave_form), count
        )


def trim_form(design: np.ndarray, count: int) -> PlaneForm:
    """Return the form with those unknowns only that it has.

    It may have two further ones after `count`.
    """
    is_used = design[:, count:].any(axis=0)
    return PlaneForm(
        np.hstack([design[:, :count], design[:, count:][:, is_used]]), int(is_used.sum())
    )


def find_level_eave(planes: Planes) -> int | None:
    """Return the unknown that is the height of all level eaves, None without any."""
    shared = (planes.design[:N_SIDES, 2] == 1.0).sum(axis=0)
    return int(shared.argmax()) if shared.max() > 1 else None


def find_meeting_places(planes: Planes, sides: list[Side]) -> list[np.ndarray]:
    """Return where (2,) three or more of the inclined planes meet on the roof."""
    numbers = [k for k in np.flatnonzero(np.isfinite(planes.rows[:, 2])).tolist() if k != LEVEL]
    meeting_points: list[np.ndarray] = []
    for triple in combinations(numbers, 3):
        a, b, c = planes.rows[list(triple)]
        differences = np.array([a - b, a - c])
        if abs(np.linalg.det(differences[:, :2])) < FLATTEST**2:
            continue
        place = np.linalg.solve(differences[:, :2], -differences[:, 2])
        heights = planes.rows[numbers] @ (*place, 1.0)
        if a @ (*place, 1.0) > heights.min() + MEET_M or not is_inside_sides(place[None], sides)[0]:
            continue
        if all(np.hypot(*(place - other)) > MEETING_GAP_M for other in meeting_points):
            meeting_points.append(place)
    return meeting_points


def express_height(planes: Planes, place: np.ndarray) -> np.ndarray:
    """Return the roof's height (p,) where planes meet, by their unknowns.

    It is the mean of their heights.
    """
    position = np.array([*place, 1.0])
    heights = planes.rows @ position
    meet = np.flatnonzero(heights < np.nanmin(heights) + MEET_M)
    return (position @ planes.design[meet]).mean(axis=0)


def fit_with_cant(
    planes: Planes,
    wall: OutlineWall,
    form: PlaneForm,
    start: np.ndarray,
    points: np.ndarray,
    scene: Scene,
) -> Planes:
    """Fit all planes of a volume with one more over `wall`, from `start` (3,) on."""
    count, _, width = planes.design.shape
    design = np.zeros((count + 1, 3, width + form.n_own))
    design[:count, :, :width], design[count] = planes.design, form.design
    begun = np.vstack([planes.rows, start])
    rows, covariance, cost = solve_least_squares(begun, design, points, scene.dead, scene.width)
    price = planes.price + scene.evidence * PARAMETER_COST * max(form.n_own, 1)
    return Planes(rows, cost, design, covariance, (*planes.walls, wall), price)


def compute_quantiles(values: np.ndarray, shares: tuple[float, ...]) -> list[float]:
    """Return the levels below which these `shares` of the values (n,) lie.

    Levels between two values are interpolated.
    """
    ordered, levels = np.sort(values).tolist(), []
    for share in shares:
        k, remainder = divmod((len(ordered) - 1) * share, 1.0)
        lower, upper = ordered[int(k)], ordered[min(int(k) + 1, len(ordered) - 1)]
        step = upper - lower
        levels.append(
            lower + step * remainder if remainder < 0.5 else upper - step * (1.0 - remainder)
        )
    return levels


def find_start_plane(
    wall: OutlineWall, planes: Planes, points: np.ndarray, scene: Scene
) -> np.ndarray | None:
    """Find the plane (3,) over `wall` with which `points` (3, m) cost least.

    Some slopes and heights are tried. Returns None if the points cost no less with any.
    """
    inclined = planes.rows[np.isfinite(planes.rows[:, 2])][:, :2]
    slopes = {round(x, 2) for x in np.hypot(*inclined.T).tolist() if x > FLATTEST} | set(
        START_SLOPES
    )
    deep = wall.depth[:2] @ points[:2] + wall.depth[2]
    (near_m,) = compute_quantiles(deep, (0.2,))
    lows = compute_quantiles(points[2, deep < near_m], (0.02, 0.25, 0.5))
    trial_rows = np.array(
        [slope * wall.depth + [0.0, 0.0, eave] for slope in sorted(slopes) for eave in lows]
    )
    savings = measure_savings(planes.rows, trial_rows, points, scene.dead, scene.width)
    best = int(np.argmax(savings))
    return trial_rows[best] if savings[best] > 0.0 else None


@compiled
def measure_savings(rows, trial_rows, points, dead, width):
    """Return what `points` (3, m) cost less with each of the trial rows (t, 3).

    They lie under planes `rows` (k, 3), which a further one can only lower.
    """
    savings = np.zeros(len(trial_rows))
    for i in range(points.shape[1]):
        u, v, z = points[0, i], points[1, i], points[2, i]
        height, _ = find_lowest_row(rows, u, v)
        cost = compute_point_cost(z, height, dead, width)
        for t in range(len(trial_rows)):
            h = trial_rows[t, 0] * u + trial_rows[t, 1] * v + trial_rows[t, 2]
            if h < height:
                savings[t] += cost - compute_point_cost(z, h, dead, width)
    return savings
