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

from .members import Member, heights_at, rows_at
from .sides import CORNER_SIDES, corners_of
from .volumes import LEVEL

# m by plan and by height within which a crease is asked to end in a corner: clouds lie a decimetre
# beside their outlines
NEAR_M = 0.2
AT_CORNER_M = 0.01  # one that ends so near does
REACH_M = 0.4  # a volume that ends so near a corner is drawn on to it
LEAST_BREAK = 0.1  # rise over run; planes less apart have no crease to speak of
FROM_CORNER_M, ON_ROOF_M = 0.6, 0.02  # where beside the corner a crease must be on the roof, and how nearly


class Plane(NamedTuple):
    """A member's plane at a corner: whose, which, its height there and a, b, c (3,) in the first direction's axes."""

    member: int
    number: int
    height: float
    coefficients: np.ndarray


def creases_at_corners(
    members: list[Member], start: np.ndarray, ring: np.ndarray
) -> Iterator[tuple[float, tuple[int, int], np.ndarray]]:
    """Equations (1, p) between planes that meet beside a corner, of the outline's `ring` (c, 2) or where a step ends at it, at the
    unknowns `start` (p,): how far apart in height (m) they are there, and between which two members."""
    rows = rows_at(members, start)
    corners = np.vstack([ring, *(own_corners(member, ring) for member in members)])
    for corner, planes in zip(corners, planes_at(members, rows, corners), strict=True):
        at = np.array([*corner, 1.0])
        for one, other in combinations(planes, 2):
            if meet_beside(one, other) and is_crease(one, other, corner, members, rows):
                equation = at @ (members[one.member].common[one.number] - members[other.member].common[other.number])
                yield abs(one.height - other.height), (one.member, other.member), equation[None]


def own_corners(member: Member, ring: np.ndarray) -> np.ndarray:
    """The places (m, 2) besides the `ring`'s corners where a member's sides meet, one of which lies on the outline."""
    c, s = member.turn
    corners = corners_of(member.sides) @ np.array([[c, s], [-s, c]])
    anchored = [member.sides[k].anchored or member.sides[j].anchored for k, j in CORNER_SIDES]
    apart = np.hypot(*(corners[:, None] - ring).T).min(axis=0) > AT_CORNER_M
    return corners[apart & np.array(anchored)]


def planes_at(members: list[Member], rows: np.ndarray, corners: np.ndarray) -> list[list[Plane]]:
    """By corner (c, 2), the planes that points show of the members that reach it, no lower or higher there than NEAR_M from the roof."""
    each = rows @ np.column_stack([corners, np.ones(len(corners))]).T
    heights = heights_at(members, rows, corners, REACH_M)
    near = (heights > heights.max(axis=0) - NEAR_M)[:, None] & (each < heights[:, None] + NEAR_M)
    near &= np.array([[p in member.seen for p in range(rows.shape[1])] for member in members])[:, :, None]
    found: list[list[Plane]] = [[] for _ in corners]
    for c, k, p in np.argwhere(near.transpose(2, 0, 1)).tolist():
        found[c].append(Plane(k, p, float(each[k, p, c]), rows[k, p]))
    return found


def meet_beside(one: Plane, other: Plane) -> bool:
    """Whether the crease of two planes lies beside the corner at which they were looked at, but not at it.

    The slopes of one volume and the level plane of another cross along an eave, which ends in no corner.
    """
    if one.member != other.member and LEVEL in (one.number, other.number):
        return False
    gap = abs(one.height - other.height)
    if gap >= NEAR_M:
        return False
    apart = break_of(one, other)
    return apart > LEAST_BREAK and AT_CORNER_M < gap / apart < NEAR_M


def break_of(one: Plane, other: Plane) -> float:
    """By how much (rise over run) two planes fall differently."""
    a, b, _ = (one.coefficients - other.coefficients).tolist()
    return math.hypot(a, b)


def is_crease(one: Plane, other: Plane, corner: np.ndarray, members: list[Member], rows: np.ndarray) -> bool:
    """Whether two planes meet on the roof, a step from the corner on either side along their crease."""
    across = (one.coefficients - other.coefficients)[:2] / break_of(one, other)
    foot = corner - across * (one.height - other.height) / break_of(one, other)
    places = foot + np.array([[-FROM_CORNER_M], [FROM_CORNER_M]]) * np.array([-across[1], across[0]])
    heights, z = heights_at(members, rows, places), places @ one.coefficients[:2] + one.coefficients[2]
    on_roof = np.abs(z - heights[[one.member, other.member]]).max(axis=0) < ON_ROOF_M
    return bool((on_roof & (heights.max(axis=0) < z + ON_ROOF_M)).any())
