"""Let hips and valleys that end beside a corner of the outline end in it.

The same holds for a step's end at a wall. Points lie some centimetres beside their true place, and
walls a decimetre beside theirs, so planes meet a little off the corner that a draughtsman draws.
The condition that they meet there is a linear equation between their unknowns, which `agree` tests
against the points.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np

from .clusters import Equation, collect_terms
from .members import LinearVolume, compute_heights_at, evaluate_rows
from .sides import CORNER_SIDES, find_corners
from .volumes import LEVEL

# Distance (m) in plan and in height within which a fold line is tried to end in a corner: clouds
# lie a decimetre beside their outlines.
NEAR_M = 0.2
ENDS_IN_CORNER_M = 0.01  # A fold line that ends so near (m) ends in the corner.
CORNER_REACH_M = 0.4  # A volume that ends so near (m) a corner reaches it.
LEAST_BREAK = 0.1  # Planes whose gradients (rise over run) differ less have no clear fold line.
FROM_CORNER_M = 0.6  # Distance (m) from the corner at which a fold line must be on the roof.
ON_ROOF_M = 0.02  # Height (m) within which it must be on the roof.


class CornerPlane(NamedTuple):
    """A plane of a member at a corner.

    It has the member's number, its own, its height there, and a, b, c (3,) in the first direction's
    axes.
    """

    member: int
    number: int
    height: float
    coefficients: np.ndarray


def list_corner_equations(
    members: dict[int, LinearVolume], ring: np.ndarray
) -> Iterator[tuple[float, Equation]]:
    """Yield equations (1, q) between planes that meet beside a corner.

    Corners are those of the outline's `ring` (c, 2), and places where a step ends at it. Each comes
    with how far apart in height (m) the planes are there.
    """
    numbers, member_list = list(members), list(members.values())
    rows = evaluate_rows(member_list)
    corners = np.vstack([ring, *(list_own_corners(member, ring) for member in member_list)])
    for corner, planes in zip(corners, list_planes_at(member_list, rows, corners), strict=True):
        position = np.array([*corner, 1.0])
        for plane, other in combinations(planes, 2):
            if is_near_miss(plane, other) and is_fold_line(plane, other, corner, member_list, rows):
                terms = [
                    (
                        numbers[end.member],
                        sign * position @ member_list[end.member].common_design[end.number],
                    )
                    for sign, end in ((1.0, plane), (-1.0, other))
                ]
                equation = collect_terms((k, factors[None]) for k, factors in terms)
                yield abs(plane.height - other.height), equation


def list_own_corners(member: LinearVolume, ring: np.ndarray) -> np.ndarray:
    """Return the places (m, 2) where a member's sides meet on the outline.

    The `ring`'s corners are left out.
    """
    c, s = member.turn
    corners = find_corners(member.sides) @ np.array([[c, s], [-s, c]])
    anchored = [member.sides[k].anchored or member.sides[j].anchored for k, j in CORNER_SIDES]
    is_apart = np.hypot(*(corners[:, None] - ring).T).min(axis=0) > ENDS_IN_CORNER_M
    return corners[is_apart & np.array(anchored)]


def list_planes_at(
    members: list[LinearVolume], rows: np.ndarray, corners: np.ndarray
) -> list[list[CornerPlane]]:
    """List, by corner (c, 2), the planes with points of the members that reach it.

    They are within NEAR_M of the roof's height there.
    """
    plane_heights = rows @ np.column_stack([corners, np.ones(len(corners))]).T
    heights = compute_heights_at(members, rows, corners, CORNER_REACH_M)
    is_near = (heights > heights.max(axis=0) - NEAR_M)[:, None] & (
        plane_heights < heights[:, None] + NEAR_M
    )
    is_near &= np.array(
        [[p in member.visible for p in range(rows.shape[1])] for member in members]
    )[:, :, None]
    planes_by_corner: list[list[CornerPlane]] = [[] for _ in corners]
    for c, k, p in np.argwhere(is_near.transpose(2, 0, 1)).tolist():
        planes_by_corner[c].append(CornerPlane(k, p, float(plane_heights[k, p, c]), rows[k, p]))
    return planes_by_corner


def is_near_miss(plane: CornerPlane, other: CornerPlane) -> bool:
    """Return whether the fold line of two planes lies beside their corner, not at it.

    The slopes of one volume and the level plane of another cross along an eave, which ends in no
    corner.
    """
    if plane.member != other.member and LEVEL in (plane.number, other.number):
        return False
    gap = abs(plane.height - other.height)
    if gap >= NEAR_M:
        return False
    slope_break = measure_break(plane, other)
    return slope_break > LEAST_BREAK and ENDS_IN_CORNER_M < gap / slope_break < NEAR_M


def measure_break(plane: CornerPlane, other: CornerPlane) -> float:
    """Return by how much (rise over run) the gradients of two planes differ."""
    a, b, _ = (plane.coefficients - other.coefficients).tolist()
    return math.hypot(a, b)


def is_fold_line(
    plane: CornerPlane,
    other: CornerPlane,
    corner: np.ndarray,
    members: list[LinearVolume],
    rows: np.ndarray,
) -> bool:
    """Return whether two planes meet on the roof, a step off the corner."""
    across = (plane.coefficients - other.coefficients)[:2] / measure_break(plane, other)
    foot = corner - across * (plane.height - other.height) / measure_break(plane, other)
    places = foot + np.array([[-FROM_CORNER_M], [FROM_CORNER_M]]) * np.array(
        [-across[1], across[0]]
    )
    heights, z = (
        compute_heights_at(members, rows, places),
        places @ plane.coefficients[:2] + plane.coefficients[2],
    )
    on_roof = np.abs(z - heights[[plane.member, other.member]]).max(axis=0) < ON_ROOF_M
    return bool((on_roof & (heights.max(axis=0) < z + ON_ROOF_M)).any())
