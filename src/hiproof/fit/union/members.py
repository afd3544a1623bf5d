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

    `rows` (k, 3) are its planes in its own axes: `design` (k, 3, q) times its `unknowns` (q,).
    `common_design` (k, 3, q) gives them in the first direction's axes. `points` (3, n) are its
    points in its own axes, and `places` (3, n) their u, v, 1 in the first direction's. `visible`
    are the numbers of its planes on which any points lie, with the numbers of those.
    """

    rows: np.ndarray
    design: np.ndarray
    unknowns: np.ndarray
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
    members = {}
    for k, volume_planes in enumerate(planes):
        if not volume_planes.design.shape[2] or len(visible[k]) < FEWEST_FITTED_POINTS:
            continue
        turn = scene.turn[int(volumes[k, DIRECTION])]
        points, is_present = (
            take_points(volumes[k], visible[k], scene),
            np.isfinite(volume_planes.rows),
        )
        members[k] = LinearVolume(
            volume_planes.rows,
            volume_planes.design,
            np.linalg.lstsq(
                volume_planes.design[is_present], volume_planes.rows[is_present], rcond=None
            )[0],
            turn_design(volume_planes.design, turn),
            points,
            np.array([scene.U[0][visible[k]], scene.V[0][visible[k]], np.ones(len(visible[k]))]),
            find_lowest_planes(volume_planes.rows, points),
            sides[k],
            volume_planes.walls,
            turn,
        )
    return members


def turn_design(design: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return a `design` (k, 3, q) in the first direction's axes, from those at `turn`."""
    c, s = turn
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ design


def find_lowest_planes(rows: np.ndarray, points: np.ndarray) -> dict[int, np.ndarray]:
    """Find which planes (5, 3) are the lowest at any of `points` (3, n).

    Returns the numbers of these points by those of the planes.
    """
    planes = np.flatnonzero(np.isfinite(rows[:, 2])).tolist()
    z = rows[planes] @ np.array([points[0], points[1], np.ones(points.shape[1])])
    lowest = z.argmin(axis=0)
    points_by_plane = {number: np.flatnonzero(lowest == k) for k, number in enumerate(planes)}
    return {number: numbers for number, numbers in points_by_plane.items() if len(numbers)}


def evaluate_rows(members: list[LinearVolume]) -> np.ndarray:
    """Return the members' planes (m, k, 3) in the first direction's axes.

    They are NaN where a plane is absent.
    """
    rows = np.full((len(members), max(len(member.rows) for member in members), 3), np.nan)
    for member_rows, member in zip(rows, members, strict=True):
        member_rows[: len(member.rows)] = np.where(
            np.isfinite(member.rows), member.common_design @ member.unknowns, np.nan
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
