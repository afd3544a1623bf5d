"""Pyramid (pavilion, tent): four planes to one apex over a rectangle."""

from collections.abc import Mapping

import numpy as np

from .algebra import U, V, q0, q1
from .contract import HALF_LENGTH, HALF_WIDTH, Q1, SLOPE_MAX, SLOPE_MIN, Primitive, Vote, quarter_turned, rectangle
from .gable import SLOPES

END_SLOPE = q1 * V / U


def corners(p: Mapping[str, float]) -> list[tuple[float, float, float]]:
    """The plan's v1..v4, then the apex v5."""
    return [*rectangle(p), (0, 0, p["height"])]


def canonical(theta: np.ndarray) -> np.ndarray:
    """The longer side is the length."""
    if theta[HALF_WIDTH] <= theta[HALF_LENGTH]:
        return theta
    turned = quarter_turned(theta)
    turned[Q1] = theta[Q1] * theta[HALF_WIDTH] / theta[HALF_LENGTH]
    return turned


PRIMITIVE = Primitive(
    name="pyramid",
    citygml_code="1070",
    adv_code="3500",
    measures={"width": 2 * V, "length": 2 * U, "height": q1 * V},
    eave=q0 - q1 * V,
    planes=(*SLOPES, (-END_SLOPE, 0, q0), (END_SLOPE, 0, q0)),
    shape=lambda p: (p["width"] / 2, p["length"] / 2, p["height"], 2 * p["height"] / p["width"], 0.0, 0.0),
    corners=corners,
    faces=((1, 0, 4), (3, 2, 4), (0, 3, 4), (2, 1, 4)),
    typical=lambda width, length, height: {"width": width, "length": length, "height": height},
    bounds=((SLOPE_MIN, SLOPE_MAX),),
    vote=Vote(),
    canonical=canonical,
)
