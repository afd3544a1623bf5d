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
from dataclasses import replace
from functools import cache, partial

import numpy as np

from .algebra import U, V, q0, q1, q2
from .contract import DerivedStart, Primitive, Shape
from .facets import (
    CHORD_M,
    MOST_FACETS,
    SIDE_COUNTS,
    ChordProfile,
    find_apothem,
    find_sides,
    find_splits,
    join_knots,
    make_rim,
    raise_knots,
)
from .revolved import list_ring_corners, list_ring_faces, make_ring_planes

NECK = 0.4  # Share of the radius at which the bulge ends.
TOP_KNOTS = (0.0, 0.4, 1.0)  # Shares of the neck's radius between which chords make the top.
BULGE_CHORDS = 2  # of equal angles, between the neck and the eave
ALL_CHORDS = len(TOP_KNOTS) - 1 + BULGE_CHORDS
# Height of the bulge over half the width: flatter and higher ones are not built.
LOWEST_BULGE, HIGHEST_BULGE = 0.2, 1.6
FLATTEST_TYPICAL, STEEPEST_TYPICAL = (
    0.25,
    1.8,
)  # Heights over the width between which a typical onion is one.
MOST_BEND = 4.0  # Largest height over half the width by which the top bends up: a needle.
MOST_SIDES = 32  # They keep the tolerance of chords up to a diameter of 40 m.
NECK_HEIGHT = math.sqrt(1.0 - NECK * NECK)  # of a bulge of the height 1
LINE_TOP = NECK_HEIGHT / (1.0 - NECK)  # Height on the axis of the line through eave and neck.
# Shares of a pyramid's slope at which the bulge and the bend of the top begin.
ONION_STARTS = ((0.4, 0.6), (0.7, 0.3))


def draw_onion(splits: int = 1) -> ChordProfile:
    """Draw the profile, each of its chords split into so many."""
    steps = np.arange(splits * (len(TOP_KNOTS) - 1) + 1) / splits
    top = (NECK * np.interp(steps, np.arange(len(TOP_KNOTS)), TOP_KNOTS)).tolist()
    angles = np.linspace(math.asin(NECK), 0.5 * math.pi, splits * BULGE_CHORDS + 1)
    bulge = [NECK, *np.sin(angles[1:-1]).tolist(), 1.0]
    bend = raise_knots(top, lambda r: (1.0 - r / NECK) ** 2, NECK * NECK / 12.0, True)
    ellipse = raise_knots(bulge, lambda r: math.sqrt(1.0 - r * r), NECK_HEIGHT**3 / 3.0, True)
    heights = [q1 * V * (LINE_TOP * (1.0 - r)) + q2 * V * z for r, z in zip(top, bend, strict=True)]
    return join_knots([*top, *bulge[1:]], [*heights, *(q1 * V * z for z in ellipse[1:])])


def shape(p: Mapping[str, float]) -> Shape:
    """Return V, U and q, the eave at 0."""
    v, rise = p["width"] / 2, p["neck_height"] / NECK_HEIGHT
    return v, p["length"] / 2, 0.0, rise / v, (p["height"] - rise * LINE_TOP) / v, 0.0


def typical(width: float, length: float, height: float) -> dict[str, float]:
    """Return an onion of these sizes, higher or lower if no onion is so flat or steep."""
    height = min(max(height, FLATTEST_TYPICAL * width), STEEPEST_TYPICAL * width)
    return {"width": width, "length": length, "height": height, "neck_height": 0.4 * height}


def draw(rng: np.random.Generator, width: float) -> dict[str, float]:
    """Draw an onion as high as it is wide, or up to half as high again."""
    height = width * float(rng.uniform(0.9, 1.5))
    return typical(width, width, height) | {"neck_height": height * float(rng.uniform(0.33, 0.45))}


@cache
def make_onion(sides: int, splits: int = 1) -> Primitive:
    """Return the onion of so many facets around, each chord of its profile split."""
    profile = draw_onion(splits)
    top_rings = splits * (len(TOP_KNOTS) - 1)
    return Primitive(
        name="onion",
        citygml_code="1090",
        adv_code="3700",
        osm_shape="onion",
        measures={
            "width": 2 * V,
            "length": 2 * U,
            "height": q1 * V * LINE_TOP + q2 * V,
            "neck_height": q1 * V * NECK_HEIGHT,
        },
        eave=q0 * 1.0,
        planes=make_ring_planes(sides, profile, q0),
        minima=(*[sides] * top_rings, sides * splits * BULGE_CHORDS),
        shape=shape,
        corners=partial(list_ring_corners, sides, profile, shape),
        faces=list_ring_faces(sides, len(profile.chords)),
        typical=typical,
        bounds=((LOWEST_BULGE, HIGHEST_BULGE), (0.0, MOST_BEND)),
        starts=tuple(
            DerivedStart("pyramid", (q0 - q1 * V, bulge * q1, bend * q1))
            for bulge, bend in ONION_STARTS
        ),
        rim=make_rim(sides, find_apothem(sides)),
        draw=draw,
    )


def count_sides(p: Mapping[str, float]) -> int:
    """Return the place among the variants of the fewest sides that keep CHORD_M."""
    return SIDE_COUNTS.index(min(find_sides(p["length"] / 2, CHORD_M), MOST_SIDES))


def refine_onion(p: Mapping[str, float], chord_m: float) -> Primitive:
    """Return the onion with facets within a tolerance, at most MOST_FACETS."""
    sides = min(find_sides(p["length"] / 2, chord_m), MOST_SIDES)
    return make_onion(
        sides, find_splits(p["neck_height"], chord_m, MOST_FACETS // sides // ALL_CHORDS)
    )


first, *others = (make_onion(sides) for sides in SIDE_COUNTS if sides <= MOST_SIDES)
ONION = replace(
    first,
    more=tuple(replace(onion, starts=()) for onion in others),
    choose=count_sides,
    refine=refine_onion,
)
