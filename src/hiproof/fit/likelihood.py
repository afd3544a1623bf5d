"""The default objective: from points to the best roof of every type.

Then one of them is chosen, with its covariance.

    points -> starts by vote -> annealed fits -> derived types -> noise by EM -> choice by evidence
    -> sides -> covariance

The cloud is coarse at first (120 points, sigma and tau half a metre) and fine at last; types far
behind the best are dropped early. Everything compiled is in kernel.py and direction.py; here is the
schedule.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import shapely

from ..primitives import CATALOGUE, Primitive
from ..primitives.contract import HALF_LENGTH, HALF_WIDTH, KAPPA, Q0
from . import kernel
from .direction import (
    main_direction,
    outline_rectangle,
    rectangle_direction,
    rectangle_in_direction,
    slope_direction,
)
from .kernel import Noise, Problem, Tables
from .tables import bounds, tables, variants

COARSE_POINTS = 120  # points that starts are judged on: a bound on time
# noise from which on a fit is tried again on more points: twice that of a flight, or ten times its
# outliers
DOUBTFUL = Noise(0.2, np.inf, 0.1)
MORE_POINTS = 4  # times as many: on the few the right start of a saw-tooth is lost once in 300 fits
OUTLIERS_AT_FIRST = 0.1  # share of the points; what is found replaces it in the first round of EM
OUTLIER_REACH_M = 4.0  # outliers may lie anywhere in the points' extent and this far around
COARSE, MIDDLE, FINE = (
    Noise(size, soft, OUTLIERS_AT_FIRST) for size, soft in ((0.5, 0.5), (0.25, 0.3), (0.15, 0.15))
)
SIGMA_PRIOR = (0.07, 6.0, 0.02, 0.30)  # metres, worth in points, smallest, largest
SIDE_TAU_M = 0.1  # softness of the sides while types are compared
# types further behind the best after annealing are dropped
SLACK_NATS, SLACK_NATS_A_POINT = 15.0, 0.04
# the same after the rough fit to the thinned points
ROUGH_SLACK_NATS, ROUGH_SLACK_NATS_A_POINT = 15.0, 0.15
# of the fine fit, that a type must have over the one it derives from to be considered
LEAST_GAIN_NATS = 0.2
POINTED_STARTS = 5  # Starts of a shape of several minima, by how far its top bends up.
SIDE_GRID = 28  # cells a side over which its posterior mean is summed
PLAN_INDICES = [0, 1, HALF_WIDTH, HALF_LENGTH]  # theta's centre and half extents


@dataclass(frozen=True)
class Estimate:
    """The chosen roof, and how each type fared.

    It has `theta` (9,) of `primitive`, its `covariance` (9, 9), and the `noise` learnt.

    `value` is minus the log likelihood, `bics` by type (lower is better), both of the chosen type's
    optimum.
    """

    primitive: Primitive
    theta: np.ndarray
    covariance: np.ndarray
    noise: Noise
    value: float
    bics: dict[str, float]
    evaluations: int


@dataclass(frozen=True)
class Candidates:
    """Roofs under test.

    Row `kinds` (m,) of the tables, `thetas` (m, 9), minus log likelihoods `values` (m,).
    """

    kinds: np.ndarray
    thetas: np.ndarray
    values: np.ndarray
    evaluations: int = 0

    def select(self, rows: np.ndarray) -> Candidates:
        return Candidates(self.kinds[rows], self.thetas[rows], self.values[rows], self.evaluations)

    def select_within(self, slack: float) -> Candidates:
        """Select the candidates at most `slack` nats behind the best."""
        return self.select(self.values <= self.values.min() + slack)

    def joined(self, other: Candidates) -> Candidates:
        return Candidates(
            np.concatenate([self.kinds, other.kinds]),
            np.concatenate([self.thetas, other.thetas]),
            np.concatenate([self.values, other.values]),
            self.evaluations + other.evaluations,
        )


@dataclass(frozen=True)
class Search:
    """The problem of one roof, whole and thinned, with shapes and bounds.

    The shapes are those to be tried.
    """

    whole: Problem
    thinned: Problem
    tables: Tables
    shapes: tuple[Primitive, ...]
    # (T,) the number of the type with its parameters, the same for all tooth counts
    family: np.ndarray
    low: np.ndarray  # (T, 9)
    high: np.ndarray
    free: tuple[int, ...] = ()  # the numbers of a given plan that are fitted all the same

    def box(self, candidates: Candidates) -> tuple[np.ndarray, np.ndarray]:
        """Return bounds (m, 9) of each candidate.

        A given plan is a box without width.
        """
        lower, upper = self.low[candidates.kinds], self.high[candidates.kinds]
        if not self.whole.plan_is_free:
            given = [k for k in range(Q0) if k not in self.free]
            lower[:, given] = upper[:, given] = candidates.thetas[:, given]
        return lower, upper

    def minimise(
        self,
        problem: Problem,
        candidates: Candidates,
        noise: Noise,
        iterations: int,
        tolerance: float,
    ) -> Candidates:
        """Return all candidates after some Levenberg-Marquardt steps."""
        thetas = candidates.thetas.copy()
        values, evaluations = kernel.minimise_each(
            problem,
            self.tables,
            candidates.kinds,
            thetas,
            *self.box(candidates),
            noise,
            iterations,
            tolerance,
        )
        return Candidates(candidates.kinds, thetas, values, candidates.evaluations + evaluations)

    def fit_coarsely(self, candidates: Candidates) -> Candidates:
        """Return the best two of each type after coarse steps on thinned points."""
        return self.select_best(
            self.minimise(self.thinned, candidates, COARSE, 4, 0.5), 2, self.slack
        )

    def fit_roughly(self, candidates: Candidates) -> Candidates:
        """Return the best two of each type after medium steps on thinned points."""
        return self.select_best(
            self.minimise(self.thinned, candidates, MIDDLE, 5, 0.3), 2, self.slack
        )

    @property
    def slack(self) -> float:
        """How far behind its type's best a second candidate is still tried.

        It is in nats, on the thinned points.
        """
        return 3.0 + 0.05 * len(self.thinned.points)

    def select_best(self, candidates: Candidates, count: int, slack: float = np.inf) -> Candidates:
        """Select the `count` best of each type within `slack` nats of its best.

        Types come in the tables' order.
        """
        families, values = self.family[candidates.kinds].tolist(), candidates.values.tolist()
        ranked = sorted(zip(families, values, range(len(values)), strict=True))
        selection: list[int] = []
        rank: dict[int, int] = {}
        best: dict[int, float] = {}
        for family, value, row in ranked:
            rank[family] = rank.get(family, 0) + 1
            if rank[family] <= count and value <= best.setdefault(family, value) + slack:
                selection.append(row)
        return candidates.select(np.array(selection, int))

    def select_gaining(self, candidates: Candidates) -> Candidates:
        """Drop types that explain no more than one from which they derive.

        A gable is also a hip whose ends stand upright; learning the noise of every such type would
        take most of the time.
        """
        shapes = [self.shapes[kind] for kind in candidates.kinds]
        by_name = {
            shape.name: value
            for shape, value in zip(shapes, candidates.values, strict=True)
            if shape.vote
        }
        simpler = [
            min([by_name.get(start.source, np.inf) for start in shape.starts], default=np.inf)
            for shape in shapes
        ]
        return candidates.select(candidates.values < np.array(simpler) - LEAST_GAIN_NATS)


def fit_likelihood(
    points: np.ndarray,
    types: tuple[str, ...],
    outline: shapely.Polygon | None = None,
    side_taus: tuple[float, ...] = (),
    log_prior: dict[str, float] | None = None,
) -> Estimate:
    """Fit the most evident roof of `types` to `points` (n, 4).

    They are x, y, z about their centre, and the probability of being roof.

    With an `outline` the plan is its rectangle in the roof's direction and only heights are fitted.
    `side_taus` are the softnesses (m) tried at last on the sides; `log_prior` by type is added to
    the evidence (nats).
    """

    def estimate(coarse_points: int) -> Estimate:
        search = new_search(points, types, outline is None, coarse_points)
        return search_types(search, types, outline, side_taus, log_prior)

    first = estimate(COARSE_POINTS)
    if all(np.less(first.noise, DOUBTFUL)) or len(points) <= COARSE_POINTS:
        return first
    return min(first, estimate(MORE_POINTS * COARSE_POINTS), key=lambda one: min(one.bics.values()))


def fit_heights(
    points: np.ndarray, primitive: Primitive, theta: np.ndarray, free: tuple[int, ...] = ()
) -> tuple[np.ndarray, Noise]:
    """Fit heights and slopes of one round shape to `points` (n, 4) over the plan of `theta`.

    The numbers `free` of the plan are fitted, too, and its half length with its half width.
    Distances are at right angles. Returns theta (9,) and the noise learnt.
    """
    search, kind = new_round_search(points, primitive, free)
    thetas = theta[None]
    if primitive.minima:
        # The pointed top has few points, which are outliers for a start that is not near.
        thetas = np.repeat(thetas, POINTED_STARTS, axis=0)
        thetas[1:, primitive.theta_size - 1] = np.linspace(*primitive.bounds[-1], POINTED_STARTS)[
            :-1
        ]
    starts = Candidates(np.full(len(thetas), kind), thetas, np.zeros(len(thetas)))
    for noise in (COARSE, MIDDLE, FINE) if primitive.minima else ():
        starts = search.minimise(search.whole, starts, noise, 6, 0.3)
    candidates, noises = learn(search, starts.select_within(0.0))
    return candidates.thetas[0], Noise(*noises[0])


def new_round_search(
    points: np.ndarray, primitive: Primitive, free: tuple[int, ...]
) -> tuple[Search, int]:
    """Set up the search for one round shape, and return its row of the tables, too."""
    search = new_search(points, (primitive.name,), False, COARSE_POINTS)
    search.low[:, Q0] = -np.inf  # Points of a disc around its top do not reach down to the eave.
    whole = search.whole._replace(is_round=True)
    return replace(search, whole=whole, free=free), search.shapes.index(primitive)


def find_covariance(
    points: np.ndarray,
    primitive: Primitive,
    theta: np.ndarray,
    free: tuple[int, ...],
    width_variance: float = 0.0,
) -> np.ndarray:
    """Find the covariance (9, 9) of what `fit_heights` fits to `points` (n, 4).

    All other numbers are taken as known, but for half a width with a variance (m2).
    """
    search, kind = new_round_search(points, primitive, free)
    rows = np.tile(theta, (len(search.low), 1))
    held = replace(search, low=rows, high=rows)
    _, (noise,) = learn(held, Candidates(np.array([kind]), theta[None], np.zeros(1)))
    covariance = estimate_covariance(search, kind, theta, Noise(*noise.tolist()), np.zeros(4))
    sides = np.isin(np.arange(9), [HALF_WIDTH, HALF_LENGTH])
    return covariance + width_variance * np.outer(sides, sides)


def search_types(
    search: Search,
    types: tuple[str, ...],
    outline: shapely.Polygon | None,
    side_taus: tuple[float, ...],
    log_prior: dict[str, float] | None,
) -> Estimate:
    """Return the most evident roof of `types`.

    It starts where the thinned points vote.
    """
    basic = search.fit_roughly(vote_starts(search, outline))
    candidates = basic.joined(
        search.fit_roughly(search.fit_coarsely(derived_starts(search, basic)))
    )
    candidates = candidates.select(
        np.array([search.shapes[kind].name in types for kind in candidates.kinds])
    )
    candidates = candidates.select_within(
        ROUGH_SLACK_NATS + ROUGH_SLACK_NATS_A_POINT * len(search.thinned.points)
    )
    candidates = search.select_best(search.minimise(search.whole, candidates, FINE, 6, 0.3), 1)
    candidates = search.select_gaining(candidates).select_within(
        SLACK_NATS + SLACK_NATS_A_POINT * len(search.whole.points)
    )
    candidates, noises = learn(search, candidates)
    winner, bics = choose(search, candidates, log_prior or {})
    return finish(
        search, candidates.select(np.array([winner])), Noise(*noises[winner]), bics, side_taus
    )


@cache
def list_needed_types(types: tuple[str, ...]) -> tuple[tuple[str, ...], np.ndarray]:
    """Return `types` with those from which their starts derive.

    With them comes the number of its type for each of their variants.
    """
    mask = set(types) | {start.source for name in types for start in CATALOGUE[name].starts}
    names = tuple(name for name in CATALOGUE if name in mask)
    families = [(shape.name, shape.theta_size) for shape in variants(names)]
    return names, np.array([list(dict.fromkeys(families)).index(family) for family in families])


def new_search(
    points: np.ndarray, types: tuple[str, ...], plan_is_free: bool, coarse_points: int
) -> Search:
    """Set up the search for `points` (n, 4) and all shapes needed.

    The points are also thinned to about `coarse_points`.
    """
    names, family = list_needed_types(types)
    z_low, z_high = height_range(points[:, 2])
    plan_area = (plan_extents(points[:, :2]) + 2 * OUTLIER_REACH_M).prod() if plan_is_free else 1.0
    log_background = -float(np.log(plan_area * (max(z_high - z_low, 1.0) + OUTLIER_REACH_M)))
    lower, upper = (bound.copy() for bound in bounds(names))
    lower[:, Q0], upper[:, Q0] = z_low - 1.0, z_high + 1.5
    stride = max(1, round(len(points) / coarse_points))
    whole = Problem(points, log_background, plan_is_free)
    thinned = whole._replace(points=np.ascontiguousarray(points[::stride]))
    return Search(whole, thinned, tables(names), variants(names), family, lower, upper)


def height_range(z: np.ndarray) -> tuple[float, float]:
    """Return lowest and highest height without extremes.

    One in a hundred and one in two hundred are left out.
    """
    ordered = np.sort(z)
    return float(ordered[int(0.01 * len(z))]), float(ordered[len(z) - 1 - int(0.005 * len(z))])


def plan_extents(xy: np.ndarray) -> np.ndarray:
    """Return the sides (2,) of the rectangle with the scatter of `xy` (n, 2).

    Points lie evenly in it. The shorter side comes first.
    """
    x, y = xy[:, 0] - xy[:, 0].mean(), xy[:, 1] - xy[:, 1].mean()
    xx, yy, xy_ = x @ x / len(x), y @ y / len(x), x @ y / len(x)
    half_sum, half_gap = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy_)
    return np.sqrt(12 * np.array([max(half_sum - half_gap, 0.0), half_sum + half_gap]))


def vote_starts(search: Search, outline: shapely.Polygon | None) -> Candidates:
    """Return the best two starts of each voting type.

    They are taken in the likely directions, after a few coarse steps.

    Up to eight a type are stepped, for a saw-tooth has many counts and turns, but only those with
    nearly as many votes.
    """
    rectangles = np.array(
        [
            rectangle_in_direction(search.thinned.points, kappa, 0.03)
            if outline is None
            else outline_rectangle(outline, kappa)
            for kappa in directions(search, outline)
        ]
    )
    kinds, thetas, votes = kernel.vote_each(search.thinned, search.tables, rectangles)
    few_votes_less = 0.2 * len(search.thinned.points)
    candidates = search.select_best(Candidates(kinds, thetas, -votes), 8, few_votes_less)
    return search.fit_coarsely(candidates)


def directions(search: Search, outline: shapely.Polygon | None) -> list[float]:
    """Return likely directions (rad, modulo a quarter turn).

    They are that of the slopes, and of the plan where that is another one.

    A given outline's own direction stands for both where they are close.
    """
    by_slope, confidence = slope_direction(search.whole.points, COARSE_POINTS, 9)
    if outline is None:
        by_plan = rectangle_direction(search.thinned.points, 0.015, 30)
    else:
        by_plan = main_direction(outline)
    if confidence <= 0.15:
        return [by_plan]
    turn = (by_slope - by_plan + np.pi / 4) % (np.pi / 2) - np.pi / 4
    if abs(turn) > 0.06:
        return [by_slope, by_plan]
    return [by_slope if outline is None else by_plan]


def derived_starts(search: Search, basic: Candidates) -> Candidates:
    """Return starts of the types that derive from simpler ones.

    They come from the best `basic` fit of each.
    """
    basic = search.select_best(basic, 1)
    theta_of = {
        search.shapes[kind].name: theta
        for kind, theta in zip(basic.kinds, basic.thetas, strict=True)
    }
    starts = [
        (t, start.theta(theta_of[start.source]))
        for t, shape in enumerate(search.shapes)
        for start in shape.starts
        if start.source in theta_of
    ]
    kinds = np.array([t for t, _ in starts], np.int64)
    return Candidates(
        kinds, np.reshape([theta for _, theta in starts], (-1, 9)), np.zeros(len(starts))
    )


def learn(search: Search, candidates: Candidates) -> tuple[Candidates, np.ndarray]:
    """Fit candidates together with their noise (m, 3) by EM."""
    noises = np.tile([0.1, SIDE_TAU_M, OUTLIERS_AT_FIRST], (len(candidates.kinds), 1))
    thetas = candidates.thetas.copy()
    values, evaluations = kernel.estimate_each(
        search.whole,
        search.tables,
        candidates.kinds,
        thetas,
        *search.box(candidates),
        noises,
        SIGMA_PRIOR,
        3,
    )
    return Candidates(
        candidates.kinds, thetas, values, candidates.evaluations + evaluations
    ), noises


def choose(
    search: Search, candidates: Candidates, log_prior: dict[str, float]
) -> tuple[int, dict[str, float]]:
    """Return the row of the most evident proper roof, and BIC by type.

    The penalty is twice the textbook's: it is safest there.
    """
    shapes = [search.shapes[kind] for kind in candidates.kinds]
    sizes = np.array([shape.theta_size + 1 for shape in shapes])
    evidence = candidates.values + sizes * np.log(len(search.whole.points))
    evidence -= np.array([log_prior.get(shape.name, 0.0) for shape in shapes])
    order = np.argsort(evidence, kind="stable")
    bics: dict[str, float] = {}
    for row in order:
        bics.setdefault(shapes[row].name, 2 * float(evidence[row]))
    for row in order:
        if shapes[row].is_proper(shapes[row].canonical_theta(candidates.thetas[row])):
            return int(row), bics
    return int(order[0]), bics


def finish(
    search: Search,
    winner: Candidates,
    noise: Noise,
    bics: dict[str, float],
    side_taus: tuple[float, ...],
) -> Estimate:
    """Return the estimate of the winner.

    Its sides are sharpened and averaged, its heights fitted again, and its covariance follows.
    """
    kind, theta, value = int(winner.kinds[0]), winner.thetas[0].copy(), float(winner.values[0])
    (lower,), (upper,) = search.box(winner)
    evaluations = winner.evaluations
    variances = np.zeros(4)
    if search.whole.plan_is_free:
        if side_taus:
            value, noise, additions = kernel.sharpen_sides(
                search.whole,
                search.tables,
                kind,
                theta,
                lower,
                upper,
                noise,
                SIGMA_PRIOR,
                np.array(side_taus),
            )
            evaluations += additions
        variances, additions = settle_sides(search, kind, theta, lower, upper, noise)
        evaluations += additions
    shape = search.shapes[kind]
    canonical = shape.canonical_theta(theta)
    # the axes are exchanged, and their variances with them
    if abs(np.sin(canonical[KAPPA] - theta[KAPPA])) > 0.5:
        variances = variances[[1, 0, 3, 2]]
    covariance = estimate_covariance(search, kind, canonical, noise, variances)
    return Estimate(shape, canonical, covariance, noise, value, bics, evaluations)


def settle_sides(search, kind, theta, lower, upper, noise) -> tuple[np.ndarray, int]:
    """Set sides to posterior means, then fit the rest with these held.

    The rest is heights, slopes and direction.

    `theta` in place.

    Returns (variances (4,) of centre u, centre v, V, U, evaluations).
    """
    hessian, inliers = kernel.height_hessian(search.whole, search.tables, kind, theta, noise)
    c, s = np.cos(theta[KAPPA]), np.sin(theta[KAPPA])
    size = search.tables.size[kind]
    free = [k for k in range(size) if k not in (HALF_WIDTH, HALF_LENGTH)]
    turned = np.eye(9)
    turned[:2, :2] = [[c, -s], [s, c]]
    information = (turned.T @ hessian @ turned)[np.ix_(free, free)] + 1e-4 * np.eye(len(free))
    centre_precision = 1 / np.diag(np.linalg.inv(information))[:2]
    variances = average_sides(search, kind, theta, noise, centre_precision, inliers)
    lower, upper = lower.copy(), upper.copy()
    lower[PLAN_INDICES] = upper[PLAN_INDICES] = theta[PLAN_INDICES]
    _, _, _, evaluations = kernel.minimise(
        search.whole, search.tables, kind, theta, lower, upper, noise, 4, 1e-3
    )
    return variances, evaluations


def average_sides(search, kind, theta, noise, centre_precision, inliers) -> np.ndarray:
    """Move `theta` to the posterior means of its four sides, heights held; in place.

    `centre_precision` (2,) is along u and v. Returns the variances (4,) of the centre along u and
    v, and of V and U.
    """
    halves, growths = theta[[HALF_LENGTH, HALF_WIDTH]], np.linspace(0.0, 1.0, SIDE_GRID)
    gaps = 2.0 * halves / max(inliers, 1.0)
    lower = np.maximum(-(2.0 * noise.tau + 1.5 * gaps), -0.5 * halves)
    shifts = lower[:, None] + (2.0 * noise.tau + 7.0 * gaps - lower)[:, None] * growths
    table = kernel.tabulate_sides(search.whole, search.tables, kind, theta, noise, shifts)
    # over axes, shifts of the side ahead and shifts of the side behind
    centre = 0.5 * (shifts[:, :, None] - shifts[:, None])
    growth = 0.5 * (shifts[:, :, None] + shifts[:, None])
    logs = table[::2, :, None] + table[1::2, None]
    logs -= inliers * np.log(1.0 + growth / halves[:, None, None])
    logs -= 0.5 * centre_precision[:, None, None] * centre**2
    weights = np.exp(logs - logs.max(axis=(1, 2), keepdims=True))
    weights /= weights.sum(axis=(1, 2), keepdims=True)
    means, squares = (
        np.array([(weights * one**power).sum(axis=(1, 2)) for one in (centre, growth)])
        for power in (1, 2)
    )
    c, s = np.cos(theta[KAPPA]), np.sin(theta[KAPPA])
    theta[:2] += np.array([[c, -s], [s, c]]) @ means[0]
    theta[[HALF_LENGTH, HALF_WIDTH]] += means[1]
    (centre_u, centre_v), (length, width) = squares - means**2
    return np.array([centre_u, centre_v, width, length])


def estimate_covariance(
    search: Search, kind: int, theta: np.ndarray, noise: Noise, variances: np.ndarray
) -> np.ndarray:
    """Return the covariance (9, 9) of theta.

    The sides' own `variances` are carried through the heights' inverse Hessian.
    """
    hessian, _ = kernel.height_hessian(search.whole, search.tables, kind, theta, noise)
    c, s = np.cos(theta[KAPPA]), np.sin(theta[KAPPA])
    turn = np.eye(4)
    turn[:2, :2] = [[c, -s], [s, c]]
    plan = (KAPPA,) if search.whole.plan_is_free else search.free
    heights = [*plan, *range(Q0, search.tables.size[kind])]
    tied = np.eye(9)[:, heights]
    if search.whole.is_round:
        tied[HALF_LENGTH] = theta[HALF_LENGTH] / theta[HALF_WIDTH] * tied[HALF_WIDTH]
    by_heights = np.linalg.inv(tied.T @ hessian @ tied + 1e-6 * np.eye(len(heights)))
    if not search.whole.plan_is_free:
        return tied @ by_heights @ tied.T
    covariance = np.zeros((9, 9))
    response = -by_heights @ hessian[np.ix_(heights, PLAN_INDICES)]
    of_plan = turn @ np.diag(variances) @ turn.T
    covariance[np.ix_(PLAN_INDICES, PLAN_INDICES)] = of_plan
    covariance[np.ix_(heights, PLAN_INDICES)] = response @ of_plan
    covariance[np.ix_(PLAN_INDICES, heights)] = (response @ of_plan).T
    covariance[np.ix_(heights, heights)] = by_heights + response @ of_plan @ response.T
    return covariance
