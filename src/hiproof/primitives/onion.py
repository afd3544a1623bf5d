"""Onion: a bulge around an axis, and above its neck a hollow pointed top.

Its roof is a height over the plan, as every roof is. So its eave lies at its widest circle: what
draws in below that, down to a narrower drum, cannot be seen from the air, and walls are vertical.

With the radius V the bulge is a quarter ellipse of the height q1 V. At the NECK, a share of the
radius, the top begins along the straight line from the eave through the neck, and bends up from it
by q2 V. The bulge curves outward, so no line of the top rises above it outside the neck. The roof
therefore is the highest of several minima: one for each ring of the top, and one for the bulge.
facets.py says how curves are written.
"""

import math
from collections.abc import Mapping
from functools import cache

import numpy as np

from .algebra import V, q0, q1, q2
from .contract import Primitive
from .facets import (
    MOST_FACETS,
    SIDE_COUNTS,
    ChordProfile,
    count_sides,
    find_sides,
    find_splits,
    join_knots,
    raise_knots,
    with_facets,
)
from .revolved import revolve

NECK = 0.4  # Share of the radius at which the bulge ends.
TOP_KNOTS = (0.0, 0.4, 1.0)  # Shares of the neck's radius between which chords make the top.
BULGE_CHORDS = 2  # of equal angles, between the neck and the eave
ALL_CHORDS = len(TOP_KNOTS) - 1 + BULGE_CHORDS
MOST_SIDES = 32  # They keep the tolerance of chords up to a diameter of 40 m.
NECK_RISE = math.sqrt(1.0 - NECK * NECK)  # of a bulge of the height 1
LINE_TOP = NECK_RISE / (1.0 - NECK)  # Height on the axis of the line through eave and neck.


def draw_onion(splits: int = 1) -> ChordProfile:
    """Draw the profile, each of its chords split into so many."""
    steps = np.arange(splits * (len(TOP_KNOTS) - 1) + 1) / splits
    top = (NECK * np.interp(steps, np.arange(len(TOP_KNOTS)), TOP_KNOTS)).tolist()
    angles = np.linspace(math.asin(NECK), 0.5 * math.pi, splits * BULGE_CHORDS + 1)
    bulge = [NECK, *np.sin(angles[1:-1]).tolist(), 1.0]
    bend = raise_knots(top, lambda r: (1.0 - r / NECK) ** 2, NECK * NECK / 12.0, True)
    ellipse = raise_knots(bulge, lambda r: math.sqrt(1.0 - r * r), NECK_RISE**3 / 3.0, True)
    heights = [q1 * V * (LINE_TOP * (1.0 - r)) + q2 * V * z for r, z in zip(top, bend, strict=True)]
    return join_knots([*top, *bulge[1:]], [*heights, *(q1 * V * z for z in ellipse[1:])])


@cache
def make_onion(sides: int, splits: int = 1) -> Primitive:
    """Return the onion of so many facets around, each chord of its profile split."""
    top_rings = splits * (len(TOP_KNOTS) - 1)
    return revolve(
        "onion",
        sides,
        draw_onion(splits),
        q0,
        {"neck_rise": NECK_RISE, "line_top": LINE_TOP},
        minima=(*[sides] * top_rings, sides * splits * BULGE_CHORDS),
    )


def refine_onion(p: Mapping[str, float], chord_m: float) -> Primitive:
    """Return the onion with facets within a tolerance, at most MOST_FACETS."""
    sides = min(find_sides(p["length"] / 2, chord_m), MOST_SIDES)
    return make_onion(
        sides, find_splits(p["neck_height"], chord_m, MOST_FACETS // sides // ALL_CHORDS)
    )


ONION = with_facets(
    make_onion,
    tuple(sides for sides in SIDE_COUNTS if sides <= MOST_SIDES),
    choose=lambda p: count_sides(p["length"], MOST_SIDES),
    refine=refine_onion,
)
