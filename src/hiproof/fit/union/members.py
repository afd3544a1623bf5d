"""List the volumes whose planes points determine, by the unknowns of all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .finish import FEWEST_FITTED_POINTS, OutlineWall, Planes, find_visible_points, take_points
from .scene import Scene
from .sides import Side
from .volumes import DIRECTION


@dataclass(frozen=True)
class LinearVolume:
    """A volume as one of several.

    `rows` (k, 3) are its planes in its own axes: `design` (k, 3, q) times its own unknowns, which
    are those from number `first` on of all p. `full_design` (k, 3, p) gives them by all unknowns,
    `common_design` (k, 3, p) does in the first direction's axes. `points` (3, n) are its points in
    its own axes, and `places` (3, n) their u, v, 1 in the first direction's. `visible` are the
    numbers of its planes on which any points lie, with the numbers of those.
    """

    rows: np.ndarray
    design: np.ndarray
    first: int
    full_design: np.ndarray
    common_design: np.ndarray
    points: np.ndarray
    places: np.ndarray
    visible: dict[int, np.ndarray]
    sides: list[Side]
    walls: tuple[OutlineWall, ...]
    turn: np.ndarray


def list_members(
    volumes: np.ndarray, sides: list[list[Side]], planes: list[Planes], scene: Scene
) -> dict[int, LinearVolume]:
    """Return the volumes whose planes points determine, by their number."""
    visible = find_visible_points(volumes, scene)
    free = [
        k
        for k, full_design in enumerate(planes)
        if full_design.design.shape[2] and len(visible[k]) >= FEWEST_FITTED_POINTS
    ]
    size, start, members = sum(planes[k].design.shape[2] for k in free), 0, {}
    for k in free:
        rows, design, direction = planes[k].rows, planes[k].design, int(volumes[k, DIRECTION])
        full_design = np.zeros((*design.shape[:2], size))
        full_design[:, :, start : start + design.shape[2]] = design
        c, s = scene.turn[direction]
        common = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ full_design
        ones = np.ones(len(visible[k]))
        points = take_points(volumes[k], visible[k], scene)
        places = np.array([scene.U[0][visible[k]], scene.V[0][visible[k]], ones])
        members[k] = LinearVolume(
            rows,
            design,
            start,
            full_design,
            common,
            points,
            places,
            find_lowest_planes(rows, points),
            sides[k],
            planes[k].walls,
            scene.turn[direction],
        )
        start += design.shape[2]
    return members


def find_lowest_planes(rows: np.ndarray, points: np.ndarray) -> dict[int, np.ndarray]:
    """Find which planes (5, 3) are the lowest at any of `points` (3, n).

    Returns the numbers of these points by those of the planes.
    """
    planes = np.flatnonzero(np.isfinite(rows[:, 2])).tolist()
    z = rows[planes] @ np.array([points[0], points[1], np.ones(points.shape[1])])
    lowest = z.argmin(axis=0)
    points_by_plane = {number: np.flatnonzero(lowest == k) for k, number in enumerate(planes)}
    return {number: numbers for number, numbers in points_by_plane.items() if len(numbers)}


def solve_unknowns(members: list[LinearVolume]) -> np.ndarray:
    """Return the unknowns (p,) that give the members' rows."""
    present = [np.isfinite(member.rows) for member in members]
    design = np.concatenate(
        [member.full_design[is_known] for member, is_known in zip(members, present, strict=True)]
    )
    rows = np.concatenate(
        [member.rows[is_known] for member, is_known in zip(members, present, strict=True)]
    )
    return np.linalg.lstsq(design, rows, rcond=None)[0]


def evaluate_rows(members: list[LinearVolume], unknowns: np.ndarray) -> np.ndarray:
    """Return the members' planes (m, k, 3) under the unknowns (p,).

    They are in the first direction's axes, NaN where a plane is absent.
    """
    rows = np.full((len(members), max(len(member.rows) for member in members), 3), np.nan)
    for member_rows, member in zip(rows, members, strict=True):
        member_rows[: len(member.rows)] = np.where(
            np.isfinite(member.rows), member.common_design @ unknowns, np.nan
        )
    return rows


def compute_heights_at(
    members: list[LinearVolume], rows: np.ndarray, places: np.ndarray, reach_m: float = 0.0
) -> np.ndarray:
    """Return the heights (m, n) of the members at `places` (n, 2).

    Their planes are `rows` (m, k, 3), places are u, v of the first direction's axes. A member that
    ends more than `reach_m` before a place is at minus infinity there.
    """
    positions = np.column_stack([places, np.ones(len(places))]).T
    inside = np.array([is_inside_member(member, places, reach_m) for member in members])
    return np.where(inside, np.fmin.reduce(rows @ positions, axis=1), -np.inf)


def is_inside_member(member: LinearVolume, places: np.ndarray, reach_m: float) -> np.ndarray:
    """Return which `places` (n, 2) lie inside a member's sides, or `reach_m` off them.

    Places are u, v of the first direction's axes.
    """
    c, s = member.turn
    return is_inside_sides(places @ np.array([[c, -s], [s, c]]), member.sides, reach_m)


def is_inside_sides(places: np.ndarray, sides: list[Side], reach_m: float = 0.0) -> np.ndarray:
    """Return which `places` (n, 2) lie inside sides, or `reach_m` off them.

    Places are u, v of the axes of the sides' volume.
    """
    (left, right, front, back), (u, v) = sides, places.T
    across_u = (left.offset + left.lean * v - u < reach_m) & (
        u - right.offset - right.lean * v < reach_m
    )
    return (
        across_u
        & (front.offset + front.lean * u - v < reach_m)
        & (v - back.offset - back.lean * u < reach_m)
    )
