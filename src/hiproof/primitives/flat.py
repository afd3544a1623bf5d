"""Flat roof: one level plane."""

import numpy as np

from .algebra import U, V, q0
from .contract import HALF_LENGTH, HALF_WIDTH, Primitive, Vote, rectangle, turn_quarter
from .drawing import drawn_plan


def canonical(theta: np.ndarray) -> np.ndarray:
    """Turn the roof so that its longer side is the length."""
    return turn_quarter(theta) if theta[HALF_WIDTH] > theta[HALF_LENGTH] else theta


def draw(rng: np.random.Generator, width: float) -> dict[str, float]:
    return drawn_plan(rng, width, 1.0, 2.6)


PRIMITIVE = Primitive(
    name="flat",
    citygml_code="1000",
    adv_code="1000",
    osm_shape="flat",
    legend="flat",
    measures={"width": 2 * V, "length": 2 * U},
    eave=q0,
    planes=((0, 0, q0),),
    shape=lambda p: (p["width"] / 2, p["length"] / 2, 0.0, 0.0, 0.0, 0.0),
    corners=rectangle,
    faces=((1, 0, 3, 2),),
    typical=lambda width, length, height: {"width": width, "length": length},
    vote=Vote(turns=1, slopes=(0.0,)),
    canonical=canonical,
    draw=draw,
    read_member=lambda m: (m.top,),
)
