"""Face planes of two volumes one way where they may be one plane.

A volume's planes face along its axes, or square to its sides, and those of another a degree off.
Two that are one in truth then cross at a flat angle. The smaller one is turned to face as the
larger one does, if the points allow that both are one plane.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from .clusters import (
    Basis,
    constrain,
    count_free,
    free_member,
    join_bases,
    place_planes,
    price_rows,
    solve_normal,
    sum_first_round,
)
from .conditions import (
    NEAR_M,
    Condition,
    VisiblePlane,
    compute_allowance,
    enclose_places,
    equate_planes,
    list_visible_planes,
    measure_box_gaps,
    measure_plane_gap,
    view_plane,
)
from .members import LinearVolume, turn_design
from .scene import NEAR_RAD, Scene
from .volumes import N_SIDES

APART_M = 1.0  # Planes whose points lie further apart (m) are two faces.
ONE_WAY_RAD = 1e-6  # Planes within this angle (rad) face one way.


def align_planes(members: dict[int, LinearVolume], scene: Scene) -> dict[int, LinearVolume]:
    """Turn planes that may be one with a larger plane beside them."""
    planes = [
        (k, plane)
        for k, member in members.items()
        for plane in list_visible_planes(member)
        if plane.number < N_SIDES
    ]
    planes.sort(key=lambda item: -item[1].places.shape[1])
    if len(planes) < 2:
        return members
    boxes = enclose_places(plane for _, plane in planes)
    facing = np.array([math.atan2(*plane.coefficients[1::-1]) for _, plane in planes])
    for i in range(1, len(planes)):
        k, plane = planes[i]
        turns = np.remainder(facing[:i] - facing[i] + math.pi, 2.0 * math.pi) - math.pi
        is_near = measure_box_gaps(boxes[:i], boxes[i]) < APART_M
        is_near &= (np.abs(turns) < NEAR_RAD) & (np.abs(turns) > ONE_WAY_RAD)
        for j in np.flatnonzero(is_near).tolist():
            pair = k, planes[j][0]
            if pair[0] == pair[1]:
                continue
            other = view_plane(members[pair[1]], planes[j][1].number)
            if measure_plane_gap(plane, other) >= NEAR_M:
                continue
            turned = members | {k: turn_plane(members[k], plane.number, float(turns[j]))}
            new_plane = view_plane(turned[k], plane.number)
            if is_one_plane(new_plane, other, pair, members, turned, scene):
                members, facing[i] = turned, facing[j]
                break
    return members


def turn_plane(member: LinearVolume, p: int, angle: float) -> LinearVolume:
    """Turn plane p of a member by an angle (rad).

    It turns about the middle of its points, and keeps its slope.
    """
    c, s = math.cos(angle) - 1.0, math.sin(angle)
    middle = member.points[:2, member.visible[p]].mean(axis=1)
    design, change = member.design.copy(), np.array([[c, -s], [s, c]]) @ member.design[p, :2]
    design[p] += np.array([*change, -middle @ change])
    rows = np.where(np.isfinite(member.rows), design @ member.unknowns, np.nan)
    return replace(member, rows=rows, design=design, common_design=turn_design(design, member.turn))


def is_one_plane(
    plane: VisiblePlane,
    other: VisiblePlane,
    pair: tuple[int, int],
    members: dict[int, LinearVolume],
    turned: dict[int, LinearVolume],
    scene: Scene,
) -> bool:
    """Return whether two planes may be one.

    They belong to a `pair` of members: `members` before the first is turned, `turned` after it.
    """
    left, right = equate_planes(plane, other)
    condition = Condition(0.0, dict(zip(pair, (left, right), strict=True)))
    basis = join_bases(free_member(k, members[k]) for k in pair)
    free = constrain(basis, condition.equation)
    n_saved = count_free(basis) - count_free(free)
    most_cost = price_basis(basis, members, scene)
    most_cost += compute_allowance(condition, n_saved, members, scene)
    return price_basis(free, turned, scene) <= most_cost


def price_basis(basis: Basis, members: dict[int, LinearVolume], scene: Scene) -> float:
    """Return what the points cost after the first round of a fit of a basis' members."""
    sums = {k: sum_first_round(members[k], members[k].rows, scene) for k in basis}
    return price_rows(
        members, place_planes(members, solve_normal(sums, basis, members).unknowns), scene
    )
