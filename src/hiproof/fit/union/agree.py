"""Make equal what volumes have in common: planes, slopes, ridges and eaves.

A builder makes these equal. A condition that two volumes agree is accepted if all volumes that it
ties, fitted together under it, explain the points as well but for the parameters that it saves. The
nearest conditions are tried first.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .add import MOST_VOLUMES
from .aligned import align_planes
from .clusters import (
    NO_REMAINDER,
    Basis,
    Equation,
    NormalSums,
    Rows,
    Solution,
    constrain,
    count_free,
    estimate_variance,
    evaluate_equation,
    free_member,
    join_bases,
    place_planes,
    price_rows,
    solve_normal,
    sum_first_round,
    sum_member,
    sum_row_costs,
)
from .conditions import Condition, compute_allowance, find_likely_conditions
from .corners import list_corner_equations
from .finish import ROUNDS, Planes
from .members import LinearVolume, list_members
from .prices import FOLD_UNITS
from .risen import measure_misfits, restore_risen_planes
from .scene import Scene
from .sides import Side

AGREEMENT_SIGMAS = 2.5  # Larger differences must be within so many standard deviations.
# Difference (m) that nobody builds: accepted conditions have brought two heights so near.
REACHED_M = 0.003
# The quadratic form of the normal equations overestimates what a condition costs. Of 532 accepted
# in Delft, none had 2.7 times its allowance. Others are not tried on the points.
MOST_ESTIMATED = 4.0
# Share of the points, of a large roof of as many as MOST_VOLUMES volumes have, that a cluster may
# leave unexplained besides. Steep planes that agree below their neighbours may rise above these.
# Only the misfit of the roof shows that: a volume's own points lie where it alone is visible.
MOST_WORSE_SHARE = 0.02


class Agreement(NamedTuple):
    """The planes of all volumes, fitted together.

    `members` are by their volume's number, and so are the `bases` of their clusters.
    """

    planes: list[Planes]
    members: dict[int, LinearVolume]
    bases: dict[int, Basis]


class TiedMembers(NamedTuple):
    """Members that the accepted `conditions` tie, in the first round of their fit.

    `cost` is that of their points.
    """

    conditions: tuple[Condition, ...]
    solution: Solution
    cost: float


class CommonFit(NamedTuple):
    """The fit of a cluster: its members' `planes`, and the `basis` of their unknowns."""

    planes: dict[int, Planes]
    basis: Basis


def agree_planes(
    volumes: np.ndarray, sides: list[list[Side]], planes: list[Planes], scene: Scene
) -> Agreement:
    """Fit the planes of all volumes together, with what they have in common equal.

    Planes that rise above other volumes are first restored. Fold lines that end beside a corner of
    the outline are moved into it.
    """
    planes, misfits = restore_risen_planes(volumes, planes, scene)
    members = align_planes(list_members(volumes, sides, planes, scene), scene)
    if not members:
        return Agreement(planes, members, {})
    at_corners = (
        Condition(*condition, np.inf, FOLD_UNITS)
        for condition in list_corner_equations(members, scene.corners[0])
    )
    conditions = sorted(
        (*find_likely_conditions(members), *at_corners), key=lambda condition: condition.gap
    )
    clusters = choose_conditions(members, conditions, scene) if conditions else []
    fits = [fit for cluster in clusters if (fit := fit_cluster(cluster, planes, members, scene))]
    bases = {k: free_member(k, member) for k, member in members.items()}
    for fit in drop_risen_fits(fits, volumes, planes, misfits, scene):
        planes = [fit.planes.get(k, kept) for k, kept in enumerate(planes)]
        bases |= dict.fromkeys(fit.basis, fit.basis)
    return Agreement(planes, members, bases)


def drop_risen_fits(
    fits: list[CommonFit],
    volumes: np.ndarray,
    planes: list[Planes],
    misfits: np.ndarray,
    scene: Scene,
) -> list[CommonFit]:
    """Return the fits without those that rise above other volumes.

    `misfits` (n,) is what each point costs under the `planes` before.
    """
    if not fits:
        return fits
    number, trial = np.full(len(planes), len(fits)), list(planes)
    for n, fit in enumerate(fits):
        for k, volume_planes in fit.planes.items():
            number[k], trial[k] = n, volume_planes
    new_misfits, top = measure_misfits(volumes, trial, scene)
    excess = np.bincount(number[top], new_misfits - misfits, len(fits) + 1)
    most_worse = MOST_WORSE_SHARE * scene.n * min(1.0, MOST_VOLUMES / len(volumes))
    return [fit for fit, extra in zip(fits, excess[:-1], strict=True) if extra <= most_worse]


def choose_conditions(
    members: dict[int, LinearVolume], conditions: list[Condition], scene: Scene
) -> list[TiedMembers]:
    """Choose the conditions that hold, one after another.

    Returns the clusters that they tie. The normal equations of all members give the planes under a
    condition, and the points say what these cost.
    """
    sums = {k: sum_first_round(member, member.rows, scene) for k, member in members.items()}
    clusters = {k: begin_cluster(k, members, sums, scene) for k in members}
    noise = estimate_variance(sums)
    covariances = {k: noise * cluster.solution.covary(k) for k, cluster in clusters.items()}
    while conditions:
        later, has_changed = [], False
        for condition in conditions:
            if not may_hold(condition, members, clusters, covariances):
                later.append(condition)  # accepted ones may bring it nearer
                continue
            tied = list({id(clusters[k]): clusters[k] for k in condition.equation}.values())
            joint = join_clusters(tied, condition, members, sums, scene)
            if joint is not None:
                clusters |= dict.fromkeys(joint.solution.basis, joint)
                has_changed = True
        conditions = later if has_changed else []
    distinct = {id(cluster): cluster for cluster in clusters.values()}.values()
    return [cluster for cluster in distinct if cluster.conditions]


def begin_cluster(
    k: int, members: dict[int, LinearVolume], sums: dict[int, NormalSums], scene: Scene
) -> TiedMembers:
    solution = solve_normal(sums, free_member(k, members[k]), members)
    rows = place_planes(members, solution.unknowns)
    return TiedMembers((), solution, sum_row_costs(members, rows, scene))


def join_clusters(
    clusters: list[TiedMembers],
    condition: Condition,
    members: dict[int, LinearVolume],
    sums: dict[int, NormalSums],
    scene: Scene,
) -> TiedMembers | None:
    """Return clusters as one under a condition, too.

    Returns None if it holds already, ties too many, or if the points cost too much more.
    """
    if sum(len(cluster.solution.basis) for cluster in clusters) > condition.most_tied:
        return None
    squares = estimate_extra_squares(condition.equation, clusters)
    n_equations = len(next(iter(condition.equation.values())))
    most_cost = compute_allowance(condition, n_equations, members, scene)
    if squares > MOST_ESTIMATED * scene.width**2 * most_cost:
        return None
    basis = join_bases([cluster.solution.basis for cluster in clusters])
    free = constrain(basis, condition.equation)
    n_saved = count_free(basis) - count_free(free)
    if n_saved == 0:
        return None
    solution = solve_normal(sums, free, members)
    cost = price_rows(members, place_planes(members, solution.unknowns), scene)
    allowance = compute_allowance(condition, n_saved, members, scene)
    if not cost <= sum(cluster.cost for cluster in clusters) + allowance:
        return None
    conditions = [accepted for cluster in clusters for accepted in cluster.conditions]
    return TiedMembers((*conditions, condition), solution, cost)


def estimate_extra_squares(equation: Equation, clusters: list[TiedMembers]) -> float:
    """Return by how much (m2) an equation lets the weighted squared residuals grow."""
    gap, variance = np.zeros(1), np.zeros((1, 1))
    for cluster in clusters:
        solution = cluster.solution
        part = {k: factors for k, factors in equation.items() if k in solution.basis}
        factors = evaluate_equation(part, solution.basis)
        gap = gap + evaluate_equation(part, solution.unknowns)
        variance = variance + factors @ solution.inverse @ factors.T
    return float(gap @ np.linalg.pinv(variance, hermitian=True) @ gap)


def may_hold(
    condition: Condition,
    members: dict[int, LinearVolume],
    clusters: dict[int, TiedMembers],
    covariances: dict[int, np.ndarray],
) -> bool:
    """Return whether a condition fails by no more than the points leave open."""
    if condition.gap <= condition.allowed:
        return True
    equation = condition.equation
    start = {k: members[k].unknowns for k in equation}
    present = {k: clusters[k].solution.unknowns[k] for k in equation}
    if condition.gap * measure_remainder(equation, start, present) <= REACHED_M:
        return True
    variance = sum(
        ((factors @ covariances[k]) * factors).sum(axis=1) for k, factors in equation.items()
    )
    sigma = np.sqrt(np.maximum(variance, 0.0))
    return bool((np.abs(evaluate_equation(equation, start)) < AGREEMENT_SIGMAS * sigma).all())


def measure_remainder(
    equation: Equation, start: dict[int, np.ndarray], unknowns: dict[int, np.ndarray]
) -> float:
    """Return the share by which an equation still fails, of how far it did at `start`."""
    fails, failed = (
        np.abs(evaluate_equation(equation, values)).max() for values in (unknowns, start)
    )
    return float(fails / max(failed, NO_REMAINDER))


def fit_cluster(
    cluster: TiedMembers, planes: list[Planes], members: dict[int, LinearVolume], scene: Scene
) -> CommonFit | None:
    """Fit the planes of a cluster's members by biweighted least squares.

    Returns None if they are improper. The covariance is what the points determine: a corner of the
    outline gives the place where planes meet, but not how precise it is.
    """
    basis = cluster.solution.basis
    rows, covariances, cost = solve_rounds(basis, members, scene)
    if not math.isfinite(cost):
        return None
    by_points = [condition.equation for condition in cluster.conditions if not condition.spared]
    if len(by_points) < len(cluster.conditions):
        free = join_bases([free_member(k, members[k]) for k in basis])
        for equation in by_points:
            free = constrain(free, equation)
        _, covariances, _ = solve_rounds(free, members, scene)
    new_planes = {
        k: replace(planes[k], rows=rows[k], design=members[k].design, covariance=covariances[k])
        for k in basis
    }
    return CommonFit(new_planes, basis)


def solve_rounds(
    basis: Basis, members: dict[int, LinearVolume], scene: Scene
) -> tuple[Rows, dict[int, np.ndarray], float]:
    """Fit members in a few rounds of re-weighting.

    Returns their planes, the covariances of their unknowns and the points' cost.
    """
    rows, scale = {k: members[k].rows for k in basis}, scene.dead + scene.width
    for turn in range(ROUNDS):
        reach = (2.0 if turn == 0 else 1.5) * scale
        sums = {k: sum_member(members[k], rows[k], reach) for k in basis}
        solution = solve_normal(sums, basis, members)
        rows = place_planes(members, solution.unknowns)
    noise = estimate_variance(sums)
    covariances = {k: noise * solution.covary(k) for k in basis}
    return rows, covariances, price_rows(members, rows, scene)
