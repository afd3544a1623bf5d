"""Pyramid (pavilion, tent): four planes to one apex over a rectangle."""

from collections.abc import Mapping

import numpy as np

from .algebra import U, V, q0, q1
from .contract import (
    FRONT,
    HALF_LENGTH,
    HALF_WIDTH,
    Q1,
    SLOPE_MAX,
    SLOPE_MIN,
    Primitive,
    Vote,
    rectangle,
    turn_quarter,
)
from .drawing import drawn_plan, drawn_slope
from .gable import SLOPES, shape, typical

END_SLOPE = q1 * V / U


def corners(p: Mapping[str, float]) -> list[tuple[float, float, float]]:
    """Return the plan's v1..v4, then the apex v5."""
    return [*rectangle(p), (0, 0, p["height"])]


def canonical(theta: np.ndarray) -> np.ndarray:
    """Turn the pyramid so that its longer side is the length."""
    if theta[HALF_WIDTH] <= theta[HALF_LENGTH]:
        return theta
    turned = turn_quarter(theta)
    turned[Q1] = theta[Q1] * theta[HALF_WIDTH] / theta[HALF_LENGTH]
    return turned


def draw(rng: np.random.Generator, width: float) -> dict[str, float]:
    return drawn_plan(rng, width, 1.0, 1.15) | {"height": width / 2 * drawn_slope(rng, 15, 52)}


PRIMITIVE = Primitive(
    name="pyramid",
    citygml_code="1070",
    adv_code="3500",
    osm_shape="pyramidal",
    legend="pyramid",
    measures={"width": 2 * V, "length": 2 * U, "height": q1 * V},
    eave=q0 - q1 * V,
    planes=(*SLOPES, (-END_SLOPE, 0, q0), (END_SLOPE, 0, q0)),
    shape=shape,
    corners=corners,
    faces=((1, 0, 4), (3, 2, 4), (0, 3, 4), (2, 1, 4)),
    typical=typical,
    bounds=((SLOPE_MIN, SLOPE_MAX),),
    vote=Vote(),
    canonical=canonical,
    draw=draw,
    read_member=lambda m: (m.apex(1), m.slopes[FRONT]),
)
