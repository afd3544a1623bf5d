"""Mansard with a level top: four slopes from the eave up to a flat rectangle."""

from collections.abc import Mapping

import numpy as np

from .algebra import U, V, q0, q1, q2, q3
from .contract import (
    FRONT,
    HALF_LENGTH,
    HALF_WIDTH,
    Q1,
    Q2,
    Q3,
    RIGHT,
    SLOPE_MAX,
    DerivedStart,
    Primitive,
    Sides,
    rectangle,
    turn_quarter,
)
from .drawing import drawn_plan, drawn_slope

TOP_RISE = q3 * q1 * V  # q3 is the share of the half width that the slope takes
LOWEST_EAVE = q0 - TOP_RISE


def shape(p: Mapping[str, float]) -> tuple[float, ...]:
    run_across, run_along = (p["width"] - p["top_width"]) / 2, (p["length"] - p["top_length"]) / 2
    slopes = p["height"] / run_across, p["height"] / run_along
    return p["width"] / 2, p["length"] / 2, p["height"], *slopes, 2 * run_across / p["width"]


def corners(p: Mapping[str, float]) -> list[tuple[float, float, float]]:
    """Return the plan's v1..v4, then the top's v5..v8 above them."""
    return [
        *rectangle(p),
        *rectangle({"width": p["top_width"], "length": p["top_length"]}, p["height"], p["height"]),
    ]


def canonical(theta: np.ndarray) -> np.ndarray:
    """Turn the roof so that its longer side is the length."""
    if theta[HALF_WIDTH] <= theta[HALF_LENGTH]:
        return theta
    turned = turn_quarter(theta)
    turned[[Q1, Q2]] = theta[[Q2, Q1]]
    turned[Q3] = theta[Q3] * theta[Q1] * theta[HALF_WIDTH] / (theta[Q2] * theta[HALF_LENGTH])
    return turned


def typical(width: float, length: float, height: float) -> dict[str, float]:
    """Return slopes over a quarter of the width on each side.

    They take as much of the length.
    """
    return {
        "width": width,
        "length": length,
        "height": height,
        "top_width": 0.5 * width,
        "top_length": max(length - 0.5 * width, 0.3 * length),
    }


def draw(rng: np.random.Generator, width: float) -> dict[str, float]:
    inset = width * float(rng.uniform(0.12, 0.26))
    plan = drawn_plan(rng, width, 1.0, 1.9)
    top = {"top_width": plan["width"] - 2 * inset, "top_length": plan["length"] - 2 * inset}
    return plan | {"height": inset * drawn_slope(rng, 45, 68)} | top


def read_member(member: Sides) -> tuple[float, ...]:
    slope = member.slopes[FRONT]
    return (
        member.top,
        slope,
        member.slopes[RIGHT],
        (member.top - member.eaves[FRONT]) / (slope * member.half[1]),
    )


PRIMITIVE = Primitive(
    name="mansard",
    citygml_code="1060",
    adv_code="3400",
    osm_shape="quadruple_saltbox",
    legend="mansard",
    measures={
        "width": 2 * V,
        "length": 2 * U,
        "height": TOP_RISE,
        "top_width": 2 * V - 2 * q3 * V,
        "top_length": 2 * U - 2 * TOP_RISE / q2,
    },
    eave=LOWEST_EAVE,
    planes=(
        (0, q1, LOWEST_EAVE + q1 * V),
        (0, -q1, LOWEST_EAVE + q1 * V),
        (-q2, 0, LOWEST_EAVE + q2 * U),
        (q2, 0, LOWEST_EAVE + q2 * U),
        (0, 0, q0),
    ),
    shape=shape,
    corners=corners,
    faces=((1, 0, 4, 5), (3, 2, 6, 7), (0, 3, 7, 4), (2, 1, 5, 6), (5, 4, 7, 6)),
    typical=typical,
    bounds=((0.08, SLOPE_MAX), (0.08, SLOPE_MAX), (0.05, 0.95)),
    starts=(
        DerivedStart("hip", (q0 - 0.4 * q1 * V, q1, q2, 0.6)),
        DerivedStart("flat", (q0, 1.0, 1.0, 0.25)),
    ),
    canonical=canonical,
    draw=draw,
    read_member=read_member,
)
