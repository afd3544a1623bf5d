"""The Cramer-Rao bound against formulas by hand, against least squares that reaches it, and its
laws.
"""

import math

import numpy as np
import pytest
from experiments.cramer_rao import compute_bounds, compute_height_information

from hiproof.primitives import CATALOGUE

EXAMPLES = {
    "flat": {"width": 8, "length": 12},
    "monopitch": {"width": 6, "length": 9, "height": 2},
    "gable": {"width": 8, "length": 12, "height": 3},
    "hip": {"width": 8, "length": 14, "height": 3, "ridge_length": 6},
    "half_hip": {"width": 8, "length": 14, "height": 4, "ridge_length": 10, "hip_height": 2},
    "pyramid": {"width": 8, "length": 9, "height": 3},
    "mansard": {"width": 9, "length": 13, "height": 2.5, "top_width": 6, "top_length": 10},
    "shed": {"width": 15, "length": 10, "height": 2, "teeth": 3},
    "asymmetric_gable": {
        "width": 8,
        "length": 12,
        "height": 3,
        "ridge_offset": 1.2,
        "eave_step": 1,
    },
    "gambrel": {"width": 9, "length": 12, "height": 4, "break_width": 5, "break_height": 2.8},
}


def make_theta(kind, kappa=0.4):
    primitive = CATALOGUE[kind].variant(EXAMPLES[kind])
    return primitive, primitive.to_theta(EXAMPLES[kind], kappa, np.array([1.0, -2.0, 5.0]))


def test_a_flat_roofs_height_is_the_mean_of_its_points():
    primitive, theta = make_theta("flat")
    assert compute_bounds(primitive, theta, 5.0, 0.1)["q0"] == pytest.approx(
        0.1 / math.sqrt(5 * 96), rel=1e-6
    )


def test_a_gables_ridge_and_slope_are_those_of_a_straight_line():
    # By symmetry z = q0 - q1 |v| is a line over |v| uniform in [0, V]: var q1 = s^2 / (n V^2 / 12),
    # var q0 = 4 s^2 / n.
    primitive, theta = make_theta("gable")
    n = 4.72 * 96
    bounds = compute_bounds(primitive, theta, 4.72, 0.09)
    assert bounds["q0"] == pytest.approx(2 * 0.09 / math.sqrt(n), rel=1e-3)
    assert bounds["q1"] == pytest.approx(0.09 / math.sqrt(n * 16 / 12), rel=1e-3)


def test_an_edges_limit_is_the_mean_distance_to_its_nearest_point():
    primitive, theta = make_theta("flat")
    bounds = compute_bounds(primitive, theta, 2.0, 0.1)
    assert bounds["half_length"] == pytest.approx(1 / (2 * 8) / math.sqrt(2))
    assert bounds["width"] == pytest.approx(2 / (2 * 12) / math.sqrt(2))
    assert math.isinf(bounds["kappa"])


@pytest.mark.parametrize("kind", ["gable", "hip", "pyramid", "gambrel"])
def test_gauss_newton_with_known_sides_reaches_the_bound(kind):
    """Least squares of the heights, linear about the truth: its covariance is the bound without the
    edges' part.
    """
    primitive, theta = make_theta(kind)
    rng = np.random.default_rng(5)
    from experiments.cramer_rao import compute_height_gradient

    free = [2, *range(5, primitive.theta_size)]
    half_width, half_length = theta[3:5]
    errors = []
    for _ in range(400):
        n = rng.poisson(4.0 * 4 * half_width * half_length)
        u, v = rng.uniform(-half_length, half_length, n), rng.uniform(-half_width, half_width, n)
        c, s = math.cos(theta[2]), math.sin(theta[2])
        xy = np.column_stack([theta[0] + u * c - v * s, theta[1] + u * s + v * c])
        gradient = compute_height_gradient(primitive, theta, xy)[:, free]
        errors.append(np.linalg.lstsq(gradient, rng.normal(0, 0.1, n), rcond=None)[0])
    information = compute_height_information(primitive, theta, 4.0, 0.1)[np.ix_(free, free)]
    bound = np.sqrt(np.diag(np.linalg.inv(information)))
    np.testing.assert_allclose(np.std(errors, axis=0) / bound, 1, atol=0.15)


@pytest.mark.parametrize("kind", EXAMPLES)
def test_every_primitive_has_a_bound_that_a_turn_does_not_change(kind):
    primitive, theta = make_theta(kind)
    bounds = compute_bounds(primitive, theta, 4.72, 0.1)
    turned = theta + np.array([50.0, 20, 1.1, 0, 0, 0, 0, 0, 0])
    for name, value in compute_bounds(primitive, turned, 4.72, 0.1).items():
        if name not in ("x", "y"):
            assert value == pytest.approx(bounds[name], rel=1e-4, abs=1e-9), name
    for name in ("q0", "along", "across", "width", "length"):
        assert 0 < bounds[name] < 1
