"""Gambrel (two-sided mansard): a gable with steeper lower slopes."""

from collections.abc import Mapping

import numpy as np

from .algebra import U, V, q0, q1, q2, q3
from .contract import SLOPE_MAX, SLOPE_MIN, DerivedStart, Primitive
from .drawing import drawn_plan, drawn_slope
from .gable import SLOPES

# q2 is how much steeper the lower part is, q3 the share of the half width above the break
LOWER_SLOPE = q1 + q2
BREAK_HEIGHT = LOWER_SLOPE * V * (1 - q3)
TOTAL_HEIGHT = BREAK_HEIGHT + q1 * q3 * V
LOWER_AT_RIDGE = q0 + q2 * q3 * V


def shape(p: Mapping[str, float]) -> tuple[float, ...]:
    half_break = p["break_width"] / 2
    upper = (p["height"] - p["break_height"]) / half_break
    lower = p["break_height"] / (p["width"] / 2 - half_break)
    return (
        p["width"] / 2,
        p["length"] / 2,
        p["height"],
        upper,
        lower - upper,
        p["break_width"] / p["width"],
    )


def corners(p: Mapping[str, float]) -> list[tuple[float, float, float]]:
    """Return pairs at +u and -u over eave, break, ridge, break and eave.

    They run from the eave at -v to the eave at +v.
    """
    u, v, b = p["length"] / 2, p["width"] / 2, p["break_width"] / 2
    h, z = p["height"], p["break_height"]
    lower_and_break = [(u, -v, 0), (-u, -v, 0), (-u, -b, z), (u, -b, z)]
    return [*lower_and_break, (u, 0, h), (-u, 0, h), (u, b, z), (-u, b, z), (u, v, 0), (-u, v, 0)]


def typical(width: float, length: float, height: float) -> dict[str, float]:
    """Return a break at 60 % of the width and of the height."""
    return {
        "width": width,
        "length": length,
        "height": height,
        "break_width": 0.6 * width,
        "break_height": 0.6 * height,
    }


def draw(rng: np.random.Generator, width: float) -> dict[str, float]:
    run = width / 2 * float(rng.uniform(0.22, 0.45))
    lower, upper = run * drawn_slope(rng, 54, 69), (width / 2 - run) * drawn_slope(rng, 15, 34)
    breaks = {"break_width": width - 2 * run, "break_height": lower}
    return drawn_plan(rng, width, 0.9, 2.0) | {"height": lower + upper} | breaks


PRIMITIVE = Primitive(
    name="gambrel",
    citygml_code="1060",
    adv_code="3400",
    osm_shape="gambrel",
    legend="mansard",
    measures={
        "width": 2 * V,
        "length": 2 * U,
        "height": TOTAL_HEIGHT,
        "break_width": 2 * q3 * V,
        "break_height": BREAK_HEIGHT,
    },
    eave=q0 - TOTAL_HEIGHT,
    planes=(*SLOPES, (0, LOWER_SLOPE, LOWER_AT_RIDGE), (0, -LOWER_SLOPE, LOWER_AT_RIDGE)),
    shape=shape,
    corners=corners,
    faces=((3, 4, 5, 2), (4, 6, 7, 5), (1, 0, 3, 2), (8, 9, 7, 6)),
    typical=typical,
    bounds=((SLOPE_MIN, SLOPE_MAX), (0.05, 2.2), (0.1, 0.9)),
    starts=(
        DerivedStart("gable", (q0 - 0.15 * q1 * V, 0.6 * q1, q1, 0.5)),
        DerivedStart("gable", (q0, 0.9 * q1, 2.0, 0.8)),
    ),
    draw=draw,
)
