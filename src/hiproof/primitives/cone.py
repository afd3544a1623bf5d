"""Cones and spires: facets that rise from a round or many-sided plan to one apex.

A broach is a spire of eight sides, and a hexagonal spire has six. Their length is measured across
flats. A cone is round: its facets follow
its size (facets.py).
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from .algebra import Formula, U, V, q0, q1
from .contract import SLOPE_MIN, SPIRE_SLOPE_MAX, DerivedStart, Primitive
from .drawing import drawn_slope
from .facets import (
    SIDE_COUNTS,
    count_sides,
    find_apothem,
    find_sides,
    make_facet_planes,
    make_rim,
)
from .gable import shape, typical
from .pyramid import canonical

BROACH_SIDES = 8  # Sides of the spire of most church towers that have one.
HEXAGON_SIDES = 6  # Sides of the spires of pavilions and turrets that have neither four nor eight.


def make_pointed(
    name: str, sides: int, apothem: float, codes: tuple[str, str, str], steep: tuple[float, float]
) -> Primitive:
    """Return the shape of so many facets.

    `apothem` is the inner radius of its plan where its half extents are 1. `codes` are those of
    CityGML, AdV and OpenStreetMap, and simulated slopes lie between two angles (degrees).
    """
    rim = make_rim(sides, apothem)

    def corners(p: Mapping[str, float]) -> list[tuple[float, float, float]]:
        """Return the corners of the plan, then the apex."""
        u, v = p["length"] / 2, p["width"] / 2
        return [*((u * x, v * y, 0.0) for x, y in rim), (0.0, 0.0, p["height"])]

    def draw(rng: np.random.Generator, width: float) -> dict[str, float]:
        return typical(width, width, width / 2 * drawn_slope(rng, *steep))

    fall: Formula = q1 * V
    return Primitive(
        name=name,
        citygml_code=codes[0],
        adv_code=codes[1],
        osm_shape=codes[2],
        legend="pyramid",
        measures={"width": 2 * V, "length": 2 * U, "height": fall},
        eave=q0 - fall,
        planes=make_facet_planes(sides, apothem, fall, q0),
        shape=shape,
        corners=corners,
        faces=tuple((k, (k + 1) % sides, sides) for k in range(sides)),
        typical=typical,
        bounds=((SLOPE_MIN, SPIRE_SLOPE_MAX),),
        # Facets may face between those of the pyramid, too.
        starts=tuple(
            DerivedStart("pyramid", (q0, q1), turn=turn) for turn in (0.0, math.pi / sides)
        ),
        # A quarter turn would change what has no side at +v.
        canonical=canonical if sides % 4 == 0 else lambda theta: theta,
        rim=rim,
        draw=draw,
    )


@cache
def make_cone(sides: int) -> Primitive:
    """Return the cone of so many facets over a circle's area."""
    return make_pointed("cone", sides, find_apothem(sides), ("1080", "3600", "cone"), (25.0, 72.0))


first, *others = (make_cone(sides) for sides in SIDE_COUNTS)
CONE = replace(
    first,
    more=tuple(replace(cone, starts=()) for cone in others),
    choose=count_sides,
    refine=lambda p, chord_m: make_cone(find_sides(p["length"] / 2, chord_m)),
)
BROACH = make_pointed("broach", BROACH_SIDES, 1.0, ("1120", "4000", "pyramidal"), (55.0, 78.0))
hexagon = make_pointed(
    "hexagonal_spire", HEXAGON_SIDES, 1.0, ("1120", "4000", "pyramidal"), (55.0, 78.0)
)
# No quarter turn leaves a hexagon as it is.
across = DerivedStart("pyramid", (q0, q1 * V / U), quarters=1)
HEXAGONAL_SPIRE = replace(hexagon, starts=(*hexagon.starts, across))
