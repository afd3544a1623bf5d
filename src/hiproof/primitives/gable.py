"""Gable (saddleback): two planes falling from a level ridge, the paper's Figure 3."""

from collections.abc import Mapping

from .algebra import U, V, q0, q1
from .contract import SLOPE_MAX, SLOPE_MIN, Primitive, Vote

SLOPES = ((0, q1, q0), (0, -q1, q0))  # the planes on the -v and the +v side, shared by the shapes with a ridge
FACES = ((3, 2, 1, 0), (2, 3, 4, 5))  # S1 {v4 v3 v2 v1}, S2 {v3 v4 v5 v6}


def corners(p: Mapping[str, float]) -> list[tuple[float, float, float]]:
    """v1..v6 of the paper's Figure 3: eave, ridge, eave."""
    u, v, h = p["length"] / 2, p["width"] / 2, p["height"]
    return [(u, -v, 0), (-u, -v, 0), (-u, 0, h), (u, 0, h), (u, v, 0), (-u, v, 0)]


PRIMITIVE = Primitive(
    name="gable",
    citygml_code="1030",
    adv_code="3100",
    measures={"width": 2 * V, "length": 2 * U, "height": q1 * V},
    eave=q0 - q1 * V,
    planes=SLOPES,
    shape=lambda p: (p["width"] / 2, p["length"] / 2, p["height"], 2 * p["height"] / p["width"], 0.0, 0.0),
    corners=corners,
    faces=FACES,
    typical=lambda width, length, height: {"width": width, "length": length, "height": height},
    bounds=((SLOPE_MIN, SLOPE_MAX),),
    vote=Vote(shifts=(-0.3, 0.0, 0.3)),
)
