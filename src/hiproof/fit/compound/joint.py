"""All parts together: the planes of every part refitted to all points in one weighted least-squares problem with ties.

The unknowns are the coefficients of all planes in use. A structure (level, along an axis, opposite slopes of a gable) and a
regularity (equal slopes, equal ridges) are linear constraints on them; the fit moves in their null space. A
regularity is kept when the objective rises by less than the evidence that one parameter costs.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ...compiled import compiled
from .kernels import MAX_SLOPE, Cloud, Ghosts, is_symmetric_gable
from .layout import MAX_TABLE, Layout, evaluate, is_alive, objective
from .plan import Plan

PARAMETER_SHARE = 0.45  # of a unit of complexity: what one parameter costs
SLOPES_ALIKE, HEIGHTS_ALIKE_M = 0.12, 0.25
MOST_REGULARITIES = 24
ITERATIONS = 2


@dataclass(frozen=True)
class JointFit:
    """Table rows in use (k,) and the covariance (3 k, 3 k) of their coefficients in the building's frame."""

    rows: np.ndarray
    covariance: np.ndarray

    def covariance_of(self, rows: np.ndarray) -> np.ndarray:
        """Covariance (3 m, 3 m) of the planes in table `rows` (m,), all of them in use."""
        index = np.concatenate([3 * np.nonzero(self.rows == row)[0][0] + np.arange(3) for row in rows])
        return self.covariance[np.ix_(index, index)]


@compiled
def plane_moments(layout, cloud, tau):
    """Per table row: biweighted moments (3, 3) of (u, v, 1), right side (3,), and of all points sum w r^2 and sum w."""
    matrix, right, squares, weights = np.zeros((MAX_TABLE, 3, 3)), np.zeros((MAX_TABLE, 3)), 0.0, 0.0
    z, holder, active = evaluate(layout, cloud.u, cloud.v)
    x = np.ones(3)
    for i in range(len(z)):
        r = cloud.z[i] - z[i]
        w = 1.0 - (r / (1.5 * tau)) ** 2
        if w <= 0.0:
            continue
        w *= w
        row = layout.plane_of[holder[i], active[i]]
        x[0], x[1] = cloud.u[i], cloud.v[i]
        for a in range(3):
            right[row, a] += w * x[a] * cloud.z[i]
            for b in range(3):
                matrix[row, a, b] += w * x[a] * x[b]
        squares += w * r * r
        weights += w
    return matrix, right, squares, weights


def fit_together(layout: Layout, plan: Plan, tau: float, evidence: float) -> JointFit:
    """Refit all planes of `layout` (in place) with the regularities the evidence allows; the objective never rises."""
    rows = rows_in_use(layout)
    position = {int(row): 3 * k for k, row in enumerate(rows)}
    constraints = structure(layout, rows, position)
    value = objective(layout, plan.cloud, plan.ghosts, tau, evidence)
    basis = null_space(constraints, 3 * len(rows))
    value, _ = solved(layout, rows, basis, plan.cloud, plan.ghosts, tau, evidence, value)
    allowed = PARAMETER_SHARE * evidence
    for constraint in regularities(layout, rows, position, plan):
        if np.abs(constraint @ basis).max(initial=0.0) < 1e-9:  # it holds already
            continue
        more = np.vstack([constraints, constraint])
        narrower = null_space(more, 3 * len(rows))
        value, kept = solved(layout, rows, narrower, plan.cloud, plan.ghosts, tau, evidence, value + allowed)
        if kept:
            constraints, basis = more, narrower
        else:
            value -= allowed
    return JointFit(rows, covariance(layout, rows, basis, plan.cloud, tau))


def rows_in_use(layout: Layout) -> np.ndarray:
    alive = is_alive(layout)
    used = [layout.plane_of[h, : layout.planes_of[h]] for h in np.nonzero(alive)[0]]
    return np.unique(np.concatenate(used))


def structure(layout: Layout, rows: np.ndarray, position: dict[int, int]) -> np.ndarray:
    """Constraints (m, 3 k) that keep level planes level, axis slopes along their axis, symmetric gables symmetric."""
    found = []
    for row in rows:
        for axis in range(2):
            if abs(layout.table[row, axis]) < 1e-9:
                found.append({position[int(row)] + axis: 1.0})
    for h in np.nonzero(is_alive(layout))[0]:
        own = layout.plane_of[h, : layout.planes_of[h]]
        for first, second in combinations(own, 2):
            pair = layout.table[[first, second]]
            if is_symmetric_gable(pair, 2):
                axis = int(np.argmax(np.abs(pair[0, :2])))
                found.append({position[int(first)] + axis: 1.0, position[int(second)] + axis: 1.0})
    return as_matrix(found, 3 * len(rows))


def as_matrix(found: list[dict[int, float]], width: int) -> np.ndarray:
    matrix = np.zeros((len(found), width))
    for line, entries in zip(matrix, found, strict=True):
        for column, value in entries.items():
            line[column] = value
    return matrix


def regularities(layout: Layout, rows: np.ndarray, position: dict[int, int], plan: Plan) -> list[np.ndarray]:
    """Candidate constraints (1, 3 k), likeliest first: slopes of like steepness equal, ridges of like height level."""
    found = []
    sloped = [int(r) for r in rows if (np.abs(layout.table[r, :2]) > 1e-9).sum() == 1]
    axis_of = {r: int(np.argmax(np.abs(layout.table[r, :2]))) for r in sloped}
    for a, b in combinations(sloped, 2):
        slope_a, slope_b = layout.table[a, axis_of[a]], layout.table[b, axis_of[b]]
        gap = abs(abs(slope_a) - abs(slope_b))
        if gap < SLOPES_ALIKE:
            sign = np.sign(slope_a * slope_b)
            found.append((gap / SLOPES_ALIKE, {position[a] + axis_of[a]: 1.0, position[b] + axis_of[b]: -sign}))
    ridges = symmetric_ridges(layout)
    for (a, b), (c, d) in combinations(ridges, 2):
        gap = abs(layout.table[[a, b], 2].sum() - layout.table[[c, d], 2].sum()) / 2.0
        if gap < HEIGHTS_ALIKE_M and not {a, b} & {c, d}:
            entries = {position[a] + 2: 1.0, position[b] + 2: 1.0, position[c] + 2: -1.0, position[d] + 2: -1.0}
            found.append((gap / HEIGHTS_ALIKE_M, entries))
    found.sort(key=lambda candidate: candidate[0])
    return [as_matrix([entries], 3 * len(rows)) for _, entries in found[:MOST_REGULARITIES]]


def symmetric_ridges(layout: Layout) -> list[tuple[int, int]]:
    """Table rows of every symmetric gable: its ridge is at half the sum of their offsets."""
    pairs = set()
    for h in np.nonzero(is_alive(layout))[0]:
        own = layout.plane_of[h, : layout.planes_of[h]]
        if is_symmetric_gable(layout.table[own], len(own)):
            pairs.add((int(own[0]), int(own[1])))
    return sorted(pairs)


def null_space(constraints: np.ndarray, width: int) -> np.ndarray:
    """Orthonormal basis (width, p) of all coefficients that meet the constraints."""
    if len(constraints) == 0:
        return np.eye(width)
    _, singular, vt = np.linalg.svd(constraints)
    return vt[int((singular > 1e-9).sum()) :].T


def normal_equations(layout: Layout, rows: np.ndarray, cloud: Cloud, tau: float):
    matrix, right, squares, weights = plane_moments(layout, cloud, tau)
    width = 3 * len(rows)
    full = np.zeros((width, width))
    for k, row in enumerate(rows):
        full[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = matrix[row]
    return full, right[rows].ravel(), squares / max(weights, 1e-9)


def solved(
    layout: Layout,
    rows: np.ndarray,
    basis: np.ndarray,
    cloud: Cloud,
    ghosts: Ghosts,
    tau: float,
    evidence: float,
    limit: float,
) -> tuple[float, bool]:
    """Re-weighted least squares within `basis`; (objective, True), or the old planes and (`limit`, False) above it."""
    before = layout.table[rows].copy()
    for _ in range(ITERATIONS):
        matrix, right, _ = normal_equations(layout, rows, cloud, tau)
        old = basis.T @ layout.table[rows].ravel()
        reduced = basis.T @ matrix @ basis
        ridge = 1e-6 * max(np.trace(reduced) / len(reduced), 1.0)  # planes without points stay where they are
        free = np.linalg.solve(reduced + ridge * np.eye(len(reduced)), basis.T @ right + ridge * old)
        planes = (basis @ free).reshape(-1, 3)
        planes[np.abs(planes) < 1e-12] = 0.0
        layout.table[rows] = planes
    value = objective(layout, cloud, ghosts, tau, evidence)
    steepest = np.hypot(layout.table[rows, 0], layout.table[rows, 1]).max()
    if np.isfinite(value) and value <= limit and steepest <= max(MAX_SLOPE, np.hypot(before[:, 0], before[:, 1]).max()):
        return value, True
    layout.table[rows] = before
    return limit, False


def covariance(layout: Layout, rows: np.ndarray, basis: np.ndarray, cloud: Cloud, tau: float) -> np.ndarray:
    """Covariance (3 k, 3 k) of the coefficients: the inverse Hessian of the likelihood at the residuals' own variance."""
    matrix, _, variance = normal_equations(layout, rows, cloud, tau)
    reduced = basis.T @ matrix @ basis
    ridge = 1e-9 * max(np.trace(reduced) / len(reduced), 1.0)
    return variance * basis @ np.linalg.inv(reduced + ridge * np.eye(len(reduced))) @ basis.T
