"""The volumes of a roof whose planes points tell, each linear in the unknowns of all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .finish import FEWEST_POINTS, Planes, Wall, points_of, shown_points
from .scene import Scene
from .sides import Side
from .volumes import DIRECTION


@dataclass(frozen=True)
class Member:
    """A volume as one of several.

    `rows` (k, 3) are its planes in its own axes: `design` (k, 3, q) times its own unknowns, which
    are those from number `first` on of all p. `own` (k, 3, p) gives them by all unknowns, `common`
    (k, 3, p) so in the first direction's axes. `points` (3, n) are its points in its own axes,
    `places` (3, n) u, v, 1 of them in the first direction's. `seen` are the numbers of its planes
    on which any lie, with the numbers of those.
    """

    rows: np.ndarray
    design: np.ndarray
    first: int
    own: np.ndarray
    common: np.ndarray
    points: np.ndarray
    places: np.ndarray
    seen: dict[int, np.ndarray]
    sides: list[Side]
    walls: tuple[Wall, ...]
    turn: np.ndarray


def members_of(volumes: np.ndarray, sides: list[list[Side]], planes: list[Planes], scene: Scene) -> dict[int, Member]:
    """The volumes whose planes points tell, by their number."""
    shown = shown_points(volumes, scene)
    free = [k for k, own in enumerate(planes) if own.design.shape[2] and len(shown[k]) >= FEWEST_POINTS]
    size, start, found = sum(planes[k].design.shape[2] for k in free), 0, {}
    for k in free:
        rows, design, direction = planes[k].rows, planes[k].design, int(volumes[k, DIRECTION])
        own = np.zeros((*design.shape[:2], size))
        own[:, :, start : start + design.shape[2]] = design
        c, s = scene.turn[direction]
        common = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ own
        one = np.ones(len(shown[k]))
        points = points_of(volumes[k], shown[k], scene)
        places = np.array([scene.U[0][shown[k]], scene.V[0][shown[k]], one])
        found[k] = Member(
            rows,
            design,
            start,
            own,
            common,
            points,
            places,
            lowest_planes(rows, points),
            sides[k],
            planes[k].walls,
            scene.turn[direction],
        )
        start += design.shape[2]
    return found


def lowest_planes(rows: np.ndarray, points: np.ndarray) -> dict[int, np.ndarray]:
    """The planes (5, 3) that are the lowest at any of `points` (3, n), by their numbers: at which, by theirs."""
    there = np.flatnonzero(np.isfinite(rows[:, 2])).tolist()
    z = rows[there] @ np.array([points[0], points[1], np.ones(points.shape[1])])
    lowest = z.argmin(axis=0)
    on = {number: np.flatnonzero(lowest == k) for k, number in enumerate(there)}
    return {number: own for number, own in on.items() if len(own)}


def unknowns_of(members: list[Member]) -> np.ndarray:
    """The unknowns (p,) that give the members' rows."""
    there = [np.isfinite(member.rows) for member in members]
    design = np.concatenate([member.own[at] for member, at in zip(members, there, strict=True)])
    rows = np.concatenate([member.rows[at] for member, at in zip(members, there, strict=True)])
    return np.linalg.lstsq(design, rows, rcond=None)[0]


def rows_at(members: list[Member], unknowns: np.ndarray) -> np.ndarray:
    """The members' planes (m, k, 3) in the first direction's axes where the unknowns (p,) are these; NaN where there is none."""
    rows = np.full((len(members), max(len(member.rows) for member in members), 3), np.nan)
    for own, member in zip(rows, members, strict=True):
        own[: len(member.rows)] = np.where(np.isfinite(member.rows), member.common @ unknowns, np.nan)
    return rows


def heights_at(members: list[Member], rows: np.ndarray, places: np.ndarray, reach_m: float = 0.0) -> np.ndarray:
    """Heights (m, n) of the members, whose planes are `rows` (m, k, 3), at `places` (n, 2), u, v of the first direction's axes.

    Minus infinity of those that end more than `reach_m` before it.
    """
    at = np.column_stack([places, np.ones(len(places))]).T
    inside = np.array([is_inside(member, places, reach_m) for member in members])
    return np.where(inside, np.fmin.reduce(rows @ at, axis=1), -np.inf)


def is_inside(member: Member, places: np.ndarray, reach_m: float) -> np.ndarray:
    """Which of `places` (n, 2), u, v of the first direction's axes, lie inside a member's sides, or so near them."""
    c, s = member.turn
    return lies_inside(places @ np.array([[c, -s], [s, c]]), member.sides, reach_m)


def lies_inside(places: np.ndarray, sides: list[Side], reach_m: float = 0.0) -> np.ndarray:
    """Which of `places` (n, 2), u, v of their volume's axes, lie inside its sides, or so near them."""
    (left, right, front, back), (u, v) = sides, places.T
    across_u = (left.at + left.lean * v - u < reach_m) & (u - right.at - right.lean * v < reach_m)
    return across_u & (front.at + front.lean * u - v < reach_m) & (v - back.at - back.lean * u < reach_m)
