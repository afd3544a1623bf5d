"""Monopitch: one plane rising across the roof, towards +v."""

import numpy as np

from .algebra import U, V, q0, q1
from .contract import FRONT, SLOPE_MAX, Primitive, Vote, rectangle
from .drawing import drawn_plan, drawn_slope


def draw(rng: np.random.Generator, width: float) -> dict[str, float]:
    return drawn_plan(rng, width, 0.9, 2.2) | {"height": width * drawn_slope(rng, 6, 28)}


PRIMITIVE = Primitive(
    name="monopitch",
    citygml_code="1010",
    adv_code="2100",
    osm_shape="skillion",
    legend="monopitch",
    measures={"width": 2 * V, "length": 2 * U, "height": 2 * q1 * V},
    eave=q0 - q1 * V,
    planes=((0, q1, q0),),
    shape=lambda p: (
        p["width"] / 2,
        p["length"] / 2,
        p["height"] / 2,
        p["height"] / p["width"],
        0.0,
        0.0,
    ),
    corners=lambda p: rectangle(p, upper=p["height"]),
    faces=((1, 0, 3, 2),),
    typical=lambda width, length, height: {"width": width, "length": length, "height": height},
    bounds=((1e-4, SLOPE_MAX),),
    vote=Vote(turns=4),
    half_turn_symmetric=False,
    draw=draw,
    read_member=lambda m: (m.eaves[FRONT] + m.slopes[FRONT] * m.half[1], m.slopes[FRONT]),
)
