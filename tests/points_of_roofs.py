"""Roofs and points for the tests of fitting, drawn from seeded generators."""

import numpy as np
import shapely

from hiproof.primitives import CATALOGUE
from hiproof.primitives.contract import HALF_LENGTH, HALF_WIDTH


def typical_theta(
    name, width=8.0, length=13.0, height=3.0, kappa=0.4, translation=(0.6, -0.3, 5.0), teeth=None
):
    """theta (9,) of a typical roof of type `name`."""
    primitive = CATALOGUE[name]
    theta_p = primitive.typical(width, length, height)
    if teeth is not None:
        theta_p["teeth"] = teeth
    return primitive.to_theta(theta_p, kappa, np.array(translation))


def sample_roof(name, theta, density=5.0, noise_m=0.05, outlier_share=0.0, seed=0, teeth=2):
    """Points (n, 3) uniform over the plan of `theta`, with normal noise of the heights and outliers
    around.
    """
    rng = np.random.default_rng(seed)
    half = np.array([theta[HALF_LENGTH], theta[HALF_WIDTH]])
    uv = rng.uniform(-half, half, (round(density * 4 * half.prod()), 2))
    c, s = np.cos(theta[2]), np.sin(theta[2])
    primitive = CATALOGUE[name].variant({"teeth": teeth}) if name == "shed" else CATALOGUE[name]
    plan = shapely.MultiPolygon([shapely.Polygon(ring) for ring in primitive.plan_rings(theta)])
    uv = uv[shapely.intersects_xy(plan.buffer(1e-9), *uv.T)]
    xy = uv @ np.array([[c, s], [-s, c]]) + theta[:2]
    z = primitive.height_at(theta, xy) + rng.normal(0, noise_m, len(xy))
    points = np.column_stack([xy, z])
    outlier = rng.random(len(points)) < outlier_share
    points[outlier] = rng.uniform(
        points.min(axis=0) - 1, points.max(axis=0) + 1, (outlier.sum(), 3)
    )
    return points


def scatter(outline, rng, density=8.0):
    """Places (n, 2) at random in `outline`, `density` a square metre."""
    x0, y0, x1, y1 = outline.bounds
    xy = rng.uniform((x0, y0), (x1, y1), (int(density * (x1 - x0) * (y1 - y0)), 2))
    return xy[shapely.contains_xy(outline, *xy.T)]


def scan_roof(rng, roof, density=8.0, noise=0.03):
    """Points (n, 3) over a roof, with the noise of a scanner."""
    x0, y0, x1, y1 = roof.outline.bounds
    xy = rng.uniform((x0, y0), (x1, y1), (rng.poisson(density * (x1 - x0) * (y1 - y0)), 2))
    z = roof.height_at(xy)
    return np.column_stack([xy, z + rng.normal(0, noise, len(xy))])[np.isfinite(z)]


def sample_heights(height, outline, density=8.0, noise=0.03, seed=0):
    """Points (n, 3) at random over `outline` on the surface `height(x, y)`."""
    rng = np.random.default_rng(seed)
    xy = scatter(outline, rng, density)
    return np.column_stack([xy, height(xy[:, 0], xy[:, 1]) + rng.normal(0.0, noise, len(xy))])
