"""Half-hip (jerkinhead): a gable with ends cut by small hips.

The hips start part-way down the slopes.
"""

from collections.abc import Mapping

import numpy as np

from .algebra import U, V, q0, q1, q2, q3
from .contract import FRONT, RIGHT, SLOPE_MAX, SLOPE_MIN, DerivedStart, Primitive, Sides
from .drawing import drawn_slope
from .gable import SLOPES

DROP = q3 * q1 * V  # height of the hip's own triangle, from its eave up to the ridge
HIP_EAVE = q0 - DROP


def shape(p: Mapping[str, float]) -> tuple[float, ...]:
    slope_end = 2 * p["hip_height"] / (p["length"] - p["ridge_length"])
    slope_side = 2 * p["height"] / p["width"]
    return (
        p["width"] / 2,
        p["length"] / 2,
        p["height"],
        slope_side,
        slope_end,
        p["hip_height"] / p["height"],
    )


def corners(p: Mapping[str, float]) -> list[tuple[float, float, float]]:
    """Return the hip's v1..v6, then the ends of the hips' eaves.

    They are v7 and v9 at +u, v8 and v10 at -u.
    """
    u, v, h, r = p["length"] / 2, p["width"] / 2, p["height"], p["ridge_length"] / 2
    b, z = v * p["hip_height"] / h, h - p["hip_height"]
    slopes = [(u, -v, 0), (-u, -v, 0), (-r, 0, h), (r, 0, h), (u, v, 0), (-u, v, 0)]
    return [*slopes, (u, -b, z), (-u, -b, z), (u, b, z), (-u, b, z)]


def typical(width: float, length: float, height: float) -> dict[str, float]:
    """Return hips of 40 % of the height.

    They are as steep as the slopes where the length allows.
    """
    ridge = max(length - 0.4 * width, 0.2 * length)
    return {
        "width": width,
        "length": length,
        "height": height,
        "ridge_length": ridge,
        "hip_height": 0.4 * height,
    }


def draw(rng: np.random.Generator, width: float) -> dict[str, float]:
    height = width / 2 * drawn_slope(rng, 30, 54)
    hip_height = height * float(rng.uniform(0.35, 0.7))
    ridge = width * float(rng.uniform(0.35, 1.4))
    plan = {"width": width, "length": ridge + 2 * hip_height / drawn_slope(rng, 35, 60)}
    return plan | {"height": height, "ridge_length": ridge, "hip_height": hip_height}


def read_member(member: Sides) -> tuple[float, ...]:
    slope, ridge = member.slopes[FRONT], member.apex(1)
    return (
        ridge,
        slope,
        member.slopes[RIGHT],
        (ridge - member.eaves[RIGHT]) / (slope * member.half[1]),
    )


PRIMITIVE = Primitive(
    name="half_hip",
    citygml_code="1050",
    adv_code="3300",
    osm_shape="half-hipped",
    legend="half hip",
    measures={
        "width": 2 * V,
        "length": 2 * U,
        "height": q1 * V,
        "ridge_length": 2 * U - 2 * DROP / q2,
        "hip_height": DROP,
    },
    eave=q0 - q1 * V,
    planes=(*SLOPES, (-q2, 0, HIP_EAVE + q2 * U), (q2, 0, HIP_EAVE + q2 * U)),
    shape=shape,
    corners=corners,
    faces=((1, 0, 6, 3, 2, 7), (4, 5, 9, 2, 3, 8), (6, 8, 3), (9, 7, 2)),
    typical=typical,
    bounds=((SLOPE_MIN, SLOPE_MAX), (SLOPE_MIN, SLOPE_MAX), (0.15, 0.75)),
    starts=(DerivedStart("gable", (q0, q1, 1.0, 0.5)), DerivedStart("hip", (q0, q1, q2, 0.7))),
    draw=draw,
    read_member=read_member,
)
