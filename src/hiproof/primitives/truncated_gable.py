"""Truncated gable: two opposite slopes up to a level top in place of the ridge."""

from collections.abc import Mapping

import numpy as np

from .algebra import U, V, q0, q1, q2
from .contract import FRONT, SLOPE_MAX, DerivedStart, Primitive, at_quarters
from .drawing import drawn_plan, drawn_slope

RISE = q2 * q1 * V  # q2 is the share of the half width that the slope takes
EAVE = q0 - RISE


def shape(p: Mapping[str, float]) -> tuple[float, ...]:
    run = (p["width"] - p["top_width"]) / 2
    return (
        p["width"] / 2,
        p["length"] / 2,
        p["height"],
        p["height"] / run,
        2 * run / p["width"],
        0.0,
    )


def corners(p: Mapping[str, float]) -> list[tuple[float, float, float]]:
    """Return pairs at +u and -u: eave at -v, the top's two edges, eave at +v."""
    u, v, t, h = p["length"] / 2, p["width"] / 2, p["top_width"] / 2, p["height"]
    return [
        (u, -v, 0),
        (-u, -v, 0),
        (u, -t, h),
        (-u, -t, h),
        (u, t, h),
        (-u, t, h),
        (u, v, 0),
        (-u, v, 0),
    ]


def typical(width: float, length: float, height: float) -> dict[str, float]:
    """Return slopes over a quarter of the width on each side."""
    return {"width": width, "length": length, "height": height, "top_width": 0.5 * width}


def draw(rng: np.random.Generator, width: float) -> dict[str, float]:
    inset = width * float(rng.uniform(0.15, 0.3))
    plan = drawn_plan(rng, width, 0.9)
    return plan | {
        "height": inset * drawn_slope(rng, 35, 65),
        "top_width": plan["width"] - 2 * inset,
    }


PRIMITIVE = Primitive(
    name="truncated_gable",
    citygml_code="1060",
    adv_code="3400",
    osm_shape="double_saltbox",
    legend="gable",
    measures={"width": 2 * V, "length": 2 * U, "height": RISE, "top_width": 2 * V - 2 * q2 * V},
    eave=EAVE,
    planes=((0, q1, EAVE + q1 * V), (0, -q1, EAVE + q1 * V), (0, 0, q0)),
    shape=shape,
    corners=corners,
    faces=((1, 0, 2, 3), (6, 7, 5, 4), (3, 2, 4, 5)),
    typical=typical,
    draw=draw,
    bounds=((0.08, SLOPE_MAX), (0.05, 0.95)),
    starts=(
        DerivedStart("gable", (q0 - 0.4 * q1 * V, q1, 0.6)),
        *at_quarters("flat", (q0, 1.0, 0.25), (0, 1)),
    ),
    read_member=lambda m: (
        m.top,
        m.slopes[FRONT],
        (m.top - m.eaves[FRONT]) / (m.slopes[FRONT] * m.half[1]),
    ),
)
