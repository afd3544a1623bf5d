"""Make facets of round shapes: polygons for circles, chords for profiles.

A circle is written as the regular polygon of the same area, so that facets lie about the surface
and volumes hold. Stretched in one axis, it is an ellipse.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from .algebra import Formula, U, V, q1
from .contract import Parameters, Plane, Primitive

# Farthest (m) that a facet's edge may lie off the circle that it stands for while it is fitted, the
# default of the setting `compose.chord_tolerance_m`.
CHORD_M = 0.1
SIDE_COUNTS = (16, 8, 32, 64)  # Sides of a circle, first those of an ordinary turret.
MOST_FACETS = 256  # Facets of a shape. A thousand take minutes to compose.
# Angles (degrees) on a quarter circle between which chords stand for it.
PROFILE_DEG = (0.0, 20.0, 40.0, 60.0, 90.0)
NUMERICAL_ZERO = 1e-12  # A smaller share is none.


def with_facets(
    make: Callable[..., Primitive],
    measure: Callable[[Parameters], float] = lambda p: p["length"],
    side_counts: tuple[int, ...] = SIDE_COUNTS,
    chords: int = 0,
    rise: str = "",
) -> Primitive:
    """Return a round shape with variants by number of sides, of which the first is fitted.

    It has as many sides as its diameter (m), by `measure`, asks for. A profile of so many `chords`
    has them split as its `rise`, a parameter, asks for, up to MOST_FACETS facets in all.

    >>> from .revolved import DOME
    >>> [len(DOME.variant({"length": x}).rim) for x in (2.0, 8.0, 30.0, 400.0)]
    [8, 16, 32, 64]
    """
    most = max(side_counts)

    def refine(p: Parameters, chord_m: float) -> Primitive:
        sides = find_sides(measure(p) / 2, chord_m)
        if not chords:
            return make(sides)
        sides = min(sides, most)
        return make(sides, find_splits(p[rise], chord_m, MOST_FACETS // sides // chords))

    first, *rest = map(make, side_counts)
    return replace(
        first,
        more=tuple(replace(shape, starts=()) for shape in rest),
        choose=lambda p: side_counts.index(min(find_sides(measure(p) / 2, CHORD_M), most)),
        refine=refine,
    )


def find_sides(radius: float, chord_m: float) -> int:
    """Return how many sides of a circle keep a tolerance: 8, 16, 32 or more."""
    sides = min(SIDE_COUNTS)
    while sides < MOST_FACETS and radius * (1.0 - math.cos(math.pi / sides)) > chord_m:
        sides *= 2
    return sides


def find_splits(rise: float, chord_m: float, most: int) -> int:
    """Return into how many parts a profile's chords are split for a tolerance.

    The `rise` (m) is the radius of half a circle. Chords of flatter arcs are flatter, too.
    There are at `most` so many parts.
    """
    splits, half_chord = 1, math.radians(0.5 * PROFILE_DEG[1])
    while 2 * splits <= most and rise * (1.0 - math.cos(half_chord / splits)) > chord_m:
        splits *= 2
    return splits


def find_apothem(sides: int) -> float:
    """Return the inner radius of the regular polygon with the area of the unit circle."""
    return math.sqrt(math.pi / sides / math.tan(math.pi / sides))


def list_facings(sides: int) -> list[tuple[float, float]]:
    """Return which way each of so many facets faces, the first to +u."""
    angles = [2.0 * math.pi * k / sides for k in range(sides)]
    pairs = [(math.cos(angle), math.sin(angle)) for angle in angles]
    return [
        (0.0 if abs(x) < NUMERICAL_ZERO else x, 0.0 if abs(y) < NUMERICAL_ZERO else y)
        for x, y in pairs
    ]


def make_rim(sides: int, apothem: float) -> tuple[tuple[float, float], ...]:
    """Return a polygon's corners in shares of half extents, counter-clockwise from a facet."""
    radius = apothem / math.cos(math.pi / sides)
    angles = [math.pi * (2 * k - 1) / sides for k in range(sides)]
    return tuple((radius * math.cos(angle), radius * math.sin(angle)) for angle in angles)


def make_facet_planes(sides: int, apothem: float, fall: Formula, top: Formula) -> tuple[Plane, ...]:
    """Return one plane a side, each from `top` at the axis down by `fall` at the rim."""
    steep = fall * (1.0 / apothem)
    along, across = -(steep / U), -(steep / V)
    return tuple((along * x, across * y, top) for x, y in list_facings(sides))


class ChordProfile(NamedTuple):
    """A profile in chords, as formulas of half the width V and of q.

    `knots` (k,) are shares of the radius, and `heights` (k,) those above the eave there.
    """

    knots: list[float]
    heights: list[Formula]

    @property
    def chords(self) -> list[tuple[Formula, Formula]]:
        """The height at the axis and the fall from there to the rim of each chord."""
        chords = []
        for (a, b), (z, z_next) in zip(pairwise(self.knots), pairwise(self.heights), strict=True):
            fall = (z - z_next) * (1.0 / (b - a))
            chords.append((z + fall * a, fall))
        return chords


def draw_profile(around_axis: bool, splits: int = 1) -> ChordProfile:
    """Draw a vault's profile in chords, `around_axis` or along a ridge.

    Each of four chords is split into so many. With k = q1 the height over the half width V, the
    profile at the share r of the radius is

        z = k V ((1 - k^2) (1 - r^2) + k^2 sqrt(1 - r^2))

    It is within a hundredth of a circular arc up to the half circle (k = 1). Chords meet a little
    outside of it, so that they hold as much as it does.
    """
    steps = np.arange(splits * (len(PROFILE_DEG) - 1)) / splits
    angles = np.interp(steps, np.arange(len(PROFILE_DEG)), PROFILE_DEG).tolist()
    knots = [math.sin(math.radians(angle)) for angle in angles] + [1.0]
    volumes = (1 / 4, 1 / 3) if around_axis else (2 / 3, math.pi / 4)
    parabola = raise_knots(knots, lambda r: 1.0 - r * r, volumes[0], around_axis)
    circle = raise_knots(knots, lambda r: math.sqrt(1.0 - r * r), volumes[1], around_axis)
    cube = q1 * q1 * q1 * V
    heights = [(q1 * V - cube) * x + cube * y for x, y in zip(parabola, circle, strict=True)]
    return ChordProfile(knots, heights)


def raise_knots(
    knots: list[float], profile: Callable[[float], float], volume: float, around_axis: bool
) -> list[float]:
    """Return the profile at the knots, inner ones raised so that chords hold the `volume`."""

    def integrate(values: list[float]) -> float:
        total = 0.0
        for (a, b), (x, y) in zip(pairwise(knots), pairwise(values), strict=True):
            mean = (a * (2 * x + y) + b * (x + 2 * y)) / 6 if around_axis else (x + y) / 2
            total += (b - a) * mean
        return total

    values = [profile(r) for r in knots]
    inner = [0.0, *values[1:-1], 0.0]
    share = (volume - integrate(values)) / integrate(inner)
    return [value + share * part for value, part in zip(values, inner, strict=True)]
