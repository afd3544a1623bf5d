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

from .corners import creases_at_corners
from .finish import (
    LEVEL_SLACK,
    ROUNDS,
    SIGN,
    Planes,
    cost_of,
    found_planes,
    normal_equations,
    proper,
    weighted_moments,
)
from .members import Member, members_of, unknowns_of
from .objective import misfits
from .prices import CREASE_UNITS, PARAMETER_COST
from .scene import Scene
from .sides import Side
from .volumes import DIRECTION, REPLACES, SIDES, U0, U1, V0, V1

NEAR_M = 0.2  # heights further apart are not tried as one
# m that a builder's level allows, and a swath's height too; what is further apart must be so by chance, in standard deviations
LEVELLED_M, SIGMAS = 0.01, 2.5
REACHED_M = 0.003  # m within which others have brought what is further apart: nobody builds such a difference
RIDGE = 1e-9  # of the mean diagonal of the normal equations: what no point tells stays as it was
LEVEL_FALL = 1e-9  # rise over run; numerically level
HELD = 1e-6  # an equation that the others leave so little of holds by them
# Share of the points that agreement may leave unexplained besides. Steep planes that agree below their neighbours may
# rise above these, which only the whole roof's misfit shows: each volume's own points lie where it shows alone.
MOST_WORSE_SHARE = 0.02
# by which the points over which one volume shows may cost more under its fitted planes
RISEN_SHARE = 0.1


@dataclass(frozen=True)
class Fit:
    """The unknowns (p,) and their covariance (p, p), every member's rows (k, 3) and what the points cost."""

    unknowns: np.ndarray
    covariance: np.ndarray
    rows: list[np.ndarray]
    cost: float
    basis: np.ndarray


class Asked(NamedTuple):
    """An equation (m, p) that nearly holds: how far in height (m) from it, between which two members, how far it may be whatever the
    points' deviations, and units that are spared besides its parameters."""

    gap: float
    two: tuple[int, int]
    equation: np.ndarray
    allowed: float = LEVELLED_M
    spared: float = 0.0


class Agreement(NamedTuple):
    """All volumes' planes fitted together, the members by their volume's number, and the unknowns: those that the
    equations which hold leave free, as a basis (p, q), and where they started (p,).

    `cost` is that of the members' points, None where nothing was fitted together.
    """

    planes: list[Planes]
    members: dict[int, Member]
    basis: np.ndarray
    start: np.ndarray
    cost: float | None = None


def agreed(volumes: np.ndarray, sides: list[list[Side]], planes: list[Planes], scene: Scene) -> Agreement:
    """The planes of all volumes fitted together, equal in what they have in common and at the corners of the outline."""
    members = members_of(volumes, sides, planes, scene)
    known = list(members.values())
    if not known:
        return Agreement(planes, members, np.zeros((0, 0)), np.zeros(0))
    start = unknowns_of(known)
    alone = Agreement(planes, members, np.eye(len(start)), start)
    at_corners = (Asked(*one, np.inf, CREASE_UNITS) for one in creases_at_corners(known, start, scene.corners[0]))
    asked = sorted((*likely(known, start), *at_corners), key=lambda one: one.gap)
    found = fitted_as_asked(known, start, asked, scene) if asked else None
    if found is None:
        return alone
    agreed_planes = list(planes)
    for k, member, rows in zip(members, known, found.rows, strict=True):
        agreed_planes[k] = replace(planes[k], rows=rows, design=member.own, covariance=found.covariance)
    worse = roof_misfit(volumes, agreed_planes, scene) - roof_misfit(volumes, planes, scene)
    if worse > MOST_WORSE_SHARE * scene.n:
        return alone
    return Agreement(agreed_planes, members, found.basis, start, found.cost)


def roof_misfit(volumes: np.ndarray, planes: list[Planes], scene: Scene) -> float:
    """Sum up what all points cost (points) under `planes`, each volume within its rectangle."""
    return float(misfits_under(volumes, planes, scene)[0].sum())


def misfits_under(
    volumes: np.ndarray, planes: list[Planes], scene: Scene
) -> tuple[np.ndarray, np.ndarray]:
    """Return what each point costs under `planes`, and which volume shows there: two arrays (n,)."""
    n = scene.n
    heights, top = np.full(n, -np.inf), np.zeros(n, int)
    for k, (volume, own) in enumerate(zip(volumes, planes, strict=True)):
        u, v = scene.U[int(volume[DIRECTION]), :n], scene.V[int(volume[DIRECTION]), :n]
        inside = (u >= volume[U0]) & (u <= volume[U1]) & (v >= volume[V0]) & (v <= volume[V1])
        within = np.flatnonzero(inside)
        rows = own.rows[np.isfinite(own.rows[:, 2])]
        z = (rows @ np.array([u[within], v[within], np.ones(len(within))])).min(axis=0)
        shows = np.full(len(within), True) if volume[REPLACES] else z > heights[within]
        heights[within[shows]], top[within[shows]] = z[shows], k
    return misfits(scene.z[:n], heights, scene), top


def hide_again(volumes: np.ndarray, planes: list[Planes], scene: Scene) -> list[Planes]:
    """Return the planes, as the search found them where a volume rises above others and fits less.

    Planes are fitted to the points over which their volume shows. Where it lies hidden, such as one
    of two gables of nearly the same slopes, they may come out above the other.
    """
    planes = list(planes)
    found = [found_planes(row, scene) for row in volumes]
    before, _ = misfits_under(volumes, found, scene)
    while True:
        after, top = misfits_under(volumes, planes, scene)
        worse = np.bincount(top, after - before, len(planes))
        worse[[own is as_found for own, as_found in zip(planes, found, strict=True)]] = 0.0
        excess = worse - RISEN_SHARE * np.bincount(top, minlength=len(planes))
        k = int(np.argmax(excess))
        if excess[k] <= 0.0:
            return planes
        planes[k] = found[k]


def fitted_as_asked(members: list[Member], start: np.ndarray, asked: list[Asked], scene: Scene) -> Fit | None:
    """The fit under all that may hold of what is `asked`, one after another; None where nothing does.

    Its covariance is what the points tell: a corner of the outline says where planes meet, not how well that is known.
    """
    held, told, basis = np.zeros((0, len(start))), np.zeros((0, len(start))), np.eye(len(start))
    begun = sums_at_first(members, scene)
    best = free = fitted(members, basis, start, scene, begun)
    if not math.isfinite(free.cost):  # improper: members keep their planes until a proper fit is found
        rows = [member.rows for member in members]
        best = Fit(start, free.covariance, rows, cost_of_rows(members, rows, scene), basis)
    while asked:
        later, before = [], len(held)
        for one in asked:
            near = one.gap <= one.allowed or one.gap * still_left(one, start, best) <= REACHED_M
            if not near and not may_hold(one.equation, start, free.covariance):
                later.append(one)  # what holds may bring it nearer
                continue
            saved = int(np.linalg.matrix_rank(one.equation @ basis, tol=HELD))
            if saved == 0:
                continue
            with_it = np.vstack([held, one.equation])
            left = null_space(with_it)
            found = fitted(members, left, start, scene, begun)
            if found.cost <= best.cost + worth(one, saved, members, scene):
                held, basis, best = with_it, left, found
                told = told if one.spared else np.vstack([told, one.equation])
        asked = later if len(held) > before else []
    if len(held) > len(told):
        as_told = fitted(members, null_space(told), start, scene, begun)
        best = replace(best, covariance=as_told.covariance)
    return best if len(held) else None


def worth(one: Asked, saved: int, members: list[Member], scene: Scene) -> float:
    """What may stay unexplained where an equation holds that saves so many parameters (points)."""
    slack = LEVEL_SLACK * sum(members[k].points.shape[1] for k in one.two)
    return float(scene.evidence * (PARAMETER_COST * saved + one.spared) + slack)


def still_left(one: Asked, start: np.ndarray, fit: Fit) -> float:
    """What is left of how far an equation was from holding at `start`."""
    return float(np.abs(one.equation @ fit.unknowns).max() / max(np.abs(one.equation @ start).max(), HELD))


def may_hold(equation: np.ndarray, unknowns: np.ndarray, covariance: np.ndarray) -> bool:
    """Whether `equation` (m, p) is no further from holding than the points leave open."""
    sigma = np.sqrt(np.maximum(((equation @ covariance) * equation).sum(axis=1), 0.0))
    return bool((np.abs(equation @ unknowns) < SIGMAS * sigma).all())


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


def likely(members: list[Member], start: np.ndarray) -> Iterator[Asked]:
    """What nearly holds between members at the unknowns `start`."""
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
                    yield Asked(gap, (j, k), one_plane(one, other))
        for some, others in zip(measures[j], measures[k], strict=True):
            for x in some:
                for y in others:
                    gap = max(x.reach, y.reach) * abs(x.value - y.value)
                    if gap < NEAR_M:
                        yield Asked(gap, (j, k), (x.equation - y.equation)[None])


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


class Sums(NamedTuple):
    """Normal equations of all members' unknowns (p, p) and (p,), and of their points: the sum of
    the weights, and of the weighted squares of what is left."""

    normal: np.ndarray
    right: np.ndarray
    weight: float
    misfit: float


def sums_at_first(members: list[Member], scene: Scene) -> Sums:
    """The sums in the first round of a fit, which starts from the members' planes."""
    return sums_of(members, [member.rows for member in members], 2.0 * (scene.dead + scene.width))


def sums_of(members: list[Member], rows: list[np.ndarray], reach: float) -> Sums:
    """The sums over points within `reach` (m) of the members' planes `rows`."""
    size = members[0].own.shape[2]
    normal, right, total, misfit = np.zeros((size, size)), np.zeros(size), 0.0, 0.0
    for member, planes in zip(members, rows, strict=True):
        moments, products, weight, left = weighted_moments(planes, member.points, reach)
        there = np.isfinite(planes[:, 2])
        matrix, vector = normal_equations(member.design, moments, products, there)
        own = slice(member.first, member.first + len(vector))
        normal[own, own], right[own] = matrix, vector
        total, misfit = total + weight, misfit + left
    return Sums(normal, right, total, misfit)


def fitted(
    members: list[Member],
    basis: np.ndarray,
    start: np.ndarray,
    scene: Scene,
    begun: Sums | None = None,
) -> Fit:
    """All planes by biweighted least squares, over unknowns (p,) that are `basis` (p, q) times any.

    `begun` are the sums at first, where these are known.
    """
    own, rows = np.concatenate([member.own for member in members]), [member.rows for member in members]
    ends = [*accumulate(map(len, rows), initial=0)]
    absent, scale = np.isnan(np.concatenate(rows)), scene.dead + scene.width
    sums = begun or sums_at_first(members, scene)
    for turn in range(ROUNDS):
        sums = sums if turn == 0 else sums_of(members, rows, 1.5 * scale)
        ridge = RIDGE * max(np.trace(sums.normal) / len(start), 1e-6)
        held = basis.T @ sums.normal @ basis + ridge * np.eye(basis.shape[1])
        inverse = basis @ np.linalg.inv(held) @ basis.T
        unknowns = inverse @ (sums.right + ridge * start)
        every = own @ unknowns
        every[absent] = np.nan
        rows = [every[low:high] for low, high in pairwise(ends)]
    cost = cost_of_rows(members, rows, scene)
    if not all(proper(own, member.walls) for member, own in zip(members, rows, strict=True)):
        cost = np.inf
    return Fit(unknowns, inverse * sums.misfit / max(sums.weight, 1.0), rows, cost, basis)


def cost_of_rows(members: list[Member], rows: list[np.ndarray], scene: Scene) -> float:
    """What the points of members cost under their planes `rows` (k, 3)."""
    pairs = zip(members, rows, strict=True)
    return float(sum(cost_of(own, member.points, scene.dead, scene.width) for member, own in pairs))
