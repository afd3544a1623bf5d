"""The best accuracy of a roof's parameters by density and noise.

Heights. Given its place (x, y), a point's height is z = f(x, y; theta) + e with e of variance
sigma^2. For normal errors the Fisher information about theta is the sum over the points of the
outer product of the gradient g of f, divided by sigma^2; over a uniform density rho it is the
integral

    I_z = rho / sigma^2  *  integral over the outline of g g^T dA,

and no unbiased estimator has a covariance below its inverse (Cramer 1946, Rao 1945).

Sides. The places themselves tell where the outline ends. Their density jumps there, so no Fisher
information exists: the distance from an edge of length L to the point next to it is exponential
with rate rho L, and the best equivariant estimator of the edge's position has the variance 1 / (rho
L)^2, falling with the square of the density. We add

    I_xy = sum over the four edges of  (rho L)^2  grad(edge position) grad(edge position)^T

as if it were information (the *sampling limit*). It governs width, length and the place along the
ridge; heights, slopes and the place across the ridge come from I_z. What edges say of the rotation,
and what the steps of a saw-tooth say of its place, is of higher order and left out.
"""

from __future__ import annotations

import math

import numpy as np

from hiproof.primitives import Primitive
from hiproof.primitives.contract import CX, CY, HALF_LENGTH, HALF_WIDTH, KAPPA, Q0

GRID = 60
STEP = 1e-6
THETA_NAMES = ("x", "y", "kappa", "half_width", "half_length", "q0", "q1", "q2", "q3")


def compute_best_covariance(
    primitive: Primitive, theta: np.ndarray, density: float, sigma_m: float
) -> np.ndarray:
    """Return the covariance (k, k) that no estimator can go below.

    It is that of the used entries of theta (metres, radians, slopes).

    `density` in points/m2, `sigma_m` the standard deviation of the height errors. What neither
    heights nor edges tell (the rotation of a level roof) has an infinite variance.
    """
    theta = np.asarray(theta, float)
    information = compute_height_information(
        primitive, theta, density, sigma_m
    ) + compute_edge_information(primitive, theta, density)
    is_informed = np.diag(information) > 1e-9
    covariance = np.full_like(information, 0.0)
    covariance[np.ix_(is_informed, is_informed)] = np.linalg.inv(
        information[np.ix_(is_informed, is_informed)]
    )
    covariance[~is_informed, ~is_informed] = np.inf
    return covariance


def compute_height_information(
    primitive: Primitive, theta: np.ndarray, density: float, sigma_m: float
) -> np.ndarray:
    """Return I_z (k, k), integrated as a midpoint sum over the plan."""
    half_width, half_length = theta[HALF_WIDTH], theta[HALF_LENGTH]
    middle = (np.arange(GRID) + 0.5) / GRID * 2 - 1
    u, v = (axis.ravel() for axis in np.meshgrid(middle * half_length, middle * half_width))
    c, s = math.cos(theta[KAPPA]), math.sin(theta[KAPPA])
    xy = np.column_stack([theta[CX] + u * c - v * s, theta[CY] + u * s + v * c])
    gradient = compute_height_gradient(primitive, theta, xy)
    cell_area = 4 * half_width * half_length / GRID**2
    return gradient.T @ gradient * density * cell_area / sigma_m**2


def compute_height_gradient(primitive: Primitive, theta: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """Return derivatives (n, k) of the height at `xy` (n, 2).

    They are central differences by the used entries of theta.
    """
    columns = []
    for i in range(primitive.theta_size):
        upper, lower = theta.copy(), theta.copy()
        upper[i] += STEP
        lower[i] -= STEP
        columns.append(
            (primitive.height_at(upper, xy) - primitive.height_at(lower, xy)) / (2 * STEP)
        )
    return np.stack(columns, axis=1)


def compute_edge_information(primitive: Primitive, theta: np.ndarray, density: float) -> np.ndarray:
    """Return I_xy (k, k), from the edges' positions.

    Each edge's position is the centre's, plus or minus a half extent.
    """
    c, s = math.cos(theta[KAPPA]), math.sin(theta[KAPPA])
    information = np.zeros((primitive.theta_size,) * 2)
    for half, other, direction in (
        (HALF_LENGTH, HALF_WIDTH, (c, s)),
        (HALF_WIDTH, HALF_LENGTH, (-s, c)),
    ):
        rate = density * 2 * theta[other]
        for sign in (1.0, -1.0):
            gradient = np.zeros(primitive.theta_size)
            gradient[[CX, CY]] = direction
            gradient[half] = sign
            information += rate**2 * np.outer(gradient, gradient)
    return information


def compute_bounds(
    primitive: Primitive, theta: np.ndarray, density: float, sigma_m: float
) -> dict[str, float]:
    """Return least standard deviations by name.

    They are of entries of theta (`q0` is the top or eave height), place along and across the ridge,
    and theta_p (metres) by the delta rule.
    """
    theta = np.asarray(theta, float)
    size = primitive.theta_size
    covariance = compute_best_covariance(primitive, theta, density, sigma_m)
    bounds = {name: math.sqrt(covariance[i, i]) for i, name in enumerate(THETA_NAMES[:size])}
    covariance = np.where(np.isfinite(covariance), covariance, 0.0)
    c, s = math.cos(theta[KAPPA]), math.sin(theta[KAPPA])
    place = covariance[:2, :2]
    bounds["along"] = math.sqrt(np.array([c, s]) @ place @ np.array([c, s]))
    bounds["across"] = math.sqrt(np.array([-s, c]) @ place @ np.array([-s, c]))
    for name in primitive.parameters:
        gradient = compute_parameter_gradient(primitive, theta, name)
        bounds[name] = math.sqrt(max(gradient @ covariance @ gradient, 0.0))
    return bounds


def compute_parameter_gradient(primitive: Primitive, theta: np.ndarray, name: str) -> np.ndarray:
    """Return the derivative (k,) of one of theta_p.

    It is by the used entries of theta.
    """
    gradient = np.zeros(primitive.theta_size)
    for i in range(HALF_WIDTH, primitive.theta_size):
        upper, lower = theta.copy(), theta.copy()
        upper[i] += STEP
        lower[i] -= STEP
        gradient[i] = (
            primitive.from_theta(upper)[0][name] - primitive.from_theta(lower)[0][name]
        ) / (2 * STEP)
    return gradient


HEIGHTS_AND_SLOPES = THETA_NAMES[Q0:]
