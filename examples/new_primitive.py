"""A roof shape of your own: a curb lean-to.

It is a single slope that breaks once into a shallower upper part.

A primitive is data: its planes as formulas of half width V, half length U and q0..q3, the paper's
vertices and faces, and where its fit starts. In the package this would be one row of
`data/shapes.toml`.
"""

import numpy as np
import shapely

import hiproof
from hiproof.primitives import CATALOGUE, Primitive
from hiproof.primitives.algebra import U, V, q0, q1, q2
from hiproof.primitives.contract import SLOPE_MAX, SLOPE_MIN, DerivedStart

# q0 is the height of the break in the middle of the plan, q1 the slope above it, q2 how much
# steeper it is below


def shape(p):
    upper = (p["height"] - p["break_height"]) / (p["width"] / 2)
    lower = p["break_height"] / (p["width"] / 2)
    return p["width"] / 2, p["length"] / 2, p["break_height"], upper, lower - upper, 0.0


def corners(p):
    u, v, h, z = p["length"] / 2, p["width"] / 2, p["height"], p["break_height"]
    return [(u, -v, 0), (-u, -v, 0), (-u, 0, z), (u, 0, z), (u, v, h), (-u, v, h)]


CURB_LEAN_TO = Primitive(
    name="curb_lean_to",
    citygml_code="1010",
    adv_code="2100",
    measures={
        "width": 2 * V,
        "length": 2 * U,
        "height": (2 * q1 + q2) * V,
        "break_height": (q1 + q2) * V,
    },
    eave=q0 - (q1 + q2) * V,
    planes=((0, q1 + q2, q0), (0, q1, q0)),
    shape=shape,
    corners=corners,
    faces=((3, 2, 1, 0), (2, 3, 4, 5)),
    typical=lambda width, length, height: {
        "width": width,
        "length": length,
        "height": height,
        "break_height": 0.7 * height,
    },
    bounds=((SLOPE_MIN, SLOPE_MAX), (0.05, 2.2)),
    starts=(
        DerivedStart("monopitch", (q0, 0.6 * q1, 0.8 * q1)),
        DerivedStart("monopitch", (q0, -0.6 * q1, -0.8 * q1)),
    ),
    half_turn_symmetric=False,
)

CATALOGUE["curb_lean_to"] = CURB_LEAN_TO

truth = {"width": 8.0, "length": 14.0, "height": 5.0, "break_height": 3.6}
roof = CURB_LEAN_TO.part(
    CURB_LEAN_TO.to_theta(truth, kappa=0.4, translation=(0.0, 0.0, 6.0))
).pieces[0]
rng = np.random.default_rng(0)
xy = rng.uniform(-8, 8, (1500, 2))
xy = xy[shapely.contains_xy(roof.outline, xy[:, 0], xy[:, 1])]
fit = hiproof.fit_roof(np.column_stack([xy, roof.height_at(xy) + rng.normal(0, 0.03, len(xy))]))
print(fit.type, {name: round(value, 2) for name, value in fit.parameters.items()})
assert fit.type == "curb_lean_to"
