"""Hips and valleys that end beside a corner of the outline, or beside a step's end at a wall, end in it.

Points lie some centimetres beside their place and walls a decimetre beside theirs, so that planes meet a little off the corner that a
draughtsman draws. That they meet there is a linear equation between their unknowns, one of those that `agree` asks the points about.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np

from .members import LinearVolume, compute_heights_at, evaluate_rows
from .sides import CORNER_SIDES, find_corners
from .volumes import LEVEL

# m by plan and by height within which a crease is asked to end in a corner: clouds lie a decimetre
# beside their outlines
NEAR_M = 0.2
ENDS_IN_CORNER_M = 0.01  # one that ends so near does
CORNER_REACH_M = 0.4  # a volume that ends so near a corner is drawn on to it
LEAST_BREAK = 0.1  # rise over run; planes less apart have no crease to speak of
FROM_CORNER_M, ON_ROOF_M = (
    0.6,
    0.02,
)  # where beside the corner a crease must be on the roof, and how nearly


class CornerPlane(NamedTuple):
    """A member's plane at a corner: whose, which, its height there and a, b, c (3,) in the first direction's axes."""

    member: int
    number: int
    height: float
    coefficients: np.ndarray


def list_corner_equations(
    members: list[LinearVolume], start: np.ndarray, ring: np.ndarray
) -> Iterator[tuple[float, tuple[int, int], np.ndarray]]:
    """Equations (1, p) between planes that meet beside a corner, of the outline's `ring` (c, 2) or where a step ends at it, at the
    unknowns `start` (p,): how far apart in height (m) they are there, and between which two members."""
    rows = evaluate_rows(members, start)
    corners = np.vstack([ring, *(list_own_corners(member, ring) for member in members)])
    for corner, planes in zip(corners, list_planes_at(members, rows, corners), strict=True):
        position = np.array([*corner, 1.0])
        for plane, other in combinations(planes, 2):
            if is_near_miss(plane, other) and is_fold_line(plane, other, corner, members, rows):
                equation = position @ (
                    members[plane.member].common_design[plane.number]
                    - members[other.member].common_design[other.number]
                )
                yield abs(plane.height - other.height), (plane.member, other.member), equation[None]


def list_own_corners(member: LinearVolume, ring: np.ndarray) -> np.ndarray:
    """The places (m, 2) besides the `ring`'s corners where a member's sides meet, one of which lies on the outline."""
    c, s = member.turn
    corners = find_corners(member.sides) @ np.array([[c, s], [-s, c]])
    anchored = [member.sides[k].anchored or member.sides[j].anchored for k, j in CORNER_SIDES]
    is_apart = np.hypot(*(corners[:, None] - ring).T).min(axis=0) > ENDS_IN_CORNER_M
    return corners[is_apart & np.array(anchored)]


def list_planes_at(
    members: list[LinearVolume], rows: np.ndarray, corners: np.ndarray
) -> list[list[CornerPlane]]:
    """By corner (c, 2), the planes that points show of the members that reach it, no lower or higher there than NEAR_M from the roof."""
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
    """Whether the crease of two planes lies beside the corner at which they were looked at, but not at it.

    The slopes of one volume and the level plane of another cross along an eave, which ends in no corner.
    """
    if plane.member != other.member and LEVEL in (plane.number, other.number):
        return False
    gap = abs(plane.height - other.height)
    if gap >= NEAR_M:
        return False
    slope_break = measure_break(plane, other)
    return slope_break > LEAST_BREAK and ENDS_IN_CORNER_M < gap / slope_break < NEAR_M


def measure_break(plane: CornerPlane, other: CornerPlane) -> float:
    """By how much (rise over run) two planes fall differently."""
    a, b, _ = (plane.coefficients - other.coefficients).tolist()
    return math.hypot(a, b)


def is_fold_line(
    plane: CornerPlane,
    other: CornerPlane,
    corner: np.ndarray,
    members: list[LinearVolume],
    rows: np.ndarray,
) -> bool:
    """Whether two planes meet on the roof, a step from the corner on either side along their crease."""
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
