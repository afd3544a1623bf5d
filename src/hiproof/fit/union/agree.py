"""What volumes have in common: planes, slopes, ridges and eaves that a builder makes equal.

Each volume's planes are linear in a few unknowns (`finish`), so that two volumes agree is a linear equation between their
unknowns. It holds where all volumes, fitted together under it, explain the points as well but for what it saves. The
nearest are tried first, and what holds is kept.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from statistics import median
from typing import NamedTuple

import numpy as np

from .finish import (
    FEWEST_POINTS,
    LEVEL_SLACK,
    ROUNDS,
    SIGN,
    Planes,
    cost_of,
    normal_equations,
    proper,
    shown_points,
    weighted_moments,
)
from .scene import Scene
from .sides import Side
from .volumes import DIRECTION, LEVEL, PARAMETER_COST, SIDES

NEAR_M = 0.2  # heights further apart are not tried as one
# m that a builder's level allows, and a swath's height too; what is further apart must be so by chance, in standard deviations
LEVELLED_M, SIGMAS = 0.01, 2.5
RIDGE = 1e-9  # of the mean diagonal of the normal equations: what no point tells stays as it was
LEVEL_FALL = 1e-9  # rise over run; numerically level
HELD = 1e-6  # an equation that the others leave so little of holds by them


@dataclass(frozen=True)
class Member:
    """A volume as one of several.

    `rows` (5, 3) are its planes in its own axes, by all p unknowns `own` (5, 3, p) there and `common` (5, 3, p) in the first
    direction's; `points` (3, n) its points in its own axes, `places` (3, n) u, v, 1 of them in the first direction's; `seen` are
    the numbers of its planes on which any lie, with the numbers of those.
    """

    rows: np.ndarray
    own: np.ndarray
    common: np.ndarray
    points: np.ndarray
    places: np.ndarray
    seen: dict[int, np.ndarray]
    sides: list[Side]


@dataclass(frozen=True)
class Fit:
    """The unknowns' covariance (p, p), every member's rows (5, 3) and what the points cost."""

    covariance: np.ndarray
    rows: list[np.ndarray]
    cost: float


def agreed(volumes: np.ndarray, sides: list[list[Side]], planes: list[Planes], scene: Scene) -> list[Planes]:
    """The planes of all volumes fitted together, equal in what they have in common."""
    members = members_of(volumes, sides, planes, scene) if len(volumes) > 1 else {}
    if len(members) < 2:
        return planes
    known = list(members.values())
    start = unknowns_of(known)
    nearly = sorted(likely(known, start), key=lambda one: one[0])
    if not nearly:
        return planes
    held, basis = np.zeros((0, len(start))), np.eye(len(start))
    best = free = fitted(known, basis, start, scene)
    for gap, two, equation in nearly:
        if gap > LEVELLED_M and not may_hold(equation, start, free.covariance):
            continue
        saved = int(np.linalg.matrix_rank(equation @ basis, tol=HELD))
        if saved == 0:
            continue
        with_it = np.vstack([held, equation])
        left = null_space(with_it)
        found = fitted(known, left, start, scene)
        spared = scene.evidence * PARAMETER_COST * saved + LEVEL_SLACK * sum(known[k].points.shape[1] for k in two)
        if found.cost <= best.cost + spared:
            held, basis, best = with_it, left, found
    if len(held) == 0:
        return planes
    agreed_planes = list(planes)
    for k, member, rows in zip(members, known, best.rows, strict=True):
        agreed_planes[k] = replace(planes[k], rows=rows, design=member.own, covariance=best.covariance)
    return agreed_planes


def may_hold(equation: np.ndarray, unknowns: np.ndarray, covariance: np.ndarray) -> bool:
    """Whether `equation` (m, p) is no further from holding than the points leave open."""
    sigma = np.sqrt(np.maximum(((equation @ covariance) * equation).sum(axis=1), 0.0))
    return bool((np.abs(equation @ unknowns) < SIGMAS * sigma).all())


def members_of(volumes: np.ndarray, sides: list[list[Side]], planes: list[Planes], scene: Scene) -> dict[int, Member]:
    """The volumes whose planes points tell, by their number."""
    shown = shown_points(volumes, scene)
    free = [k for k, own in enumerate(planes) if own.design.shape[2] and len(shown[k]) >= FEWEST_POINTS]
    size, start, found = sum(planes[k].design.shape[2] for k in free), 0, {}
    for k in free:
        rows, design, direction = planes[k].rows, planes[k].design, int(volumes[k, DIRECTION])
        own = np.zeros((*design.shape[:2], size))
        own[:, :, start : start + design.shape[2]] = design
        start += design.shape[2]
        c, s = scene.turn[direction]
        common = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ own
        one = np.ones(len(shown[k]))
        points = np.array([scene.U[direction][shown[k]], scene.V[direction][shown[k]], scene.z[shown[k]]])
        places = np.array([scene.U[0][shown[k]], scene.V[0][shown[k]], one])
        found[k] = Member(rows, own, common, points, places, lowest_planes(rows, points), sides[k])
    return found


def lowest_planes(rows: np.ndarray, points: np.ndarray) -> dict[int, np.ndarray]:
    """The planes (5, 3) that are the lowest at any of `points` (3, n), by their numbers: at which, by theirs."""
    there = np.flatnonzero(np.isfinite(rows[:, 2])).tolist()
    z = rows[there] @ np.array([points[0], points[1], np.ones(points.shape[1])])
    lowest = z.argmin(axis=0)
    on = {number: np.flatnonzero(lowest == k) for k, number in enumerate(there)}
    return {number: own for number, own in on.items() if len(own)}


def unknowns_of(members: list[Member]) -> np.ndarray:
    """The unknowns (p,) that give the members' rows."""
    there = [np.isfinite(member.rows) for member in members]
    design = np.concatenate([member.own[at] for member, at in zip(members, there, strict=True)])
    rows = np.concatenate([member.rows[at] for member, at in zip(members, there, strict=True)])
    return np.linalg.lstsq(design, rows, rcond=None)[0]


class Seen(NamedTuple):
    """A plane of a member that its points show: its number, its coefficients a, b, c (3,) in the first direction's axes and by
    all unknowns (3, p) there, and u, v, 1 (3, n) of its points."""

    number: int
    coefficients: np.ndarray
    equation: np.ndarray
    places: np.ndarray


class Measure(NamedTuple):
    """A height or a slope of a member: its value, by all unknowns (p,), and what it is multiplied with to be a height (m)."""

    value: float
    equation: np.ndarray
    reach: float


def likely(members: list[Member], start: np.ndarray) -> Iterator[tuple[float, tuple[int, int], np.ndarray]]:
    """Equations (m, p) that nearly hold at the unknowns `start`: how far in height (m) they are from it, between which two."""
    planes = [seen_planes(member, start) for member in members]
    measures = [
        [list(kind) for kind in (slopes(member, start), ridges(member, start), eaves(member, start))]
        for member in members
    ]
    for j, k in combinations(range(len(members)), 2):
        for one in planes[j]:
            for other in planes[k]:
                gap = gap_of_planes(one, other)
                if gap < NEAR_M:
                    yield gap, (j, k), one_plane(one, other)
        for some, others in zip(measures[j], measures[k], strict=True):
            for x in some:
                for y in others:
                    gap = max(x.reach, y.reach) * abs(x.value - y.value)
                    if gap < NEAR_M:
                        yield gap, (j, k), (x.equation - y.equation)[None]


def seen_planes(member: Member, start: np.ndarray) -> list[Seen]:
    common, places = member.common @ start, member.places
    return [Seen(p, common[p], member.common[p], places[:, on]) for p, on in member.seen.items()]


def gap_of_planes(one: Seen, other: Seen) -> float:
    """How far apart (m) two planes are at most where their points are; infinite where they are not near at the first of these."""
    apart = one.coefficients - other.coefficients
    if max(abs(float(apart @ seen.places[:, 0])) for seen in (one, other)) >= NEAR_M:
        return np.inf
    return max(float(np.abs(apart @ seen.places).max()) for seen in (one, other))


def one_plane(one: Seen, other: Seen) -> np.ndarray:
    """That two planes are one (2, p): as high in the middle of their points and as steep; which way each faces is known before."""
    apart = one.equation - other.equation
    middle = 0.5 * (one.places.mean(axis=1) + other.places.mean(axis=1))
    a, b, _ = one.coefficients + other.coefficients
    along = np.array([a, b, 0.0]) / max(math.hypot(a, b), LEVEL_FALL)
    return np.stack([middle, along]) @ apart


def slopes(member: Member, start: np.ndarray) -> Iterator[Measure]:
    """The slopes of a member's inclined planes; half of how far their points reach along the fall makes them heights."""
    for p, on in member.seen.items():
        if p < SIDES:
            along = member.points[p // 2, on]
            equation = SIGN[p] * member.own[p, p // 2]
            yield Measure(float(equation @ start), equation, 0.5 * float(along.max() - along.min()))


def ridges(member: Member, start: np.ndarray) -> Iterator[Measure]:
    """The heights of a member's ridges, as they change from `start`."""
    for p, q in ((0, 1), (2, 3)):
        if p in member.seen and q in member.seen:
            axis, rows = p // 2, member.own[[p, q]] @ start
            rise, fall = rows[0, axis], -rows[1, axis]
            at = np.ones(3)
            at[1 - axis] = median(member.points[1 - axis].tolist())
            at[axis] = (rows[1] - rows[0])[[1 - axis, 2]] @ (at[1 - axis], 1.0) / (rise + fall)
            equation = at @ (fall * member.own[p] + rise * member.own[q]) / (rise + fall)
            yield Measure(float(equation @ start), equation, 1.0)


def eaves(member: Member, start: np.ndarray) -> Iterator[Measure]:
    """The heights of a member's eaves on the outline."""
    for p in member.seen:
        if p < SIDES and member.sides[p].anchored:
            equation = member.own[p, 2] + member.sides[p].at * member.own[p, p // 2]
            yield Measure(float(equation @ start), equation, 1.0)


def null_space(equations: np.ndarray) -> np.ndarray:
    """An orthonormal basis (p, q) of all unknowns of which `equations` (m, p) are zero."""
    _, values, rows = np.linalg.svd(equations)
    return rows[int((values > HELD).sum()) :].T


def fitted(members: list[Member], basis: np.ndarray, start: np.ndarray, scene: Scene) -> Fit:
    """All planes by biweighted least squares on their points, over unknowns (p,) that are `basis` (p, q) times any."""
    own, rows = np.concatenate([member.own for member in members]), [member.rows for member in members]
    absent, scale = np.isnan(np.concatenate(rows)), scene.dead + scene.width
    for turn in range(ROUNDS):
        normal, right, total, misfit = np.zeros((len(start), len(start))), np.zeros(len(start)), 0.0, 0.0
        for member, planes in zip(members, rows, strict=True):
            reach = scale * (2.0 if turn == 0 else 1.5)
            moments, products, weight, left = weighted_moments(planes, member.points, reach)
            matrix, vector = normal_equations(member.own, moments, products, np.isfinite(planes[:, 2]))
            normal, right, total, misfit = normal + matrix, right + vector, total + weight, misfit + left
        ridge = RIDGE * max(np.trace(normal) / len(start), 1e-6)
        inverse = basis @ np.linalg.inv(basis.T @ normal @ basis + ridge * np.eye(basis.shape[1])) @ basis.T
        unknowns = inverse @ (right + ridge * start)
        every = own @ unknowns
        every[absent] = np.nan
        rows = list(every.reshape(len(members), LEVEL + 1, 3))
    cost = sum(cost_of(own, member.points, scene.dead, scene.width) for member, own in zip(members, rows, strict=True))
    if not all(proper(own) for own in rows):
        cost = np.inf
    return Fit(inverse * misfit / max(total, 1.0), rows, cost)
