"""Asymmetric gable (saltbox): two planes of different slope.

The ridge need not lie in the middle.
"""

from collections.abc import Mapping

import numpy as np

from .algebra import U, V, q0, q1, q2, q3
from .contract import (
    BACK,
    FRONT,
    HALF_WIDTH,
    KAPPA,
    Q1,
    Q2,
    Q3,
    SLOPE_MAX,
    DerivedStart,
    Primitive,
    Sides,
)
from .drawing import drawn_plan, drawn_slope
from .gable import FACES

RIDGE_RISE = q1 * V + q1 * q3 * V  # from the eave at -v, the lower one, to the ridge
SAME_M = 1e-9  # m; numerically level with each other
RISE_HIGH_SIDE = q2 * V - q2 * q3 * V


def shape(p: Mapping[str, float]) -> tuple[float, ...]:
    v, offset, h = p["width"] / 2, p["ridge_offset"], p["height"]
    return v, p["length"] / 2, h, h / (v + offset), (h - p["eave_step"]) / (v - offset), offset / v


def corners(p: Mapping[str, float]) -> list[tuple[float, float, float]]:
    """Return the gable's v1..v6 with the ridge moved and the back eave raised.

    The ridge is v3 v4, moved by the offset. The eave is v5 v6, raised by the step.
    """
    u, v, h, offset, step = (
        p["length"] / 2,
        p["width"] / 2,
        p["height"],
        p["ridge_offset"],
        p["eave_step"],
    )
    return [(u, -v, 0), (-u, -v, 0), (-u, offset, h), (u, offset, h), (u, v, step), (-u, v, step)]


def canonical(theta: np.ndarray) -> np.ndarray:
    """Turn the gable so that its lower eave lies at -v.

    Of equal eaves, that of the steeper slope lies there.
    """
    # the eave at +v
    higher = theta[HALF_WIDTH] * (theta[Q1] * (1 + theta[Q3]) - theta[Q2] * (1 - theta[Q3]))
    if higher > SAME_M or (higher > -SAME_M and theta[Q3] <= 0):
        return theta
    turned = theta.copy()
    turned[KAPPA] += np.pi
    turned[[Q1, Q2]] = theta[[Q2, Q1]]
    turned[Q3] = -theta[Q3]
    return turned


def typical(width: float, length: float, height: float) -> dict[str, float]:
    """Return a ridge a tenth of the width off the middle, and a raised eave.

    The higher eave lies at 30 % of the height.
    """
    return {
        "width": width,
        "length": length,
        "height": height,
        "ridge_offset": 0.1 * width,
        "eave_step": 0.3 * height,
    }


def draw(rng: np.random.Generator, width: float) -> dict[str, float]:
    height = width / 2 * drawn_slope(rng, 22, 46)
    offset, step = width * float(rng.uniform(0.1, 0.28)), 0.0
    if rng.random() < 0.4:
        # One slope on both sides and eaves at different heights: a catslide roof.
        step = height * (1 - (width / 2 - offset) / (width / 2 + offset))
    return drawn_plan(rng, width, 0.9) | {
        "height": height,
        "ridge_offset": offset,
        "eave_step": step,
    }


def read_member(member: Sides) -> tuple[float, ...]:
    (front, back), ridge = member.slopes[[FRONT, BACK]], member.apex(1)
    return ridge, front, back, (ridge - member.eaves[FRONT]) / (front * member.half[1]) - 1.0


PRIMITIVE = Primitive(
    name="asymmetric_gable",
    citygml_code="1030",
    adv_code="3100",
    osm_shape="gabled_height_moved",
    legend="gable",
    measures={
        "width": 2 * V,
        "length": 2 * U,
        "height": RIDGE_RISE,
        "ridge_offset": q3 * V,
        "eave_step": RIDGE_RISE - RISE_HIGH_SIDE,
    },
    eave=q0 - RIDGE_RISE,
    planes=((0, q1, q0 - q1 * q3 * V), (0, -q2, q0 + q2 * q3 * V)),
    shape=shape,
    corners=corners,
    faces=FACES,
    typical=typical,
    bounds=((0.02, SLOPE_MAX), (0.02, SLOPE_MAX), (-0.85, 0.85)),
    starts=(
        DerivedStart("gable", (q0, q1, q1, 0.0)),
        DerivedStart("monopitch", (q0 + 0.6 * q1 * V, q1, 0.2, 0.6)),
    ),
    canonical=canonical,
    signed=("ridge_offset", "eave_step"),
    half_turn_symmetric=False,
    draw=draw,
    read_member=read_member,
)
