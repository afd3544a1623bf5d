"""Round shapes over points, as `shapes/rounds.py` fits them."""

from __future__ import annotations

import numpy as np

from ..primitives import CATALOGUE
from ..primitives.contract import Q0, Primitive
from .likelihood import find_covariance as find_round_covariance
from .likelihood import fit_heights


def approach(
    points: np.ndarray, shape: Primitive, theta: np.ndarray, free: tuple[int, ...]
) -> tuple[float, np.ndarray]:
    """Return the noise (m), and theta (9,) whose numbers `free` are fitted to points (n, 3)."""
    cloud = np.column_stack([points, np.ones(len(points))])
    theta, noise = fit_heights(cloud, CATALOGUE[shape.name], theta, free)
    return noise.sigma, theta


def find_covariance(
    points: np.ndarray,
    shape: Primitive,
    theta: np.ndarray,
    free: tuple[int, ...] = (),
    width_variance: float = 0.0,
) -> np.ndarray:
    cloud, shape = np.column_stack([points, np.ones(len(points))]), CATALOGUE[shape.name]
    plan = tuple(k for k in free if k < Q0)
    return find_round_covariance(cloud, shape, theta, plan, width_variance)


def list_heights(shape: Primitive) -> tuple[int, ...]:
    """List the numbers of theta that do not change a shape's plan."""
    return tuple(range(Q0, shape.theta_size))
