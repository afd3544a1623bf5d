"""Solve for the unknowns of members that equations tie to each other: a cluster.

The points of a volume are its own, so only equations couple members. What a change of one costs
follows from its cluster alone, however large the roof is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from .finish import form_normal_equations, is_proper, sum_moments, sum_point_costs
from .members import LinearVolume
from .scene import Scene

# Ridge, as a share of the mean diagonal of the normal equations. It keeps unknowns that no point
# determines.
RIDGE = 1e-9
NO_REMAINDER = 1e-6  # An equation of which the others leave less holds because of them.

# The factors (m, q) of members' unknowns in equations, by the members' numbers. Their products with
# these sum up to zero.
Equation = dict[int, np.ndarray]
# For each member of a cluster, by its number, the factors (q, r) of the cluster's free unknowns
# that give its own. Their columns, over all members, are orthonormal.
Basis = dict[int, np.ndarray]
Rows = dict[int, np.ndarray]  # Each member's planes (k, 3), NaN without one.


def collect_terms(terms: Iterable[tuple[int, np.ndarray]]) -> Equation:
    """Return the equations whose terms are members' numbers and factors (m, q)."""
    equation: Equation = {}
    for k, factors in terms:
        equation[k] = equation[k] + factors if k in equation else factors
    return equation


def evaluate_equation(equation: Equation, unknowns: dict[int, np.ndarray]) -> np.ndarray:
    """Return an equation's sums, for unknowns (q,) or factors (q, r) by member."""
    return np.asarray(sum(factors @ unknowns[k] for k, factors in equation.items()))


def free_member(k: int, member: LinearVolume) -> Basis:
    """Return the basis of a member that no equation ties."""
    return {k: np.eye(len(member.unknowns))}


def join_bases(bases: Iterable[Basis]) -> Basis:
    """Return the basis of several clusters together.

    One cluster may come several times.
    """
    bases = list({id(basis): basis for basis in bases}.values())
    sizes, joint, first = [count_free(basis) for basis in bases], Basis(), 0
    for size, basis in zip(sizes, bases, strict=True):
        for k, factors in basis.items():
            joint[k] = np.zeros((len(factors), sum(sizes)))
            joint[k][:, first : first + size] = factors
        first += size
    return joint


def constrain(basis: Basis, equation: Equation) -> Basis:
    """Return the basis of what solves an equation, too."""
    free = find_null_space(evaluate_equation(equation, basis))
    return {k: factors @ free for k, factors in basis.items()}


def count_free(basis: Basis) -> int:
    """Return the number of a basis' free unknowns."""
    return int(next(iter(basis.values())).shape[1])


def find_null_space(equations: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (p, q) of the unknowns that solve `equations`.

    These are (m, p), and zero for each of those unknowns.
    """
    _, values, rows = np.linalg.svd(equations)
    return rows[int((values > NO_REMAINDER).sum()) :].T


class NormalSums(NamedTuple):
    """The normal equations of a member's unknowns.

    `normal` (q, q) and `right` (q,) are their two sides, `weight` is the sum of the points'
    weights, and `misfit` that of their weighted squared residuals.
    """

    normal: np.ndarray
    right: np.ndarray
    weight: float
    misfit: float


class Solution(NamedTuple):
    """Members' unknowns (q,) that solve normal equations among those of a `basis`.

    `inverse` (r, r) is that of the equations of its free unknowns.
    """

    unknowns: dict[int, np.ndarray]
    inverse: np.ndarray
    basis: Basis

    def covary(self, k: int) -> np.ndarray:
        """Return the covariance (q, q) of a member's unknowns.

        It is that for points of unit variance.
        """
        factors = self.basis[k]
        return factors @ self.inverse @ factors.T


def estimate_variance(sums: dict[int, NormalSums]) -> float:
    """Return the variance (m2) of the points about the planes that the sums belong to."""
    misfit, weight = (
        sum(member_sums.misfit for member_sums in sums.values()),
        sum(member_sums.weight for member_sums in sums.values()),
    )
    return misfit / max(weight, 1.0)


def sum_member(member: LinearVolume, rows: np.ndarray, reach: float) -> NormalSums:
    """Return the sums over points near a member's planes `rows` (k, 3).

    These are the points within `reach` (m).
    """
    moments, products, weight, misfit = sum_moments(rows, member.points, reach)
    is_present = np.isfinite(rows[:, 2])
    normal, right = form_normal_equations(member.design, moments, products, is_present)
    return NormalSums(normal, right, weight, misfit)


def sum_first_round(member: LinearVolume, rows: np.ndarray, scene: Scene) -> NormalSums:
    """Return the sums in the first round of a fit from planes `rows` (k, 3)."""
    return sum_member(member, rows, 2.0 * (scene.dead + scene.width))


def solve_normal(
    sums: dict[int, NormalSums], basis: Basis, members: dict[int, LinearVolume]
) -> Solution:
    """Solve the normal equations of a cluster's members."""
    trace, size = sum(np.trace(sums[k].normal) for k in basis), sum(map(len, basis.values()))
    ridge = RIDGE * max(trace / size, 1e-6)
    n_free = count_free(basis)
    matrix, right = ridge * np.eye(n_free), np.zeros(n_free)
    for k, factors in basis.items():
        matrix += factors.T @ sums[k].normal @ factors
        right += factors.T @ (sums[k].right + ridge * members[k].unknowns)
    inverse = np.linalg.inv(matrix)
    free = inverse @ right
    return Solution({k: factors @ free for k, factors in basis.items()}, inverse, basis)


def place_planes(members: dict[int, LinearVolume], unknowns: dict[int, np.ndarray]) -> Rows:
    """Return the planes of members with these unknowns."""
    return {
        k: np.where(np.isfinite(members[k].rows), members[k].design @ values, np.nan)
        for k, values in unknowns.items()
    }


def price_rows(members: dict[int, LinearVolume], rows: Rows, scene: Scene) -> float:
    """Return what the points of members cost, infinite where planes are improper."""
    if not all(is_proper(planes, members[k].walls) for k, planes in rows.items()):
        return math.inf
    return sum_row_costs(members, rows, scene)


def sum_row_costs(members: dict[int, LinearVolume], rows: Rows, scene: Scene) -> float:
    """Sum up what the points of members cost under their planes."""
    dead, width = scene.dead, scene.width
    return float(
        sum(sum_point_costs(planes, members[k].points, dead, width) for k, planes in rows.items())
    )
