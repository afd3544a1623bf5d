"""Random roofs and their points for the benchmarks.

Points are uniform in plan, with the noise of the paper's simulation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hiproof.primitives import CATALOGUE
from hiproof.primitives.contract import HALF_LENGTH, HALF_WIDTH, Primitive

NOISE_RMSE_M = 0.12  # the paper's, spread 90 % within 1, 9 % within 1 to 2, 1 % within 2 to 3 RMSE
DENSITY = 4.72  # points a square metre, the paper's


@dataclass(frozen=True)
class TrueRoof:
    """A roof whose parameters are known.

    It has `theta_p` by name, is turned by `kappa`, and lies at `translation` T_L (3,).
    """

    primitive: Primitive
    theta_p: dict[str, float]
    kappa: float
    translation: np.ndarray

    @property
    def theta(self) -> np.ndarray:
        """theta (9,) of the fit."""
        return self.primitive.to_theta(self.theta_p, self.kappa, self.translation)


def draw_roof(name: str, rng: np.random.Generator) -> TrueRoof:
    """Draw an ordinary house of type `name`.

    It is 6 to 12 m wide, up to 2.2 times as long, with slopes of 20 to 50 degrees.
    """
    width = rng.uniform(6, 12)
    length = width * (rng.uniform(1.05, 1.3) if name == "pyramid" else rng.uniform(1.3, 2.2))
    height = width / 2 * rng.uniform(0.36, 1.2)
    theta_p = CATALOGUE[name].typical(width, length, height) | draw_shape(
        name, width, length, height, rng
    )
    kappa, translation = rng.uniform(-np.pi / 2, np.pi / 2), np.array([*rng.uniform(-1, 1, 2), 6.0])
    return TrueRoof(CATALOGUE[name].variant(theta_p), theta_p, kappa, translation)


def draw_shape(
    name: str, width: float, length: float, height: float, rng: np.random.Generator
) -> dict[str, float]:
    """Draw the lengths that make a type what it is, where they can be seen."""
    ends = 1 if name.startswith(("side", "corner")) else 2  # sloping ends, and sides
    sides = 1 if name in ("half_mansard", "corner", "corner_mansard") else 2
    if name in ("hip", "side_hip"):
        return {"ridge_length": length - ends * width / 2 * rng.uniform(0.6, 1.0)}
    if name in ("half_hip", "side_half_hip"):
        # so that one end is seen as well
        share = rng.uniform(0.3, 0.6) if ends == 2 else rng.uniform(0.45, 0.7)
        ridge = length - ends * share * width / 2 * rng.uniform(0.6, 1.0)
        return {"hip_height": share * height, "ridge_length": ridge}
    if "top_width" in CATALOGUE[name].parameters:
        run = width * rng.uniform(0.15, 0.3)
        lengths = {
            "top_width": width - sides * run,
            "top_length": length - ends * run * rng.uniform(0.8, 1.2),
        }
        lengths["height"] = run * rng.uniform(0.7, 2.0)
        return {
            parameter: lengths[parameter]
            for parameter in lengths
            if parameter in CATALOGUE[name].parameters
        }
    if name == "corner":
        slope = rng.uniform(0.3, 0.9)
        return {"height": slope * width, "end_height": slope * length * rng.uniform(0.8, 1.25)}
    if name == "asymmetric_gable":
        return draw_asymmetry(width, height, rng)
    if name == "gambrel":
        return {
            "break_width": width * rng.uniform(0.5, 0.7),
            "break_height": height * rng.uniform(0.62, 0.75),
        }
    if name == "monopitch":
        return {"height": height * rng.uniform(0.5, 1.0)}
    if name == "shed":
        teeth = int(rng.integers(2, min(6, int(width / 2)) + 1))  # none narrower than 2 m
        return {"teeth": teeth, "height": width / teeth * rng.uniform(0.3, 0.9)}
    return {}


def draw_asymmetry(width: float, height: float, rng: np.random.Generator) -> dict[str, float]:
    """Draw a ridge off the middle and a step between the eaves.

    One slope is at least a seventh steeper.
    """
    while True:
        offset, step = width * rng.uniform(0.08, 0.25), height * rng.uniform(0.1, 0.5)
        steeper = (height - step) / (width / 2 - offset) / (height / (width / 2 + offset))
        if abs(np.log(steeper)) > np.log(8 / 7):
            return {"ridge_offset": offset, "eave_step": step}


def draw_catslide(rng: np.random.Generator) -> TrueRoof:
    """Draw a gable whose ridge lies off the middle."""
    gable = draw_roof("gable", rng)
    theta_p = gable.theta_p | {"ridge_offset": gable.theta_p["width"] * rng.uniform(0.08, 0.25)}
    return TrueRoof(gable.primitive.variant(theta_p), theta_p, gable.kappa, gable.translation)


def scan(
    roof: TrueRoof,
    density: float,
    rng: np.random.Generator,
    outlier_share: float = 0.0,
    noise_rmse_m: float = NOISE_RMSE_M,
) -> np.ndarray:
    """Draw points (n, 3), `density` a square metre, uniform over the plan.

    Outliers are uniform in a box around the roof.
    """
    theta = roof.theta
    half = np.array([theta[HALF_LENGTH], theta[HALF_WIDTH]])
    count = max(4, round(density * 4 * half.prod()))
    uv = rng.uniform(-half, half, (count, 2))
    c, s = np.cos(roof.kappa), np.sin(roof.kappa)
    xy = uv @ np.array([[c, s], [-s, c]]) + roof.translation[:2]
    z = roof.primitive.height_at(theta, xy) + draw_paper_noise(count, rng) * noise_rmse_m
    points = np.column_stack([xy, z])
    outliers = rng.random(count) < outlier_share
    lower, upper = points.min(axis=0) - (1, 1, 2), points.max(axis=0) + (1, 1, 1)
    points[outliers] = rng.uniform(lower, upper, (outliers.sum(), 3))
    return points


def draw_paper_noise(count: int, rng: np.random.Generator) -> np.ndarray:
    """Draw errors in RMSE as the paper does.

    90 % lie within 1, 9 % between 1 and 2, 1 % between 2 and 3, with either sign.
    """
    band = rng.choice(3, count, p=[0.9, 0.09, 0.01])
    return (band + rng.random(count)) * rng.choice([-1.0, 1.0], count)
