"""Make equal what volumes have in common: planes, slopes, ridges and eaves.

A builder makes these equal. Each volume's planes are linear in a few unknowns (`finish`), so the
condition that two volumes agree is a linear equation between their unknowns. It is accepted if all
volumes, fitted together under it, explain the points as well but for the parameters that it saves.
The nearest conditions are tried first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from statistics import median
from typing import NamedTuple

import numpy as np

from .corners import list_corner_equations
from .finish import (
    LEVEL_SLACK,
    RISE_SIGN,
    ROUNDS,
    Planes,
    form_normal_equations,
    is_proper,
    read_volume_planes,
    sum_moments,
    sum_point_costs,
)
from .members import LinearVolume, list_members, solve_unknowns
from .objective import compute_misfits
from .prices import FOLD_UNITS, PARAMETER_COST
from .scene import Scene
from .sides import Side
from .volumes import DIRECTION, N_SIDES, REPLACES, U0, U1, V0, V1, compute_roof_heights

NEAR_M = 0.2  # Heights further apart (m) are not tried as one.
LEVELLED_M = 0.01  # Difference in height (m) within a builder's tolerance, and a swath's.
AGREEMENT_SIGMAS = 2.5  # Larger differences must be within so many standard deviations.
# Difference (m) that nobody builds: accepted conditions have brought two heights so near.
REACHED_M = 0.003
# Ridge, as a share of the mean diagonal of the normal equations. It keeps unknowns that no point
# determines.
RIDGE = 1e-9
LEVEL_FALL = 1e-9  # Slope (rise over run) that is numerically level.
NO_REMAINDER = 1e-6  # An equation of which the others leave less holds because of them.
# Share of the points that agreement may leave unexplained besides. Steep planes that agree below
# their neighbours may rise above these. Only the misfit of the whole roof shows that, because each
# volume's own points lie where it is visible alone.
MOST_WORSE_SHARE = 0.02
RISEN_SHARE = 0.1  # Share by which the points of one volume may cost more under its fitted planes.


@dataclass(frozen=True)
class CommonFit:
    """The fit of all members together.

    Its unknowns (p,) have this `covariance` (p, p), and are `basis` (p, q) times any. `rows` (k, 3)
    are every member's planes, `cost` is that of the points.
    """

    covariance: np.ndarray
    rows: list[np.ndarray]
    cost: float
    basis: np.ndarray


class Condition(NamedTuple):
    """An `equation` (m, p) that nearly holds between a `pair` of members.

    `gap` is the height (m) by which it fails, `allowed` the one that is accepted whatever the
    points' deviations. `spared` are units that it saves besides its parameters.
    """

    gap: float
    pair: tuple[int, int]
    equation: np.ndarray
    allowed: float = LEVELLED_M
    spared: float = 0.0


class Agreement(NamedTuple):
    """The planes of all volumes fitted together.

    `members` are by their volume's number. `basis` (p, q) spans the unknowns that the accepted
    equations leave free, and `start` (p,) is where they began.
    """

    planes: list[Planes]
    members: dict[int, LinearVolume]
    basis: np.ndarray
    start: np.ndarray


def agree_planes(
    volumes: np.ndarray, sides: list[list[Side]], planes: list[Planes], scene: Scene
) -> Agreement:
    """Fit the planes of all volumes together, with what they have in common equal.

    Planes that rise above other volumes are first restored. Fold lines that end beside a corner of
    the outline are moved into it.
    """
    planes, misfit = restore_risen_planes(volumes, planes, scene)
    members = list_members(volumes, sides, planes, scene)
    member_list = list(members.values())
    if not member_list:
        return Agreement(planes, members, np.zeros((0, 0)), np.zeros(0))
    start = solve_unknowns(member_list)
    separate = Agreement(planes, members, np.eye(len(start)), start)
    at_corners = (
        Condition(*condition, np.inf, FOLD_UNITS)
        for condition in list_corner_equations(member_list, start, scene.corners[0])
    )
    conditions = sorted(
        (*find_likely_conditions(member_list, start), *at_corners),
        key=lambda condition: condition.gap,
    )
    common = fit_conditions(member_list, start, conditions, scene) if conditions else None
    if common is None:
        return separate
    agreed_planes = list(planes)
    for k, member, rows in zip(members, member_list, common.rows, strict=True):
        agreed_planes[k] = replace(
            planes[k], rows=rows, design=member.full_design, covariance=common.covariance
        )
    misfits, _ = measure_misfits(volumes, agreed_planes, scene)
    if misfits.sum() - misfit > MOST_WORSE_SHARE * scene.n:
        return separate
    return Agreement(agreed_planes, members, common.basis, start)


def measure_misfits(
    volumes: np.ndarray, planes: list[Planes], scene: Scene
) -> tuple[np.ndarray, np.ndarray]:
    """Return what each point costs under `planes`, and the volume visible there.

    Both are arrays (n,).
    """
    n = scene.n
    heights, top = np.full(n, -np.inf), np.zeros(n, int)
    for k, (volume, volume_planes) in enumerate(zip(volumes, planes, strict=True)):
        u, v = scene.U[int(volume[DIRECTION]), :n], scene.V[int(volume[DIRECTION]), :n]
        inside = (u >= volume[U0]) & (u <= volume[U1]) & (v >= volume[V0]) & (v <= volume[V1])
        numbers = np.flatnonzero(inside)
        rows = volume_planes.rows[np.isfinite(volume_planes.rows[:, 2])]
        z = (rows @ np.array([u[numbers], v[numbers], np.ones(len(numbers))])).min(axis=0)
        shows = np.full(len(numbers), True) if volume[REPLACES] else z > heights[numbers]
        heights[numbers[shows]], top[numbers[shows]] = z[shows], k
    return compute_misfits(scene.z[:n], heights, scene), top


def restore_risen_planes(
    volumes: np.ndarray, planes: list[Planes], scene: Scene
) -> tuple[list[Planes], float]:
    """Return the planes, as the search left them where a volume rises above others.

    Planes are fitted to the points over which their volume is visible. Where it is hidden, such as
    one of two gables of nearly the same slopes, they may come out above the other and fit less.
    Also returns what all points cost.
    """
    planes, risen = list(planes), np.zeros(len(planes), bool)
    heights, _ = compute_roof_heights(volumes, scene.U, scene.V, scene.order)
    search_misfits = compute_misfits(scene.z[: scene.n], heights[: scene.n], scene)
    while True:
        misfits, top = measure_misfits(volumes, planes, scene)
        excess = np.bincount(top, misfits - search_misfits - RISEN_SHARE, len(planes))
        excess[risen] = 0.0
        k = int(np.argmax(excess))
        if excess[k] <= 0.0:
            return planes, float(misfits.sum())
        planes[k], risen[k] = read_volume_planes(volumes[k], scene), True


def fit_conditions(
    members: list[LinearVolume], start: np.ndarray, conditions: list[Condition], scene: Scene
) -> CommonFit | None:
    """Fit the members under as many of the `conditions` as hold, one after another.

    Returns None if no condition holds. The covariance is what the points determine: a corner of the
    outline gives the place where planes meet, but not how precise it is.
    """
    begun = sum_at_start(members, scene)
    accepted = choose_conditions(members, start, conditions, begun, scene)
    if not accepted:
        return None
    basis = find_null_space(np.vstack([condition.equation for condition in accepted]))
    fit = fit_members(members, basis, start, scene, begun)
    if not math.isfinite(fit.cost):
        return None
    by_points = [condition.equation for condition in accepted if not condition.spared]
    if len(by_points) < len(accepted):
        free = find_null_space(np.vstack(by_points)) if by_points else np.eye(len(start))
        covariance = fit_members(members, free, start, scene, begun).covariance
        fit = replace(fit, covariance=covariance)
    return fit


def choose_conditions(
    members: list[LinearVolume],
    start: np.ndarray,
    conditions: list[Condition],
    sums: NormalSums,
    scene: Scene,
) -> list[Condition]:
    """Choose the conditions that hold, one after another.

    The normal equations of all members give the planes under a condition, and the points say what
    these cost.
    """
    accepted: list[Condition] = []
    solution = solve_normal(sums, np.eye(len(start)), start)
    covariance = solution.inverse * (sums.misfit / max(sums.weight, 1.0))
    cost = sum_row_costs(members, place_planes(members, solution.unknowns), scene)
    while conditions:
        later, n_before = [], len(accepted)
        for condition in conditions:
            equation = condition.equation
            is_near = (
                condition.gap <= condition.allowed
                or condition.gap * measure_remainder(equation, start, solution.unknowns)
                <= REACHED_M
            )
            if not is_near and not is_within_noise(equation, start, covariance):
                later.append(condition)  # accepted ones may bring it nearer
                continue
            free = constrain(solution.basis, equation)
            n_saved = solution.basis.shape[1] - free.shape[1]
            if n_saved == 0:
                continue
            trial = solve_normal(sums, free, start)
            trial_cost = price_rows(members, place_planes(members, trial.unknowns), scene)
            if trial_cost <= cost + compute_allowance(condition, n_saved, members, scene):
                accepted, solution, cost = [*accepted, condition], trial, trial_cost
        conditions = later if len(accepted) > n_before else []
    return accepted


def constrain(basis: np.ndarray, equation: np.ndarray) -> np.ndarray:
    """Return a basis (p, r) of what solves `equation` (m, p) in a `basis` (p, q)."""
    return basis @ find_null_space(equation @ basis)


def solve_normal(sums: NormalSums, basis: np.ndarray, start: np.ndarray) -> Solution:
    """Solve normal equations for unknowns (p,) that are `basis` (p, q) times any."""
    ridge = RIDGE * max(np.trace(sums.normal) / len(start), 1e-6)
    matrix = basis.T @ sums.normal @ basis + ridge * np.eye(basis.shape[1])
    inverse = basis @ np.linalg.inv(matrix) @ basis.T
    return Solution(inverse @ (sums.right + ridge * start), inverse, basis)


def place_planes(members: list[LinearVolume], unknowns: np.ndarray) -> list[np.ndarray]:
    """Return each member's planes (k, 3) under unknowns (p,), NaN without one."""
    return [
        np.where(np.isfinite(member.rows), member.full_design @ unknowns, np.nan)
        for member in members
    ]


def price_rows(members: list[LinearVolume], rows: list[np.ndarray], scene: Scene) -> float:
    """Return what the points of members cost, infinite where planes are improper."""
    pairs = zip(members, rows, strict=True)
    if not all(is_proper(planes, member.walls) for member, planes in pairs):
        return math.inf
    return sum_row_costs(members, rows, scene)


def compute_allowance(
    condition: Condition, n_saved: int, members: list[LinearVolume], scene: Scene
) -> float:
    """Return the points that an accepted condition may leave unexplained.

    It saves `n_saved` parameters.
    """
    slack = LEVEL_SLACK * sum(members[k].points.shape[1] for k in condition.pair)
    return float(scene.evidence * (PARAMETER_COST * n_saved + condition.spared) + slack)


def measure_remainder(equation: np.ndarray, start: np.ndarray, unknowns: np.ndarray) -> float:
    """Return the share by which an equation still fails, of how far it did at `start`."""
    return float(
        np.abs(equation @ unknowns).max() / max(np.abs(equation @ start).max(), NO_REMAINDER)
    )


def is_within_noise(equation: np.ndarray, unknowns: np.ndarray, covariance: np.ndarray) -> bool:
    """Return whether `equation` (m, p) fails by no more than the points leave open."""
    sigma = np.sqrt(np.maximum(((equation @ covariance) * equation).sum(axis=1), 0.0))
    return bool((np.abs(equation @ unknowns) < AGREEMENT_SIGMAS * sigma).all())


class VisiblePlane(NamedTuple):
    """A plane of a member on which points lie.

    `coefficients` a, b, c (3,) are in the first direction's axes, and `equation` (3, p) gives them
    by all unknowns. `places` (3, n) are u, v, 1 of its points.
    """

    number: int
    coefficients: np.ndarray
    equation: np.ndarray
    places: np.ndarray


class Dimension(NamedTuple):
    """A height or a slope of a member, by all unknowns (p,).

    `reach` (m) times it is a height.
    """

    value: float
    equation: np.ndarray
    reach: float


def find_likely_conditions(members: list[LinearVolume], start: np.ndarray) -> Iterator[Condition]:
    """Yield the conditions that nearly hold between members at the unknowns `start`."""
    planes = [list_visible_planes(member, start) for member in members]
    measures = [
        [
            list(kind)
            for kind in (
                list_slopes(member, start),
                list_ridges(member, start),
                list_eaves(member, start),
            )
        ]
        for member in members
    ]
    for j, k in combinations(range(len(members)), 2):
        for plane in planes[j]:
            for other in planes[k]:
                gap = measure_plane_gap(plane, other)
                if gap < NEAR_M:
                    yield Condition(gap, (j, k), equate_planes(plane, other))
        for dimensions, other_dimensions in zip(measures[j], measures[k], strict=True):
            for x in dimensions:
                for y in other_dimensions:
                    gap = max(x.reach, y.reach) * abs(x.value - y.value)
                    if gap < NEAR_M:
                        yield Condition(gap, (j, k), (x.equation - y.equation)[None])


def list_visible_planes(member: LinearVolume, start: np.ndarray) -> list[VisiblePlane]:
    common, places = member.common_design @ start, member.places
    return [
        VisiblePlane(p, common[p], member.common_design[p], places[:, numbers])
        for p, numbers in member.visible.items()
    ]


def measure_plane_gap(plane: VisiblePlane, other: VisiblePlane) -> float:
    """Return how far apart (m) two planes are at most where their points are.

    The gap is infinite where they are not near at the first of these.
    """
    difference = plane.coefficients - other.coefficients
    if max(abs(float(difference @ item.places[:, 0])) for item in (plane, other)) >= NEAR_M:
        return np.inf
    return max(float(np.abs(difference @ item.places).max()) for item in (plane, other))


def equate_planes(plane: VisiblePlane, other: VisiblePlane) -> np.ndarray:
    """Return the equation (2, p) by which two planes are one.

    They are as high in the middle of their points, and as steep. The way that each faces is known
    before.
    """
    difference = plane.equation - other.equation
    middle = 0.5 * (plane.places.mean(axis=1) + other.places.mean(axis=1))
    a, b, _ = plane.coefficients + other.coefficients
    along = np.array([a, b, 0.0]) / max(math.hypot(a, b), LEVEL_FALL)
    return np.stack([middle, along]) @ difference


def list_slopes(member: LinearVolume, start: np.ndarray) -> Iterator[Dimension]:
    """Yield the slopes of a member's inclined planes.

    Half of the length of their points along the fall makes them heights.
    """
    for p, numbers in member.visible.items():
        if p < N_SIDES:
            along = member.points[p // 2, numbers]
            equation = RISE_SIGN[p] * member.full_design[p, p // 2]
            yield Dimension(
                float(equation @ start), equation, 0.5 * float(along.max() - along.min())
            )


def list_ridges(member: LinearVolume, start: np.ndarray) -> Iterator[Dimension]:
    """Yield the heights of a member's ridges, as they change from `start`."""
    for p, q in ((0, 1), (2, 3)):
        if p in member.visible and q in member.visible:
            axis, rows = p // 2, member.full_design[[p, q]] @ start
            rise, fall = rows[0, axis], -rows[1, axis]
            place = np.ones(3)
            place[1 - axis] = median(member.points[1 - axis].tolist())
            place[axis] = (
                (rows[1] - rows[0])[[1 - axis, 2]] @ (place[1 - axis], 1.0) / (rise + fall)
            )
            equation = (
                place
                @ (fall * member.full_design[p] + rise * member.full_design[q])
                / (rise + fall)
            )
            yield Dimension(float(equation @ start), equation, 1.0)


def list_eaves(member: LinearVolume, start: np.ndarray) -> Iterator[Dimension]:
    """Yield the heights of a member's eaves on the outline."""
    for p in member.visible:
        if p < N_SIDES and member.sides[p].anchored:
            equation = (
                member.full_design[p, 2] + member.sides[p].offset * member.full_design[p, p // 2]
            )
            yield Dimension(float(equation @ start), equation, 1.0)


def find_null_space(equations: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (p, q) of the unknowns that solve `equations`.

    These are (m, p), and zero for each of those unknowns.
    """
    _, values, rows = np.linalg.svd(equations)
    return rows[int((values > NO_REMAINDER).sum()) :].T


class NormalSums(NamedTuple):
    """The normal equations of all members' unknowns.

    `normal` (p, p) and `right` (p,) are their two sides, `weight` is the sum of the points'
    weights, and `misfit` that of their weighted squared residuals.
    """

    normal: np.ndarray
    right: np.ndarray
    weight: float
    misfit: float


class Solution(NamedTuple):
    """The unknowns (p,) that solve normal equations among those of a `basis` (p, q).

    `inverse` (p, p) is that of the equations there.
    """

    unknowns: np.ndarray
    inverse: np.ndarray
    basis: np.ndarray


def sum_at_start(members: list[LinearVolume], scene: Scene) -> NormalSums:
    """Return the sums in the first round of a fit, from the members' own planes."""
    return sum_equations(
        members, [member.rows for member in members], 2.0 * (scene.dead + scene.width)
    )


def sum_equations(members: list[LinearVolume], rows: list[np.ndarray], reach: float) -> NormalSums:
    """Return the sums over points within `reach` (m) of the members' planes `rows`."""
    size = members[0].full_design.shape[2]
    normal, right, total, misfit = np.zeros((size, size)), np.zeros(size), 0.0, 0.0
    for member, planes in zip(members, rows, strict=True):
        moments, products, weight, left = sum_moments(planes, member.points, reach)
        is_present = np.isfinite(planes[:, 2])
        matrix, vector = form_normal_equations(member.design, moments, products, is_present)
        unknowns = slice(member.first, member.first + len(vector))
        normal[unknowns, unknowns], right[unknowns] = matrix, vector
        total, misfit = total + weight, misfit + left
    return NormalSums(normal, right, total, misfit)


def fit_members(
    members: list[LinearVolume],
    basis: np.ndarray,
    start: np.ndarray,
    scene: Scene,
    sums: NormalSums,
) -> CommonFit:
    """Fit all planes by biweighted least squares.

    The unknowns (p,) are `basis` (p, q) times any. `sums` are those of the first round.
    """
    rows, scale = [member.rows for member in members], scene.dead + scene.width
    for turn in range(ROUNDS):
        sums = sums if turn == 0 else sum_equations(members, rows, 1.5 * scale)
        solution = solve_normal(sums, basis, start)
        rows = place_planes(members, solution.unknowns)
    covariance = solution.inverse * sums.misfit / max(sums.weight, 1.0)
    return CommonFit(covariance, rows, price_rows(members, rows, scene), basis)


def sum_row_costs(members: list[LinearVolume], rows: list[np.ndarray], scene: Scene) -> float:
    """Sum up what the points of members cost under their planes `rows` (k, 3)."""
    pairs = zip(members, rows, strict=True)
    return float(
        sum(
            sum_point_costs(volume_rows, member.points, scene.dead, scene.width)
            for member, volume_rows in pairs
        )
    )
