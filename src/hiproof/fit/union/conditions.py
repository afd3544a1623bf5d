"""Find what nearly is equal between volumes: planes, slopes, ridges and eaves.

Each volume's planes are linear in a few unknowns (`finish`), so the condition that two volumes
agree is a linear equation between their unknowns.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from statistics import median
from typing import NamedTuple

import numpy as np

from .add import MOST_VOLUMES
from .clusters import Equation
from .finish import LEVEL_SLACK, RISE_SIGN
from .members import LinearVolume
from .prices import PARAMETER_COST
from .scene import Scene
from .volumes import N_SIDES

NEAR_M = 0.2  # Heights further apart (m) are not tried as one.
LEVELLED_M = 0.01  # Difference in height (m) within a builder's tolerance, and a swath's.
LEVEL_FALL = 1e-9  # Slope (rise over run) that is numerically level.


class Condition(NamedTuple):
    """An `equation` that nearly holds between two members.

    `gap` is the height (m) by which it fails, `allowed` the one that is accepted whatever the
    points' deviations. `spared` are units that it saves besides its parameters. It ties at most
    `most_tied` members: any number may have one plane, but equal slopes would tie all of a block.
    """

    gap: float
    equation: Equation
    allowed: float = LEVELLED_M
    spared: float = 0.0
    most_tied: float = np.inf


def compute_allowance(
    condition: Condition, n_saved: int, members: dict[int, LinearVolume], scene: Scene
) -> float:
    """Return the points that an accepted condition may leave unexplained.

    It saves `n_saved` parameters.
    """
    slack = LEVEL_SLACK * sum(members[k].points.shape[1] for k in condition.equation)
    return float(scene.evidence * (PARAMETER_COST * n_saved + condition.spared) + slack)


class VisiblePlane(NamedTuple):
    """A plane of a member on which points lie.

    `coefficients` a, b, c (3,) are in the first direction's axes, and `equation` (3, q) gives them
    by the member's unknowns. `places` (3, n) are u, v, 1 of its points.
    """

    number: int
    coefficients: np.ndarray
    equation: np.ndarray
    places: np.ndarray


class Dimension(NamedTuple):
    """A height or a slope of a member, by its unknowns (q,).

    `reach` (m) times it is a height.
    """

    value: float
    equation: np.ndarray
    reach: float


def find_likely_conditions(members: dict[int, LinearVolume]) -> Iterator[Condition]:
    """Yield the conditions that nearly hold between members."""
    planes = {k: list_visible_planes(member) for k, member in members.items()}
    measures = {
        k: [list(kind(member)) for kind in (list_slopes, list_ridges, list_eaves)]
        for k, member in members.items()
    }
    for j, k in list_neighbours(members):
        for plane in planes[j]:
            for other in planes[k]:
                gap = measure_plane_gap(plane, other)
                if gap < NEAR_M:
                    left, right = equate_planes(plane, other)
                    yield Condition(gap, {j: left, k: right})
        for dimensions, other_dimensions in zip(measures[j], measures[k], strict=True):
            for x in dimensions:
                for y in other_dimensions:
                    gap = max(x.reach, y.reach) * abs(x.value - y.value)
                    if gap < NEAR_M:
                        equation = {j: x.equation[None], k: -y.equation[None]}
                        yield Condition(gap, equation, most_tied=MOST_VOLUMES)


def list_neighbours(members: dict[int, LinearVolume]) -> list[tuple[int, int]]:
    """List the pairs of members that are tried as equal.

    These are each member and the MOST_VOLUMES nearest to it, by the boxes around their points.
    """
    numbers = list(members)
    boxes = enclose_places(members.values())
    gaps = measure_box_gaps(boxes[:, None], boxes)
    nearest = np.argsort(gaps, axis=1, kind="stable")[:, : MOST_VOLUMES + 1].tolist()
    pairs = {(min(j, k), max(j, k)) for j, row in enumerate(nearest) for k in row if j != k}
    return [(numbers[j], numbers[k]) for j, k in sorted(pairs)]


def enclose_places(items: Iterable[LinearVolume | VisiblePlane]) -> np.ndarray:
    """Return the boxes (n, 2, 2) around the places of members or planes.

    These are their lowest and highest u, v.
    """
    return np.array([[item.places[:2].min(axis=1), item.places[:2].max(axis=1)] for item in items])


def measure_box_gaps(boxes: np.ndarray, other_boxes: np.ndarray) -> np.ndarray:
    """Return how far apart (m) boxes (..., 2, 2) lie along an axis at most.

    It is below 0 where they overlap.
    """
    return np.maximum(
        boxes[..., 0, :] - other_boxes[..., 1, :], other_boxes[..., 0, :] - boxes[..., 1, :]
    ).max(axis=-1)


def list_visible_planes(member: LinearVolume) -> list[VisiblePlane]:
    return [view_plane(member, p) for p in member.visible]


def view_plane(member: LinearVolume, p: int) -> VisiblePlane:
    design = member.common_design[p]
    return VisiblePlane(p, design @ member.unknowns, design, member.places[:, member.visible[p]])


def measure_plane_gap(plane: VisiblePlane, other: VisiblePlane) -> float:
    """Return how far apart (m) two planes are at most where their points are.

    The gap is infinite where they are not near at the first of these.
    """
    difference = plane.coefficients - other.coefficients
    if max(abs(float(difference @ item.places[:, 0])) for item in (plane, other)) >= NEAR_M:
        return np.inf
    return max(float(np.abs(difference @ item.places).max()) for item in (plane, other))


def equate_planes(plane: VisiblePlane, other: VisiblePlane) -> tuple[np.ndarray, np.ndarray]:
    """Return the factors (2, q) of both members' unknowns by which two planes are one.

    They are as high in the middle of their points, and as steep. The way that each faces is known
    before.
    """
    middle = 0.5 * (plane.places.mean(axis=1) + other.places.mean(axis=1))
    a, b, _ = plane.coefficients + other.coefficients
    along = np.array([a, b, 0.0]) / max(math.hypot(a, b), LEVEL_FALL)
    measured = np.stack([middle, along])
    return measured @ plane.equation, -measured @ other.equation


def list_slopes(member: LinearVolume) -> Iterator[Dimension]:
    """Yield the slopes of a member's inclined planes.

    Half of the length of their points along the fall makes them heights.
    """
    for p, numbers in member.visible.items():
        if p < N_SIDES:
            along = member.points[p // 2, numbers]
            equation = RISE_SIGN[p] * member.design[p, p // 2]
            yield Dimension(
                float(equation @ member.unknowns), equation, 0.5 * float(along.max() - along.min())
            )


def list_ridges(member: LinearVolume) -> Iterator[Dimension]:
    """Yield the heights of a member's ridges."""
    for p, q in ((0, 1), (2, 3)):
        if p in member.visible and q in member.visible:
            axis, rows = p // 2, member.design[[p, q]] @ member.unknowns
            rise, fall = rows[0, axis], -rows[1, axis]
            place = np.ones(3)
            place[1 - axis] = median(member.points[1 - axis].tolist())
            place[axis] = (
                (rows[1] - rows[0])[[1 - axis, 2]] @ (place[1 - axis], 1.0) / (rise + fall)
            )
            equation = place @ (fall * member.design[p] + rise * member.design[q]) / (rise + fall)
            yield Dimension(float(equation @ member.unknowns), equation, 1.0)


def list_eaves(member: LinearVolume) -> Iterator[Dimension]:
    """Yield the heights of a member's eaves on the outline."""
    for p in member.visible:
        if p < N_SIDES and member.sides[p].anchored:
            equation = member.design[p, 2] + member.sides[p].offset * member.design[p, p // 2]
            yield Dimension(float(equation @ member.unknowns), equation, 1.0)
