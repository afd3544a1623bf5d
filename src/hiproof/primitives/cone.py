"""Cones and spires: facets that rise from a round or many-sided plan to one apex.

A broach is a spire of eight sides, and a hexagonal spire has six. Their length is measured across
flats. A cone is round: its facets follow its size (facets.py). Half a cone is the roof of an apse,
a half disc against a wall. Its apex lies in the middle of the straight side, at -u, and its length
is the depth of the plan: half of the width over a half circle.
"""

import math
from functools import cache

from .contract import Primitive
from .facets import find_apothem, list_facings, make_rim, with_facets
from .table import make_shape

BROACH_SIDES = 8  # Sides of the spire of most church towers that have one.
HEXAGON_SIDES = 6  # Sides of the spires of pavilions and turrets that have neither four nor eight.


def make_pointed(name: str, sides: int, apothem: float) -> Primitive:
    """Return the shape of so many facets; `apothem` is its inner radius for half extents 1."""
    rim, facings = make_rim(sides, apothem), list_facings(sides)
    constants = {"sides": sides, "apothem": apothem, "rim": rim, "facings": facings}
    return make_shape(name, constants, rim=rim)


@cache
def make_cone(sides: int) -> Primitive:
    """Return the cone of so many facets over a circle's area."""
    return make_pointed("cone", sides, find_apothem(sides))


@cache
def make_half_cone(sides: int) -> Primitive:
    """Return the half cone with half of so many facets, of which the wall cuts none."""
    apothem = find_apothem(sides)
    radius = apothem / math.cos(math.pi / sides)
    angles = [2.0 * math.pi * k / sides - 0.5 * math.pi for k in range(1, sides // 2)]
    arc = [(2.0 * radius * math.cos(a) - 1.0, radius * math.sin(a)) for a in angles]
    middles = [2.0 * math.pi * (k + 0.5) / sides - 0.5 * math.pi for k in range(sides // 2)]
    rim = ((-1.0, -radius), *arc, (-1.0, radius))
    facings = [(math.cos(a), math.sin(a)) for a in middles]
    constants = {"sides": sides, "apothem": apothem, "rim": rim, "facings": facings}
    return make_shape("half_cone", constants, rim=rim)


CONE = with_facets(make_cone)
# by the longer diameter of the whole ellipse
HALF_CONE = with_facets(make_half_cone, lambda p: max(p["width"], 2.0 * p["length"]))
BROACH = make_pointed("broach", BROACH_SIDES, 1.0)
HEXAGONAL_SPIRE = make_pointed("hexagonal_spire", HEXAGON_SIDES, 1.0)
