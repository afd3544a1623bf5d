"""Monopitch: one plane rising across the roof, towards +v."""

from .algebra import U, V, q0, q1
from .contract import SLOPE_MAX, Primitive, Vote, rectangle

PRIMITIVE = Primitive(
    name="monopitch",
    citygml_code="1010",
    adv_code="2100",
    measures={"width": 2 * V, "length": 2 * U, "height": 2 * q1 * V},
    eave=q0 - q1 * V,
    planes=((0, q1, q0),),
    shape=lambda p: (p["width"] / 2, p["length"] / 2, p["height"] / 2, p["height"] / p["width"], 0.0, 0.0),
    corners=lambda p: rectangle(p, high=p["height"]),
    faces=((1, 0, 3, 2),),
    typical=lambda width, length, height: {"width": width, "length": length, "height": height},
    bounds=((1e-4, SLOPE_MAX),),
    vote=Vote(turns=4),
    half_turn_symmetric=False,
)
