"""What volumes have in common: planes, slopes, ridges and eaves that a builder makes equal.

Each volume's planes are linear in a few unknowns (`finish`), so that two volumes agree is a linear equation between their
unknowns. It holds where all volumes, fitted together under it, explain the points as well but for what it saves. The
nearest are tried first, and what holds is kept.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import accumulate, combinations, pairwise
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
from .prices import CREASE_UNITS, PARAMETER_COST
from .scene import Scene
from .sides import Side
from .volumes import DIRECTION, N_SIDES, REPLACES, U0, U1, V0, V1

NEAR_M = 0.2  # heights further apart are not tried as one
# m that a builder's level allows, and a swath's height too; what is further apart must be so by chance, in standard deviations
LEVELLED_M, AGREEMENT_SIGMAS = 0.01, 2.5
REACHED_M = 0.003  # m within which others have brought what is further apart: nobody builds such a difference
RIDGE = 1e-9  # of the mean diagonal of the normal equations: what no point tells stays as it was
LEVEL_FALL = 1e-9  # rise over run; numerically level
NO_REMAINDER = 1e-6  # an equation that the others leave so little of holds by them
# Share of the points that agreement may leave unexplained besides. Steep planes that agree below their neighbours may
# rise above these, which only the whole roof's misfit shows: each volume's own points lie where it shows alone.
MOST_WORSE_SHARE = 0.02
# by which the points over which one volume shows may cost more under its fitted planes
RISEN_SHARE = 0.1


@dataclass(frozen=True)
class CommonFit:
    """The unknowns (p,) and their covariance (p, p), every member's rows (k, 3) and what the points cost."""

    unknowns: np.ndarray
    covariance: np.ndarray
    rows: list[np.ndarray]
    cost: float
    basis: np.ndarray


class Condition(NamedTuple):
    """An equation (m, p) that nearly holds: how far in height (m) from it, between which two members, how far it may be whatever the
    points' deviations, and units that are spared besides its parameters."""

    gap: float
    pair: tuple[int, int]
    equation: np.ndarray
    allowed: float = LEVELLED_M
    spared: float = 0.0


class Agreement(NamedTuple):
    """All volumes' planes fitted together, the members by their volume's number, and the unknowns: those that the
    equations which hold leave free, as a basis (p, q), and where they started (p,).

    `cost` is that of the members' points, None where nothing was fitted together.
    """

    planes: list[Planes]
    members: dict[int, LinearVolume]
    basis: np.ndarray
    start: np.ndarray
    cost: float | None = None


def agree_planes(
    volumes: np.ndarray, sides: list[list[Side]], planes: list[Planes], scene: Scene
) -> Agreement:
    """The planes of all volumes fitted together, equal in what they have in common and at the corners of the outline."""
    members = list_members(volumes, sides, planes, scene)
    members_known = list(members.values())
    if not members_known:
        return Agreement(planes, members, np.zeros((0, 0)), np.zeros(0))
    start = solve_unknowns(members_known)
    separate = Agreement(planes, members, np.eye(len(start)), start)
    at_corners = (
        Condition(*condition, np.inf, CREASE_UNITS)
        for condition in list_corner_equations(members_known, start, scene.corners[0])
    )
    conditions = sorted(
        (*find_likely_conditions(members_known, start), *at_corners),
        key=lambda condition: condition.gap,
    )
    common = fit_conditions(members_known, start, conditions, scene) if conditions else None
    if common is None:
        return separate
    agreed_planes = list(planes)
    for k, member, rows in zip(members, members_known, common.rows, strict=True):
        agreed_planes[k] = replace(
            planes[k], rows=rows, design=member.full_design, covariance=common.covariance
        )
    worse = sum_misfit(volumes, agreed_planes, scene) - sum_misfit(volumes, planes, scene)
    if worse > MOST_WORSE_SHARE * scene.n:
        return separate
    return Agreement(agreed_planes, members, common.basis, start, common.cost)


def sum_misfit(volumes: np.ndarray, planes: list[Planes], scene: Scene) -> float:
    """Sum up what all points cost (points) under `planes`, each volume within its rectangle."""
    return float(measure_misfits(volumes, planes, scene)[0].sum())


def measure_misfits(
    volumes: np.ndarray, planes: list[Planes], scene: Scene
) -> tuple[np.ndarray, np.ndarray]:
    """Return what each point costs under `planes`, and which volume shows there: two arrays (n,)."""
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


def restore_risen_planes(volumes: np.ndarray, planes: list[Planes], scene: Scene) -> list[Planes]:
    """Return the planes, as the search found them where a volume rises above others and fits less.

    Planes are fitted to the points over which their volume shows. Where it lies hidden, such as one
    of two gables of nearly the same slopes, they may come out above the other.
    """
    planes = list(planes)
    search_planes = [read_volume_planes(row, scene) for row in volumes]
    search_misfits, _ = measure_misfits(volumes, search_planes, scene)
    while True:
        misfits_now, top = measure_misfits(volumes, planes, scene)
        worse = np.bincount(top, misfits_now - search_misfits, len(planes))
        worse[
            [
                volume_planes is as_found
                for volume_planes, as_found in zip(planes, search_planes, strict=True)
            ]
        ] = 0.0
        excess = worse - RISEN_SHARE * np.bincount(top, minlength=len(planes))
        k = int(np.argmax(excess))
        if excess[k] <= 0.0:
            return planes
        planes[k] = search_planes[k]


def fit_conditions(
    members: list[LinearVolume], start: np.ndarray, conditions: list[Condition], scene: Scene
) -> CommonFit | None:
    """The fit under all that may hold of what is `conditions`, one after another; None where nothing does.

    Its covariance is what the points tell: a corner of the outline says where planes meet, not how well that is known.
    """
    equations, point_equations, basis = (
        np.zeros((0, len(start))),
        np.zeros((0, len(start))),
        np.eye(len(start)),
    )
    begun = sum_at_start(members, scene)
    best = free = fit_members(members, basis, start, scene, begun)
    if not math.isfinite(
        free.cost
    ):  # improper: members keep their planes until a proper fit is found
        rows = [member.rows for member in members]
        best = CommonFit(start, free.covariance, rows, sum_row_costs(members, rows, scene), basis)
    while conditions:
        later, n_before = [], len(equations)
        for condition in conditions:
            is_near = (
                condition.gap <= condition.allowed
                or condition.gap * measure_remainder(condition, start, best) <= REACHED_M
            )
            if not is_near and not is_within_noise(condition.equation, start, free.covariance):
                later.append(condition)  # what holds may bring it nearer
                continue
            n_saved = int(np.linalg.matrix_rank(condition.equation @ basis, tol=NO_REMAINDER))
            if n_saved == 0:
                continue
            with_it = np.vstack([equations, condition.equation])
            free_basis = find_null_space(with_it)
            trial = fit_members(members, free_basis, start, scene, begun)
            if trial.cost <= best.cost + compute_allowance(condition, n_saved, members, scene):
                equations, basis, best = with_it, free_basis, trial
                point_equations = (
                    point_equations
                    if condition.spared
                    else np.vstack([point_equations, condition.equation])
                )
        conditions = later if len(equations) > n_before else []
    if len(equations) > len(point_equations):
        as_told = fit_members(members, find_null_space(point_equations), start, scene, begun)
        best = replace(best, covariance=as_told.covariance)
    return best if len(equations) else None


def compute_allowance(
    condition: Condition, n_saved: int, members: list[LinearVolume], scene: Scene
) -> float:
    """What may stay unexplained where an equation holds that saves so many parameters (points)."""
    slack = LEVEL_SLACK * sum(members[k].points.shape[1] for k in condition.pair)
    return float(scene.evidence * (PARAMETER_COST * n_saved + condition.spared) + slack)


def measure_remainder(condition: Condition, start: np.ndarray, fit: CommonFit) -> float:
    """What is left of how far an equation was from holding at `start`."""
    return float(
        np.abs(condition.equation @ fit.unknowns).max()
        / max(np.abs(condition.equation @ start).max(), NO_REMAINDER)
    )


def is_within_noise(equation: np.ndarray, unknowns: np.ndarray, covariance: np.ndarray) -> bool:
    """Whether `equation` (m, p) is no further from holding than the points leave open."""
    sigma = np.sqrt(np.maximum(((equation @ covariance) * equation).sum(axis=1), 0.0))
    return bool((np.abs(equation @ unknowns) < AGREEMENT_SIGMAS * sigma).all())


class VisiblePlane(NamedTuple):
    """A plane of a member that its points show: its number, its coefficients a, b, c (3,) in the first direction's axes and by
    all unknowns (3, p) there, and u, v, 1 (3, n) of its points."""

    number: int
    coefficients: np.ndarray
    equation: np.ndarray
    places: np.ndarray


class Dimension(NamedTuple):
    """A height or a slope of a member: its value, by all unknowns (p,), and what it is multiplied with to be a height (m)."""

    value: float
    equation: np.ndarray
    reach: float


def find_likely_conditions(members: list[LinearVolume], start: np.ndarray) -> Iterator[Condition]:
    """What nearly holds between members at the unknowns `start`."""
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
    """How far apart (m) two planes are at most where their points are; infinite where they are not near at the first of these."""
    difference = plane.coefficients - other.coefficients
    if max(abs(float(difference @ item.places[:, 0])) for item in (plane, other)) >= NEAR_M:
        return np.inf
    return max(float(np.abs(difference @ item.places).max()) for item in (plane, other))


def equate_planes(plane: VisiblePlane, other: VisiblePlane) -> np.ndarray:
    """That two planes are one (2, p): as high in the middle of their points and as steep; which way each faces is known before."""
    difference = plane.equation - other.equation
    middle = 0.5 * (plane.places.mean(axis=1) + other.places.mean(axis=1))
    a, b, _ = plane.coefficients + other.coefficients
    along = np.array([a, b, 0.0]) / max(math.hypot(a, b), LEVEL_FALL)
    return np.stack([middle, along]) @ difference


def list_slopes(member: LinearVolume, start: np.ndarray) -> Iterator[Dimension]:
    """The slopes of a member's inclined planes; half of how far their points reach along the fall makes them heights."""
    for p, numbers in member.visible.items():
        if p < N_SIDES:
            along = member.points[p // 2, numbers]
            equation = RISE_SIGN[p] * member.full_design[p, p // 2]
            yield Dimension(
                float(equation @ start), equation, 0.5 * float(along.max() - along.min())
            )


def list_ridges(member: LinearVolume, start: np.ndarray) -> Iterator[Dimension]:
    """The heights of a member's ridges, as they change from `start`."""
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
    """The heights of a member's eaves on the outline."""
    for p in member.visible:
        if p < N_SIDES and member.sides[p].anchored:
            equation = (
                member.full_design[p, 2] + member.sides[p].offset * member.full_design[p, p // 2]
            )
            yield Dimension(float(equation @ start), equation, 1.0)


def find_null_space(equations: np.ndarray) -> np.ndarray:
    """An orthonormal basis (p, q) of all unknowns of which `equations` (m, p) are zero."""
    _, values, rows = np.linalg.svd(equations)
    return rows[int((values > NO_REMAINDER).sum()) :].T


class NormalSums(NamedTuple):
    """Normal equations of all members' unknowns (p, p) and (p,), and of their points: the sum of
    the weights, and of the weighted squares of what is left."""

    normal: np.ndarray
    right: np.ndarray
    weight: float
    misfit: float


def sum_at_start(members: list[LinearVolume], scene: Scene) -> NormalSums:
    """The sums in the first round of a fit, which starts from the members' planes."""
    return sum_equations(
        members, [member.rows for member in members], 2.0 * (scene.dead + scene.width)
    )


def sum_equations(members: list[LinearVolume], rows: list[np.ndarray], reach: float) -> NormalSums:
    """The sums over points within `reach` (m) of the members' planes `rows`."""
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
    begun: NormalSums | None = None,
) -> CommonFit:
    """All planes by biweighted least squares, over unknowns (p,) that are `basis` (p, q) times any.

    `begun` are the sums at first, where these are known.
    """
    designs, rows = (
        np.concatenate([member.full_design for member in members]),
        [member.rows for member in members],
    )
    ends = [*accumulate(map(len, rows), initial=0)]
    absent, scale = np.isnan(np.concatenate(rows)), scene.dead + scene.width
    sums = begun or sum_at_start(members, scene)
    for turn in range(ROUNDS):
        sums = sums if turn == 0 else sum_equations(members, rows, 1.5 * scale)
        ridge = RIDGE * max(np.trace(sums.normal) / len(start), 1e-6)
        matrix = basis.T @ sums.normal @ basis + ridge * np.eye(basis.shape[1])
        inverse = basis @ np.linalg.inv(matrix) @ basis.T
        unknowns = inverse @ (sums.right + ridge * start)
        all_rows = designs @ unknowns
        all_rows[absent] = np.nan
        rows = [all_rows[begin:end] for begin, end in pairwise(ends)]
    cost = sum_row_costs(members, rows, scene)
    if not all(
        is_proper(volume_rows, member.walls)
        for member, volume_rows in zip(members, rows, strict=True)
    ):
        cost = np.inf
    return CommonFit(unknowns, inverse * sums.misfit / max(sums.weight, 1.0), rows, cost, basis)


def sum_row_costs(members: list[LinearVolume], rows: list[np.ndarray], scene: Scene) -> float:
    """What the points of members cost under their planes `rows` (k, 3)."""
    pairs = zip(members, rows, strict=True)
    return float(
        sum(
            sum_point_costs(volume_rows, member.points, scene.dead, scene.width)
            for member, volume_rows in pairs
        )
    )
