"""Gable (saddleback): two equal planes from a level ridge.

It is the paper's Figure 3.

Where the ridge lies off the middle, towards the back, `ridge_offset` says how far, and the back's
eave is the higher one: a catslide is a gable too.
"""

from collections.abc import Mapping

import numpy as np

from .algebra import U, V, q0, q1, q2
from .contract import (
    BACK,
    FRONT,
    KAPPA,
    Q2,
    SLOPE_MAX,
    SLOPE_MIN,
    DerivedStart,
    Primitive,
    Shape,
    Vote,
)
from .drawing import drawn_plan, drawn_slope

# the planes on the -v and the +v side, shared by the shapes with a ridge
SLOPES = ((0, q1, q0), (0, -q1, q0))
FACES = ((3, 2, 1, 0), (2, 3, 4, 5))  # S1 {v4 v3 v2 v1}, S2 {v3 v4 v5 v6}


def corners(p: Mapping[str, float]) -> list[tuple[float, float, float]]:
    """Return v1..v6 of the paper's Figure 3: eave, ridge, eave."""
    u, v, h, offset = p["length"] / 2, p["width"] / 2, p["height"], p.get("ridge_offset", 0)
    step = 2 * offset * h / (v + offset)
    return [(u, -v, 0), (-u, -v, 0), (-u, offset, h), (u, offset, h), (u, v, step), (-u, v, step)]


def shape(p: Mapping[str, float]) -> Shape:
    """Return V, U and q of slopes that rise to `height` over half the width."""
    return p["width"] / 2, p["length"] / 2, p["height"], 2 * p["height"] / p["width"], 0.0, 0.0


def typical(width: float, length: float, height: float) -> dict[str, float]:
    return {"width": width, "length": length, "height": height}


def draw(rng: np.random.Generator, width: float) -> dict[str, float]:
    return drawn_plan(rng, width, 0.9) | {"height": width / 2 * drawn_slope(rng, 15, 56)}


def shape_off_the_middle(p: Mapping[str, float]) -> tuple[float, ...]:
    v, offset = p["width"] / 2, p["ridge_offset"]
    return v, p["length"] / 2, p["height"], p["height"] / (v + offset), offset / v, 0.0


def ridge_at_the_back(theta: np.ndarray) -> np.ndarray:
    """Turn the gable so that its lower eave lies at -v."""
    if theta[Q2] >= 0:
        return theta
    turned = theta.copy()
    turned[KAPPA] += np.pi
    turned[Q2] = -theta[Q2]
    return turned


OFF_THE_MIDDLE = Primitive(
    name="gable",
    citygml_code="1030",
    adv_code="3100",
    measures={
        "width": 2 * V,
        "length": 2 * U,
        "height": q1 * V + q1 * q2 * V,
        "ridge_offset": q2 * V,
    },
    eave=q0 - q1 * V - q1 * q2 * V,
    planes=((0, q1, q0 - q1 * q2 * V), (0, -q1, q0 + q1 * q2 * V)),
    shape=shape_off_the_middle,
    corners=corners,
    faces=FACES,
    typical=lambda width, length, height: (
        typical(width, length, height) | {"ridge_offset": 0.15 * width}
    ),
    bounds=((SLOPE_MIN, SLOPE_MAX), (-0.85, 0.85)),
    starts=(DerivedStart("gable", (q0, q1, 0.0)),),
    canonical=ridge_at_the_back,
    signed=("ridge_offset",),
    half_turn_symmetric=False,
    read_member=lambda m: (
        m.apex(1),
        m.slopes[BACK],
        (m.apex(1) - m.eaves[FRONT]) / (m.slopes[FRONT] * m.half[1]) - 1.0,
    ),
)
PRIMITIVE = Primitive(
    name="gable",
    citygml_code="1030",
    adv_code="3100",
    osm_shape="gabled",
    legend="gable",
    measures={"width": 2 * V, "length": 2 * U, "height": q1 * V},
    eave=q0 - q1 * V,
    planes=SLOPES,
    shape=shape,
    corners=corners,
    faces=FACES,
    typical=typical,
    draw=draw,
    bounds=((SLOPE_MIN, SLOPE_MAX),),
    vote=Vote(shifts=(-0.3, 0.0, 0.3)),
    read_member=lambda m: (m.apex(1), m.slopes[BACK]),
    more=(OFF_THE_MIDDLE,),
)
