"""Half cone: the roof of an apse, a half disc against a wall.

Its apex lies in the middle of the straight side, at -u. The length is the depth of the plan: half
of the width over a half circle. Facets follow its size, as those of a cone (facets.py).
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from .algebra import Formula, U, V, q0, q1
from .cone import CONE
from .contract import Corners, DerivedStart, Plane, Primitive, at_quarters
from .facets import SIDE_COUNTS, count_sides, find_apothem, find_sides
from .gable import shape, typical


def list_half_directions(sides: int) -> list[tuple[float, float]]:
    """Return which way each facet of half a circle faces, from -v to +v.

    The circle has so many sides, of which the wall cuts none.
    """
    angles = [2.0 * math.pi * (k + 0.5) / sides - 0.5 * math.pi for k in range(sides // 2)]
    return [(math.cos(angle), math.sin(angle)) for angle in angles]


@cache
def make_half_cone(sides: int) -> Primitive:
    """Return the half cone with half of so many facets."""
    apothem, fall = find_apothem(sides), q1 * V
    radius = apothem / math.cos(math.pi / sides)
    angles = [2.0 * math.pi * k / sides - 0.5 * math.pi for k in range(1, sides // 2)]
    arc = [(2.0 * radius * math.cos(a) - 1.0, radius * math.sin(a)) for a in angles]
    rim = ((-1.0, -radius), *arc, (-1.0, radius))
    steep: Formula = fall * (1.0 / apothem)

    def corners(p: Mapping[str, float]) -> Corners:
        """Return the corners of the plan, then the apex."""
        u, v = p["length"] / 2, p["width"] / 2
        return [*((u * x, v * y, 0.0) for x, y in rim), (-u, 0.0, p["height"])]

    def make_plane(x: float, y: float) -> Plane:
        """Return the plane of the facet that faces to x, y."""
        return -(steep / U) * (0.5 * x), -(steep / V) * y, q0 - steep * (0.5 * x)

    def draw(rng: np.random.Generator, width: float) -> dict[str, float]:
        return CONE.draw_parameters(rng, width) | {"length": width / 2}

    last = len(rim)
    return Primitive(
        name="half_cone",
        citygml_code=CONE.citygml_code,
        adv_code=CONE.adv_code,
        osm_shape=CONE.osm_shape,
        legend=CONE.legend,
        measures=CONE.measures,
        eave=CONE.eave,
        planes=tuple(make_plane(x, y) for x, y in list_half_directions(sides)),
        shape=shape,
        corners=corners,
        faces=tuple((k, k + 1, last) for k in range(last - 1)),
        typical=typical,
        bounds=CONE.bounds,
        starts=(
            *at_quarters("pyramid", (q0, q1)),
            *(DerivedStart("monopitch", (q0, q1), quarter) for quarter in (1, 3)),
        ),
        half_turn_symmetric=False,
        rim=rim,
        draw=draw,
    )


def measure_extent(p: Mapping[str, float]) -> float:
    """Return the longer diameter (m) of the whole ellipse."""
    return max(p["width"], 2.0 * p["length"])


first, *others = (make_half_cone(sides) for sides in SIDE_COUNTS)
HALF_CONE = replace(
    first,
    more=tuple(replace(cone, starts=()) for cone in others),
    choose=lambda p: count_sides({"length": measure_extent(p)}),
    refine=lambda p, chord_m: make_half_cone(find_sides(measure_extent(p) / 2, chord_m)),
)
