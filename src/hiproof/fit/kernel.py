"""The compiled core: the likelihood of one roof, for every primitive.

It has its gradient, its Hessian and its minimisation.

Each point is drawn from a mixture: inside the plan rectangle with soft sides, normal about the
roof's height, or an outlier anywhere in the cloud's volume,

    p_i = w_i (1 - eps) S(mu_u / tau) S(mu_v / tau) / (4 U V) N(z_i; roof, sigma) + (1 - w_i (1 -
    eps)) / volume

with mu_u = U - |u|, mu_v = V - |v| the margins to the sides, S the logistic function, w_i the given
probability that the point is roof. The roof at (u, v) is the lowest plane (or the plane of the
strip, for a saw-tooth, and the highest of several minima, for an onion). A point enters the
gradient and the Gauss-Newton Hessian through its active plane only, so sums of moments of (u, v, 1)
by plane, and five by side, suffice; a small Jacobian of planes by parameters (from the term table)
takes them to theta.

Units are metres and radians, points are (n, 4): x, y, z, w.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..compiled import compiled
from ..geometry.arrays import copy_row, measure_range

MAX_PLANES = 64  # of a primitive: a dome's facets
# places in theta (9,); after the last come q1, q2, q3
CENTRE_X, CENTRE_Y, KAPPA, HALF_WIDTH, HALF_LENGTH, Q0 = range(6)
SIZE = 9  # numbers of theta
# m and rad that a number may change by in a step: beyond, the quadratic model is none
STEP_CAP_M, STEP_CAP_RAD = 1.5, 0.25
FAR_SQUARED = 60.0  # squared normalised residual beyond which a point is certainly an outlier
SOFT = 10.0  # margins of more than this many tau are inside for certain
SQRT_2PI = math.sqrt(2 * math.pi)


class Tables(NamedTuple):
    """Primitives as data, one row a variant (T of them).

    Terms of variant t are first_term[t]:first_term[t + 1].
    """

    size: np.ndarray  # (T,) used entries of theta
    planes: np.ndarray  # (T,) number of planes
    ends: np.ndarray  # (T, k) where the planes of each minimum end, the last repeated
    strips: np.ndarray  # (T,) 1, or the number of teeth
    first_term: np.ndarray  # (T + 1,)
    factor: np.ndarray  # (m,)
    target: np.ndarray  # (m,) 3 plane + coefficient
    power: np.ndarray  # (m, 6) exponents of V, U, q0..q3
    turns: np.ndarray  # (T,) quarter turns tried by the vote, 0 where there is none
    slopes: np.ndarray  # (T, k) slopes tried by the vote, NaN where fewer
    shifts: np.ndarray  # (T, k) shifts of the ridge tried, shares of V, NaN where fewer


class Problem(NamedTuple):
    """The points of one roof and what is known before fitting."""

    points: np.ndarray  # (n, 4) x, y, z and the probability of being roof
    # log density of an outlier, per m3 (per m of height where the plan is given)
    log_background: float
    plan_is_free: bool  # whether the sides are fitted; a given outline has no plan likelihood
    # whether noise is at right angles to the roof, and its plan keeps its ratio of sides
    is_round: bool = False


class Noise(NamedTuple):
    """sigma (m) of heights, tau (m) softness of the sides, eps share of outliers."""

    sigma: float
    tau: float
    eps: float


class Space(NamedTuple):
    """Working arrays of one evaluation."""

    planes: np.ndarray  # (MAX_PLANES, 3)
    leans: np.ndarray  # (MAX_PLANES,) distances at right angles to them of points 1 m above
    jacobian: np.ndarray  # (MAX_PLANES, 3, SIZE) of the planes by theta
    moments: np.ndarray  # (MAX_PLANES, 9) six of the Hessian, three of the gradient
    sides: np.ndarray  # (4, 5) at +u, -u, +v, -v: two of the gradient, three of the Hessian


@compiled
def new_space():
    return Space(
        np.zeros((MAX_PLANES, 3)),
        np.ones(MAX_PLANES),
        np.zeros((MAX_PLANES, 3, SIZE)),
        np.zeros((MAX_PLANES, 9)),
        np.zeros((4, 5)),
    )


@compiled
def integer_power(base, exponent):
    """Return base ** exponent for small, possibly negative exponents.

    They are those of the term table.
    """
    if exponent == 1:
        return base
    result = 1.0
    for _ in range(abs(exponent)):
        result *= base
    return result if exponent >= 0 else 1.0 / result


@compiled
def planes_from_terms(tables, kind, theta, planes):
    """Fill `planes` (k, 3) at `theta`: z = a u + b v + c."""
    count = tables.planes[kind]
    planes[:count] = 0.0
    for m in range(tables.first_term[kind], tables.first_term[kind + 1]):
        value = tables.factor[m]
        for k in range(6):
            if tables.power[m, k] != 0:
                value *= integer_power(theta[HALF_WIDTH + k], tables.power[m, k])
        planes[tables.target[m] // 3, tables.target[m] % 3] += value


@compiled
def jacobian_from_terms(tables, kind, theta, planes, jacobian):
    """Fill the exact `jacobian` (k, 3, 9) of `planes` (k, 3) by theta."""
    count = tables.planes[kind]
    jacobian[:count] = 0.0
    for m in range(tables.first_term[kind], tables.first_term[kind + 1]):
        plane, coefficient = tables.target[m] // 3, tables.target[m] % 3
        for k in range(6):
            exponent = tables.power[m, k]
            if exponent != 0:
                derivative = (
                    tables.factor[m] * exponent * integer_power(theta[HALF_WIDTH + k], exponent - 1)
                )
                for other in range(6):
                    if other != k and tables.power[m, other] != 0:
                        derivative *= integer_power(
                            theta[HALF_WIDTH + other], tables.power[m, other]
                        )
                jacobian[plane, coefficient, HALF_WIDTH + k] += derivative
    c, s = math.cos(theta[KAPPA]), math.sin(theta[KAPPA])
    for j in range(count):
        a, b = planes[j, 0], planes[j, 1]
        jacobian[j, 2, CENTRE_X] = -a * c + b * s
        jacobian[j, 2, CENTRE_Y] = -a * s - b * c
        jacobian[j, 0, KAPPA] = -b
        jacobian[j, 1, KAPPA] = a


@compiled
def active_plane(planes, ends, strips, half_width, u, v):
    """Index of the plane that is the roof at (u, v) and the height there.

    It is the highest of the minima whose planes end at `ends`.
    """
    if strips > 1:
        j = int((v + half_width) * strips / (2.0 * half_width))
        j = min(max(j, 0), strips - 1)
        return j, planes[j, 0] * u + planes[j, 1] * v + planes[j, 2]
    highest, active, first = -np.inf, 0, 0
    for end in ends:
        if end == first:
            break
        lowest, j = planes[first, 0] * u + planes[first, 1] * v + planes[first, 2], first
        for k in range(first + 1, end):
            z = planes[k, 0] * u + planes[k, 1] * v + planes[k, 2]
            if z < lowest:
                lowest, j = z, k
        if lowest > highest:
            highest, active = lowest, j
        first = end
    return active, highest


@compiled
def measure_leans(tables, kind, theta, space):
    """Fill the leans of `space`, which stay while theta is fitted."""
    planes_from_terms(tables, kind, theta, space.planes)
    for j in range(tables.planes[kind]):
        space.leans[j] = 1.0 / math.hypot(1.0, math.hypot(space.planes[j, 0], space.planes[j, 1]))


@compiled
def sum_moments(problem, tables, kind, theta, noise, space):
    """Return minus the log likelihood at `theta`, and fill `space`.

    `space` has planes, moments and sides.

    Returns (value, sum of inlier probabilities, sum of them times squared normalised residuals).
    """
    points, planes, moments, sides = problem.points, space.planes, space.moments, space.sides
    planes_from_terms(tables, kind, theta, planes)
    ends, strips = tables.ends[kind], tables.strips[kind]
    c, s = math.cos(theta[KAPPA]), math.sin(theta[KAPPA])
    half_width, half_length = theta[HALF_WIDTH], theta[HALF_LENGTH]
    per_sigma, per_tau = 1.0 / noise.sigma, 1.0 / noise.tau
    background = math.exp(problem.log_background)
    scale = (1.0 - noise.eps) / SQRT_2PI
    if problem.plan_is_free:
        scale /= 4.0 * half_width * half_length
    moments[:] = 0.0
    sides[:] = 0.0
    value = inliers = squares = 0.0
    product = 1.0  # logs are taken of products of many densities: far fewer calls
    for i in range(points.shape[0]):
        dx, dy = points[i, 0] - theta[CENTRE_X], points[i, 1] - theta[CENTRE_Y]
        u, v = c * dx + s * dy, c * dy - s * dx
        j, roof = active_plane(planes, ends, strips, half_width, u, v)
        precision = space.leans[j] * per_sigma
        residual = (points[i, 2] - roof) * precision
        prior = points[i, 3]
        outlier = (1.0 - prior * (1.0 - noise.eps)) * background
        margin_u, margin_v = SOFT, SOFT
        if problem.plan_is_free:
            margin_u, margin_v = (half_length - abs(u)) * per_tau, (half_width - abs(v)) * per_tau
        is_far = residual * residual > FAR_SQUARED or margin_u < -25.0 or margin_v < -25.0
        inside_u, inside_v = (
            (0.0, 0.0) if is_far else (share_inside(margin_u), share_inside(margin_v))
        )
        inlier = (
            0.0
            if is_far
            else prior * scale * precision * inside_u * inside_v * math.exp(-0.5 * residual**2)
        )
        product *= inlier + outlier
        if product < 1e-250 or product > 1e250:
            value -= math.log(product)
            product = 1.0
        if is_far:
            continue
        w = inlier / (inlier + outlier)
        inliers += w
        squares += w * residual * residual
        add_moments(moments[j], w * precision * precision, w * residual * precision, u, v)
        if margin_u < SOFT:
            add_side(
                sides[0 if u > 0 else 1], w * (1.0 - inside_u) * per_tau, inside_u * per_tau, v
            )
        if margin_v < SOFT:
            add_side(
                sides[2 if v > 0 else 3], w * (1.0 - inside_v) * per_tau, inside_v * per_tau, u
            )
    return value - math.log(product), inliers, squares


@compiled
def share_inside(margin):
    """Return how much of a soft edge lies within it.

    The point is `margin` softnesses inside.
    """
    return 1.0 / (1.0 + math.exp(-margin)) if margin < SOFT else 1.0


@compiled
def add_moments(m, weight, pull, u, v):
    """Add to the moments (9,) of a plane those of a point at u, v."""
    m[0] += weight * u * u
    m[1] += weight * u * v
    m[2] += weight * u
    m[3] += weight * v * v
    m[4] += weight * v
    m[5] += weight
    m[6] += pull * u
    m[7] += pull * v
    m[8] += pull


@compiled
def add_side(side, push, stiffness, along):
    """Add a point near a side, `along` metres from its middle."""
    side[0] += push
    side[1] += push * along
    side[2] += push * stiffness
    side[3] += push * stiffness * along
    side[4] += push * stiffness * along * along


@compiled
def add_height_terms(tables, kind, theta, space, gradient, hessian):
    """Add the residuals' part to `gradient` (9,) and `hessian` (9, 9).

    Only the lower triangle of `hessian` is filled.
    """
    jacobian_from_terms(tables, kind, theta, space.planes, space.jacobian)
    for j in range(tables.planes[kind]):
        m, d = space.moments[j], space.jacobian[j]
        if m[5] == 0.0:
            continue
        for a in range(tables.size[kind]):
            if d[0, a] == 0.0 and d[1, a] == 0.0 and d[2, a] == 0.0:
                continue
            gradient[a] -= m[6] * d[0, a] + m[7] * d[1, a] + m[8] * d[2, a]
            t0 = m[0] * d[0, a] + m[1] * d[1, a] + m[2] * d[2, a]
            t1 = m[1] * d[0, a] + m[3] * d[1, a] + m[4] * d[2, a]
            t2 = m[2] * d[0, a] + m[4] * d[1, a] + m[5] * d[2, a]
            for b in range(a + 1):
                hessian[a, b] += t0 * d[0, b] + t1 * d[1, b] + t2 * d[2, b]


@compiled
def add_side_terms(space, theta, inliers, gradient, hessian):
    """Add the part of the soft sides and of the area.

    margin = half extent - |u| has the derivative alpha + beta * (position along the side).
    """
    c, s = math.cos(theta[KAPPA]), math.sin(theta[KAPPA])
    gradient[HALF_WIDTH] += inliers / theta[HALF_WIDTH]
    gradient[HALF_LENGTH] += inliers / theta[HALF_LENGTH]
    alpha, beta = np.zeros(5), np.zeros(5)
    for e in range(4):
        sign = 1.0 - 2.0 * (e % 2)
        alpha[:] = 0.0
        beta[:] = 0.0
        if e < 2:
            alpha[CENTRE_X], alpha[CENTRE_Y], alpha[HALF_LENGTH] = sign * c, sign * s, 1.0
            beta[KAPPA] = -sign
        else:
            alpha[CENTRE_X], alpha[CENTRE_Y], alpha[HALF_WIDTH] = -sign * s, sign * c, 1.0
            beta[KAPPA] = sign
        side = space.sides[e]
        for a in range(5):
            gradient[a] -= side[0] * alpha[a] + side[1] * beta[a]
            for b in range(a + 1):
                mixed = alpha[a] * beta[b] + beta[a] * alpha[b]
                hessian[a, b] += (
                    side[2] * alpha[a] * alpha[b] + side[3] * mixed + side[4] * beta[a] * beta[b]
                )


@compiled
def evaluate(problem, tables, kind, theta, noise, space, gradient, hessian):
    """Return minus the log likelihood, and fill its derivatives.

    These are `gradient` (9,) and the Gauss-Newton `hessian` (9, 9) at `theta` (9,).

    Returns (value, sum of inlier probabilities, sum of them times squared normalised residuals).
    """
    value, inliers, squares = sum_moments(problem, tables, kind, theta, noise, space)
    gradient[:] = 0.0
    hessian[:] = 0.0
    add_height_terms(tables, kind, theta, space, gradient, hessian)
    if problem.plan_is_free:
        add_side_terms(space, theta, inliers, gradient, hessian)
    for a in range(SIZE):
        for b in range(a):
            hessian[b, a] = hessian[a, b]
    return value, inliers, squares


@compiled
def solve_damped(hessian, gradient, damping, size, step, factor):
    """Solve (H + damping diag H) step = -gradient by Cholesky.

    False where that is not positive definite.
    """
    for i in range(size):
        for j in range(i + 1):
            total = hessian[i, j]
            if i == j:
                total += damping * hessian[i, i] + 1e-6
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if i > j:
                factor[i, j] = total / factor[j, j]
            elif total > 1e-12:
                factor[i, i] = math.sqrt(total)
            else:
                return False
    for i in range(size):
        total = -gradient[i]
        for k in range(i):
            total -= factor[i, k] * step[k]
        step[i] = total / factor[i, i]
    for i in range(size - 1, -1, -1):
        total = step[i]
        for k in range(i + 1, size):
            total -= factor[k, i] * step[k]
        step[i] = total / factor[i, i]
    return True


@compiled
def freeze_at_bounds(theta, lower, upper, size, gradient, hessian):
    """Take the parameters whose bound stops them out of the step: the active set."""
    for k in range(size):
        if (theta[k] <= lower[k] and gradient[k] >= 0.0) or (
            theta[k] >= upper[k] and gradient[k] <= 0.0
        ):
            fix(k, gradient, hessian)


@compiled
def tie_sides(ratio, gradient, hessian):
    """Take the half length, which is `ratio` half widths, out of the step."""
    gradient[HALF_WIDTH] += ratio * gradient[HALF_LENGTH]
    hessian[HALF_WIDTH, :] += ratio * hessian[HALF_LENGTH, :]
    hessian[:, HALF_WIDTH] += ratio * hessian[:, HALF_LENGTH]
    fix(HALF_LENGTH, gradient, hessian)


@compiled
def fix(k, gradient, hessian):
    gradient[k] = 0.0
    hessian[k, :] = 0.0
    hessian[:, k] = 0.0
    hessian[k, k] = 1.0


@compiled
def take_step(theta, step, lower, upper, size, ratio, moved):
    """Set `moved` to theta + step, shortened to the step caps and within the bounds.

    Its half length is `ratio` half widths, where that is positive.
    """
    share = 1.0
    for k in range(size):
        cap = STEP_CAP_RAD if k == KAPPA else STEP_CAP_M
        if abs(step[k]) * share > cap:
            share = cap / abs(step[k])
    for k in range(SIZE):
        move = share * step[k] if k < size else 0.0
        moved[k] = min(max(theta[k] + move, lower[k]), upper[k])
    if ratio > 0.0:
        moved[HALF_LENGTH] = ratio * moved[HALF_WIDTH]


@compiled
def minimise(problem, tables, kind, theta, lower, upper, noise, iterations, tolerance):
    """Minimise from `theta` (9,), in place, by Levenberg-Marquardt.

    It stays within the box [lower, upper].

    A parameter with low = high is fixed. Ends after `iterations` or when a step gains less than
    `tolerance` (nats). Returns (value, inliers, squares, number of evaluations), the middle two as
    `evaluate`.
    """
    size = tables.size[kind]
    space = new_space()
    gradient, hessian = np.zeros(SIZE), np.zeros((SIZE, SIZE))
    gradient_new, hessian_new = np.zeros(SIZE), np.zeros((SIZE, SIZE))
    step, factor, moved = np.zeros(SIZE), np.zeros((SIZE, SIZE)), theta.copy()
    ratio = theta[HALF_LENGTH] / theta[HALF_WIDTH] if problem.is_round else 0.0
    take_step(theta, step, lower, upper, size, ratio, theta)
    if problem.is_round:
        measure_leans(tables, kind, theta, space)
    value, inliers, squares = evaluate(
        problem, tables, kind, theta, noise, space, gradient, hessian
    )
    evaluations, damping = 1, 1e-3
    for _ in range(iterations):
        if problem.is_round:
            tie_sides(ratio, gradient, hessian)
        freeze_at_bounds(theta, lower, upper, size, gradient, hessian)
        gain = -1.0
        for _ in range(6):
            if not solve_damped(hessian, gradient, damping, size, step, factor):
                damping = max(10 * damping, 1e-3)
                continue
            take_step(theta, step, lower, upper, size, ratio, moved)
            value_new, inliers_new, squares_new = evaluate(
                problem, tables, kind, moved, noise, space, gradient_new, hessian_new
            )
            evaluations += 1
            if value_new < value:
                gain = value - value_new
                break
            damping = max(8 * damping, 1e-3)
        if gain < 0:
            break
        copy_row(theta, moved)
        value, inliers, squares = value_new, inliers_new, squares_new
        gradient, gradient_new = gradient_new, gradient
        hessian, hessian_new = hessian_new, hessian
        damping *= 0.15
        if gain < tolerance:
            break
    return value, inliers, squares, evaluations


@compiled
def minimise_each(problem, tables, kinds, thetas, lows, highs, noise, iterations, tolerance):
    """Minimise from every row of `thetas` (m, 9), in place.

    Returns (values (m,), evaluations).
    """
    values = np.empty(len(kinds))
    total = 0
    for i in range(len(kinds)):
        values[i], _, _, evaluations = minimise(
            problem, tables, kinds[i], thetas[i], lows[i], highs[i], noise, iterations, tolerance
        )
        total += evaluations
    return values, total


@compiled
def learn_noise(points_count, inliers, squares, noise, prior):
    """Update `noise` by one EM step.

    sigma and eps maximise the expected likelihood under the prior on sigma.

    `prior` is (sigma, its worth in points, smallest, largest).
    """
    sigma = math.sqrt((squares * noise.sigma**2 + prior[1] * prior[0] ** 2) / (inliers + prior[1]))
    eps = (points_count - inliers + 0.5) / (points_count + 5.0)
    return Noise(min(max(sigma, prior[2]), prior[3]), noise.tau, min(max(eps, 0.005), 0.5))


@compiled
def estimate_each(problem, tables, kinds, thetas, lows, highs, noises, prior, rounds):
    """Fit theta and noise in turns from every row, in place.

    Rows are `thetas` (m, 9) and `noises` (m, 3).

    Returns (values (m,), evaluations).
    """
    values = np.empty(len(kinds))
    total = 0
    for i in range(len(kinds)):
        noise = Noise(noises[i, 0], noises[i, 1], noises[i, 2])
        for k in range(rounds):
            last = k == rounds - 1
            values[i], inliers, squares, evaluations = minimise(
                problem,
                tables,
                kinds[i],
                thetas[i],
                lows[i],
                highs[i],
                noise,
                15 if last else 6,
                1e-3 if last else 0.02,
            )
            total += evaluations
            if not last:
                noise = learn_noise(len(problem.points), inliers, squares, noise, prior)
        noises[i, 0], noises[i, 1], noises[i, 2] = noise.sigma, noise.tau, noise.eps
    return values, total


@compiled
def sharpen_sides(problem, tables, kind, theta, lower, upper, noise, prior, taus):
    """Fit again with harder and harder sides, and keep the best.

    `theta` in place. Returns (value, noise, evaluations).

    Ends when two steps of `taus` in a row did not better the likelihood.
    """
    best, best_noise, moved = np.inf, noise, theta.copy()
    worse = total = 0
    for tau in taus:
        noise = Noise(noise.sigma, tau, noise.eps)
        _, inliers, squares, first = minimise(
            problem, tables, kind, moved, lower, upper, noise, 10, 0.01
        )
        noise = learn_noise(len(problem.points), inliers, squares, noise, prior)
        value, _, _, second = minimise(problem, tables, kind, moved, lower, upper, noise, 6, 0.01)
        total += first + second
        if value < best:
            best, best_noise, worse = value, noise, 0
            copy_row(theta, moved)
        else:
            worse += 1
            if worse == 2:
                break
    return best, best_noise, total


@compiled
def tabulate_sides(problem, tables, kind, theta, noise, shifts):
    """Return log likelihood ratios (4, k) of moving each side outward.

    Sides are +u, -u, +v and -v; `shifts` (2, k) are along u and along v.
    """
    points, planes = problem.points, new_space().planes
    planes_from_terms(tables, kind, theta, planes)
    ends, strips = tables.ends[kind], tables.strips[kind]
    c, s = math.cos(theta[KAPPA]), math.sin(theta[KAPPA])
    background = math.exp(problem.log_background)
    scale = (1.0 - noise.eps) / (
        4.0 * theta[HALF_WIDTH] * theta[HALF_LENGTH] * noise.sigma * SQRT_2PI
    )
    table = np.zeros((4, shifts.shape[1]))
    for i in range(len(points)):
        dx, dy = points[i, 0] - theta[CENTRE_X], points[i, 1] - theta[CENTRE_Y]
        u, v = c * dx + s * dy, c * dy - s * dx
        _, roof = active_plane(planes, ends, strips, theta[HALF_WIDTH], u, v)
        residual = (points[i, 2] - roof) / noise.sigma
        if residual * residual > FAR_SQUARED:
            continue
        height = points[i, 3] * scale * math.exp(-0.5 * residual * residual)
        outlier = (1.0 - points[i, 3] * (1.0 - noise.eps)) * background
        for axis in range(2):
            across, along = (u, v) if axis == 0 else (v, u)
            margin = (theta[HALF_LENGTH - axis] - abs(across)) / noise.tau
            margin_other = (theta[HALF_WIDTH + axis] - abs(along)) / noise.tau
            if margin + shifts[axis, 0] / noise.tau > 8.0 or margin_other < -8.0:
                continue
            inlier = height / (1.0 + math.exp(-margin_other))
            row = table[2 * axis + (0 if across > 0 else 1)]
            for k in range(shifts.shape[1]):
                soft = margin + shifts[axis, k] / noise.tau
                inside = 1.0 / (1.0 + math.exp(-soft)) if soft > -30.0 else 1e-13
                row[k] += math.log((inlier * inside + outlier) / (inlier + outlier))
    return table


@compiled
def height_hessian(problem, tables, kind, theta, noise):
    """Return the Hessian (9, 9) of the heights and the sum of inliers.

    Sides do not count. The sum is that of inlier probabilities.
    """
    space = new_space()
    gradient, hessian = np.zeros(SIZE), np.zeros((SIZE, SIZE))
    if problem.is_round:
        measure_leans(tables, kind, theta, space)
    _, inliers, _ = sum_moments(problem, tables, kind, theta, noise, space)
    add_height_terms(tables, kind, theta, space, gradient, hessian)
    for a in range(SIZE):
        for b in range(a):
            hessian[b, a] = hessian[a, b]
    return hessian, inliers


@compiled
def mode(values, bin_m, counts):
    """Return (count, position) of the fullest pair of neighbouring bins.

    `counts` is working space.
    """
    smallest, largest = measure_range(values)
    bins = min(int((largest - smallest) / bin_m) + 2, len(counts))
    counts[:bins] = 0
    for value in values:
        k = int((value - smallest) / bin_m)
        if k < bins:
            counts[k] += 1
    best = 0
    for k in range(bins - 1):
        if counts[k] + counts[k + 1] > counts[best] + counts[best + 1]:
            best = k
    return counts[best] + counts[best + 1], smallest + (best + 1) * bin_m


@compiled
def vote(problem, tables, kind, theta, space, heights, counts):
    """Find the best slope and height of `kind` in a plan, in place.

    It is a small Hough transform in the plan of `theta`.

    Returns the votes.
    """
    points = problem.points
    best, best_slope, best_shift, best_z = -1, 0.0, 0.0, 0.0
    c, s = math.cos(theta[KAPPA]), math.sin(theta[KAPPA])
    ends, strips = tables.ends[kind], tables.strips[kind]
    theta[Q0:] = 0.0
    for shift in tables.shifts[kind]:
        for slope in tables.slopes[kind]:
            if (
                math.isnan(shift)
                or math.isnan(slope)
                or (shift != 0.0 and not problem.plan_is_free)
            ):
                continue
            for k in range(Q0 + 1, tables.size[kind]):
                theta[k] = slope
            planes_from_terms(tables, kind, theta, space.planes)
            for i in range(len(points)):
                dx, dy = points[i, 0] - theta[CENTRE_X], points[i, 1] - theta[CENTRE_Y]
                u, v = c * dx + s * dy, c * dy - s * dx - shift * theta[HALF_WIDTH]
                _, roof = active_plane(space.planes, ends, strips, theta[HALF_WIDTH], u, v)
                heights[i] = points[i, 2] - roof
            votes, z = mode(heights, 0.2, counts)
            if votes > best:
                best, best_slope, best_shift, best_z = votes, slope, shift, z
    for k in range(Q0 + 1, tables.size[kind]):
        theta[k] = best_slope
    theta[Q0] = best_z
    theta[CENTRE_X] -= s * best_shift * theta[HALF_WIDTH]
    theta[CENTRE_Y] += c * best_shift * theta[HALF_WIDTH]
    return best


@compiled
def vote_each(problem, tables, rectangles):
    """Return the starts of every voting variant in every rectangle.

    `rectangles` (d, 5) are cx, cy, kappa, V, U, and each is tried in its quarter turns.

    Returns (kinds (m,), thetas (m, 9), votes (m,)).
    """
    limit = len(rectangles) * tables.turns.sum()
    kinds, thetas, votes = np.empty(limit, np.int64), np.zeros((limit, SIZE)), np.empty(limit)
    space, heights, counts = new_space(), np.empty(len(problem.points)), np.zeros(400, np.int64)
    count = 0
    for rectangle in rectangles:
        for kind in range(len(tables.size)):
            for turn in range(tables.turns[kind]):
                theta = thetas[count]
                copy_row(theta, rectangle)
                theta[KAPPA] += turn * math.pi / 2
                if turn % 2 == 1:
                    theta[HALF_WIDTH], theta[HALF_LENGTH] = (
                        rectangle[HALF_LENGTH],
                        rectangle[HALF_WIDTH],
                    )
                kinds[count] = kind
                votes[count] = vote(problem, tables, kind, theta, space, heights, counts)
                count += 1
    return kinds[:count], thetas[:count], votes[:count]
