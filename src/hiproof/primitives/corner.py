"""Corner: two adjacent slopes that meet in a hip, as on a wing's corner."""

from collections.abc import Mapping

import numpy as np

from .algebra import U, V, q0, q1, q2
from .contract import FRONT, RIGHT, SLOPE_MAX, SLOPE_MIN, Primitive, Vote
from .drawing import drawn_plan, drawn_slope


def shape(p: Mapping[str, float]) -> tuple[float, ...]:
    return (
        p["width"] / 2,
        p["length"] / 2,
        0.0,
        p["height"] / p["width"],
        p["end_height"] / p["length"],
        0.0,
    )


def corners(p: Mapping[str, float]) -> list[tuple[float, float, float]]:
    """Return v1 to v6: the eaves, the hip's upper end and the far corners.

    The eaves are v1 (at +u and -v), v2 and v3; the hip ends in v4; the far corner is v5 as the
    front has it, v6 as the end has it.

    The hip runs out at the back or, of a steeper front, at the left: then the far corner belongs to
    the end, and to the front else; where it is not a slope's own, v4 stands for it.
    """
    u, v = p["length"] / 2, p["width"] / 2
    # of the length that the hip takes until it is at the back
    share = p["height"] / p["end_height"]
    top = min(p["height"], p["end_height"])
    hip = (u - 2 * u * min(share, 1.0), -v + 2 * v / max(share, 1.0), top)
    distant = (-u, v, top)
    return [
        (u, -v, 0),
        (-u, -v, 0),
        (u, v, 0),
        hip,
        distant if share < 1.0 else hip,
        hip if share < 1.0 else distant,
    ]


def typical(width: float, length: float, height: float) -> dict[str, float]:
    """Return parameters of equal slopes."""
    return {
        "width": width,
        "length": length,
        "height": height,
        "end_height": height * length / width,
    }


def draw(rng: np.random.Generator, width: float) -> dict[str, float]:
    plan = drawn_plan(rng, width, 0.9, 1.6)
    slope = drawn_slope(rng, 15, 40)
    end = slope * float(rng.uniform(0.8, 1.25))
    return plan | {"height": slope * plan["width"], "end_height": end * plan["length"]}


PRIMITIVE = Primitive(
    name="corner",
    citygml_code="1040",
    adv_code="3200",
    osm_shape="hipped",
    legend="hip",
    measures={"width": 2 * V, "length": 2 * U, "height": 2 * q1 * V, "end_height": 2 * q2 * U},
    eave=q0,
    planes=((0, q1, q0 + q1 * V), (-q2, 0, q0 + q2 * U)),
    shape=shape,
    corners=corners,
    faces=((1, 0, 3, 4), (0, 2, 5, 3)),
    typical=typical,
    draw=draw,
    bounds=((SLOPE_MIN, SLOPE_MAX), (SLOPE_MIN, SLOPE_MAX)),
    vote=Vote(turns=4, slopes=(0.15, 0.3, 0.5, 0.75)),
    read_member=lambda m: (m.eaves[FRONT], m.slopes[FRONT], m.slopes[RIGHT]),
    half_turn_symmetric=False,
)
