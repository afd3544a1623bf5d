"""The compiled core against plain NumPy, for every variant of the catalogue."""

import numpy as np
import pytest

from hiproof.fit import kernel
from hiproof.fit.kernel import Noise, Problem
from hiproof.fit.likelihood import fit_heights
from hiproof.fit.tables import tables, variants
from hiproof.primitives import CATALOGUE

VARIANTS = list(enumerate(variants()))
IDS = [f"{variant.name}-{variant.strips}" for _, variant in VARIANTS]
each_variant = pytest.mark.parametrize(("kind", "primitive"), VARIANTS, ids=IDS)
NOISE = Noise(0.2, 0.4, 0.08)


def theta_and_problem(primitive, plan_is_free=True, count=200, seed=1):
    rng = np.random.default_rng(seed)
    theta = primitive.to_theta(primitive.typical(7.0, 11.0, 2.5), 0.5, np.array([0.3, -0.2, 1.0]))
    xy = rng.uniform(-6.5, 6.5, (count, 2))
    z = primitive.height_at(theta, xy) + rng.normal(0, 0.25, count)
    points = np.column_stack([xy, z, rng.uniform(0.3, 1.0, count)])
    return theta, Problem(points, -6.0, plan_is_free)


def plain_value(problem, primitive, theta, noise):
    """Minus the log likelihood in ten lines of NumPy."""
    x, y, z, prior = problem.points.T
    c, s = np.cos(theta[2]), np.sin(theta[2])
    u, v = c * (x - theta[0]) + s * (y - theta[1]), c * (y - theta[1]) - s * (x - theta[0])
    residual = (z - primitive.height_at(theta, problem.points[:, :2])) / noise.sigma
    inlier = (
        prior * (1 - noise.eps) * np.exp(-(residual**2) / 2) / (noise.sigma * np.sqrt(2 * np.pi))
    )
    if problem.plan_is_free:
        inside = (
            1
            / (1 + np.exp(-(theta[4] - abs(u)) / noise.tau))
            / (1 + np.exp(-(theta[3] - abs(v)) / noise.tau))
        )
        inlier *= inside / (4 * theta[3] * theta[4])
    return -np.log(inlier + (1 - prior * (1 - noise.eps)) * np.exp(problem.log_background)).sum()


def compiled(problem, kind, theta, noise=NOISE):
    gradient, hessian = np.zeros(9), np.zeros((9, 9))
    value, inliers, squares = kernel.evaluate(
        problem, tables(), kind, theta, noise, kernel.new_space(), gradient, hessian
    )
    return value, gradient, hessian, inliers, squares


@each_variant
@pytest.mark.parametrize("plan_is_free", [True, False])
def test_compiled_value_equals_plain_numpy(kind, primitive, plan_is_free):
    theta, problem = theta_and_problem(primitive, plan_is_free)
    assert compiled(problem, kind, theta)[0] == pytest.approx(
        plain_value(problem, primitive, theta, NOISE), abs=1e-3
    )


@each_variant
def test_planes_and_their_jacobian_equal_numeric_ones(kind, primitive):
    theta, _ = theta_and_problem(primitive)
    space, moved = kernel.new_space(), kernel.new_space()
    kernel.planes_from_terms(tables(), kind, theta, space.planes)
    count = tables().planes[kind]
    kernel.jacobian_from_terms(tables(), kind, theta, space.planes, space.jacobian)
    np.testing.assert_allclose(space.planes[:count], primitive.plane_values(theta), atol=1e-12)
    for k in range(3, primitive.theta_size):
        kernel.planes_from_terms(tables(), kind, theta + 1e-6 * np.eye(9)[k], moved.planes)
        numeric = (moved.planes - space.planes)[:count] / 1e-6
        np.testing.assert_allclose(space.jacobian[:count, :, k], numeric, atol=1e-4)


@each_variant
@pytest.mark.parametrize("plan_is_free", [True, False])
def test_gradient_equals_the_numeric_one(kind, primitive, plan_is_free):
    theta, problem = theta_and_problem(primitive, plan_is_free)
    gradient = compiled(problem, kind, theta)[1]
    for k in range(primitive.theta_size):
        if primitive.strips > 1 and k in (0, 1, 2, 3):
            continue  # a point that changes its tooth jumps: there is no derivative
        step = 1e-6 * np.eye(9)[k]
        ahead, backward = (
            compiled(problem, kind, theta + step)[0],
            compiled(problem, kind, theta - step)[0],
        )
        assert gradient[k] == pytest.approx((ahead - backward) / 2e-6, rel=2e-4, abs=2e-3)


@each_variant
def test_minimise_descends_and_stays_in_the_box(kind, primitive):
    theta, problem = theta_and_problem(primitive)
    lower, upper = theta - 0.3, theta + 0.4
    start = theta + 0.2
    start_value = compiled(problem, kind, start)[0]
    value, *_ = kernel.minimise(problem, tables(), kind, start, lower, upper, NOISE, 10, 1e-3)
    assert value <= start_value
    assert (start >= lower - 1e-12).all() and (start <= upper + 1e-12).all()


def test_fixed_parameters_do_not_move():
    gable = CATALOGUE["gable"]
    theta, problem = theta_and_problem(gable)
    kind = variants().index(gable)
    lower, upper = np.full(9, -np.inf), np.full(9, np.inf)
    fixed = [0, 1, 3, 4]
    lower[fixed] = upper[fixed] = theta[fixed]
    moved = theta + np.array([0, 0, 0.05, 0, 0, 0.3, 0.1, 0, 0])
    kernel.minimise(problem, tables(), kind, moved, lower, upper, NOISE, 20, 1e-6)
    np.testing.assert_array_equal(moved[fixed], theta[fixed])
    assert abs(moved[5] - theta[5]) < 0.1


@pytest.mark.parametrize("name", ["broach", "dome", "onion"])
def test_a_round_shape_is_fitted_at_right_angles_and_keeps_its_ratio(name):
    """Noise of points at right angles is that of their heights where the roof is steep."""
    shape = CATALOGUE[name]
    truth = shape.to_theta(shape.typical(8.0, 8.0, 8.0), 0.3, np.zeros(3))
    rng = np.random.default_rng(3)
    xy = rng.uniform(-3.9, 3.9, (900, 2))
    z = shape.height_at(truth, xy + rng.normal(0.0, 0.05, xy.shape))
    points = np.column_stack([xy, z + rng.normal(0.0, 0.05, len(xy)), np.ones(len(xy))])
    start = truth + np.array([0.1, -0.1, 0.0, 0.3, 0.3, 0.2, 0.05, 0.0, 0.0])
    free = (0, 1) if name == "broach" else (0, 1, 3)
    theta, noise = fit_heights(points, shape, start, free)
    assert theta[4] == pytest.approx(theta[3] * start[4] / start[3], abs=1e-9)
    assert theta[:2] == pytest.approx(truth[:2], abs=0.05)
    assert noise.sigma == pytest.approx(0.05, abs=0.015)


def test_a_point_of_no_roof_probability_does_not_matter():
    gable = CATALOGUE["gable"]
    theta, problem = theta_and_problem(gable)
    kind = variants().index(gable)
    points = problem.points.copy()
    points[::3, 3] = 0.0
    moved = points.copy()
    moved[::3, 2] += 7.0
    first, second = (compiled(problem._replace(points=p), kind, theta) for p in (points, moved))
    assert first[0] == pytest.approx(second[0])
    np.testing.assert_allclose(first[1], second[1])


def test_gradient_and_hessian_are_finite_for_points_far_away():
    theta, problem = theta_and_problem(CATALOGUE["hip"])
    distant_problem = problem._replace(points=problem.points * (1e3, 1e3, 1e3, 1))
    value, gradient, hessian, inliers, _ = compiled(
        distant_problem, variants().index(CATALOGUE["hip"]), theta
    )
    assert np.isfinite(value) and np.isfinite(gradient).all() and np.isfinite(hessian).all()
    assert 0 <= inliers <= len(distant_problem.points)
