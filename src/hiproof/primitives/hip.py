"""Hip: a gable whose two ends slope too, down to the same eave."""

from collections.abc import Mapping

import numpy as np

from .algebra import U, V, q0, q1, q2
from .contract import (
    FRONT,
    HALF_LENGTH,
    HALF_WIDTH,
    Q1,
    Q2,
    RIGHT,
    SLOPE_MAX,
    SLOPE_MIN,
    Primitive,
    Vote,
    turn_quarter,
)
from .drawing import drawn_slope
from .gable import FACES, SLOPES

HIP_EAVE_HEIGHT = q0 - q1 * V


def shape(p: Mapping[str, float]) -> tuple[float, ...]:
    run = (p["length"] - p["ridge_length"]) / 2
    return (
        p["width"] / 2,
        p["length"] / 2,
        p["height"],
        2 * p["height"] / p["width"],
        p["height"] / run,
        0.0,
    )


def corners(p: Mapping[str, float]) -> list[tuple[float, float, float]]:
    """Return the gable's v1..v6 with a shorter ridge v3 v4."""
    u, v, h, r = p["length"] / 2, p["width"] / 2, p["height"], p["ridge_length"] / 2
    return [(u, -v, 0), (-u, -v, 0), (-r, 0, h), (r, 0, h), (u, v, 0), (-u, v, 0)]


def canonical(theta: np.ndarray) -> np.ndarray:
    """Turn the hip so that its ridge runs along u.

    Where the ends meet below the sides' ridge, the lowest planes form a ridge along v instead and
    theta's q0 is above the roof: the same surface with the axes exchanged.
    """
    rise_across, rise_along = theta[Q1] * theta[HALF_WIDTH], theta[Q2] * theta[HALF_LENGTH]
    if rise_across <= rise_along:
        return theta
    turned = turn_quarter(theta)
    turned[5] += rise_along - rise_across
    turned[[Q1, Q2]] = theta[[Q2, Q1]]
    return turned


def typical(width: float, length: float, height: float) -> dict[str, float]:
    """Return equal slopes all round where the length allows a ridge."""
    return {
        "width": width,
        "length": length,
        "height": height,
        "ridge_length": max(length - width, 0.2 * length),
    }


def draw(rng: np.random.Generator, width: float) -> dict[str, float]:
    run, ridge = width / 2 * float(rng.uniform(0.6, 1.15)), width * float(rng.uniform(0.25, 1.3))
    plan = {"width": width, "length": 2 * run + ridge}
    return plan | {"height": width / 2 * drawn_slope(rng, 18, 48), "ridge_length": ridge}


PRIMITIVE = Primitive(
    name="hip",
    citygml_code="1040",
    adv_code="3200",
    osm_shape="hipped",
    legend="hip",
    measures={
        "width": 2 * V,
        "length": 2 * U,
        "height": q1 * V,
        "ridge_length": 2 * U - 2 * q1 * V / q2,
    },
    eave=HIP_EAVE_HEIGHT,
    planes=(*SLOPES, (-q2, 0, HIP_EAVE_HEIGHT + q2 * U), (q2, 0, HIP_EAVE_HEIGHT + q2 * U)),
    shape=shape,
    corners=corners,
    faces=(*FACES, (0, 4, 3), (5, 1, 2)),
    typical=typical,
    bounds=((SLOPE_MIN, SLOPE_MAX), (SLOPE_MIN, SLOPE_MAX)),
    vote=Vote(),
    canonical=canonical,
    draw=draw,
    read_member=lambda m: (m.apex(1), m.slopes[FRONT], m.slopes[RIGHT]),
)
