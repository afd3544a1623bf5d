"""Turn a profile of chords around an axis: rings of facets, the innermost first.

Domes and onions are made so. facets.py draws their profiles. A barrel vault has its chords along a
ridge. An onion is a bulge, and above its neck a hollow pointed top.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from ..data_files import Values
from .algebra import Formula, V, q0, q1, q2
from .contract import Corners, Parameters, Plane, Primitive
from .facets import (
    PROFILE_DEG,
    SIDE_COUNTS,
    ChordProfile,
    draw_profile,
    find_apothem,
    find_splits,
    make_facet_planes,
    make_rim,
    raise_knots,
    with_facets,
)
from .table import make_shape


def revolve(
    name: str,
    sides: int,
    profile: ChordProfile,
    eave: Formula,
    constants: Values | None = None,
    **changes: Any,
) -> Primitive:
    """Return the shape of a row whose profile is turned, in so many facets around."""
    rim = make_rim(sides, find_apothem(sides))
    planes: tuple[Plane, ...] = ()
    for height, fall in profile.chords:
        planes += make_facet_planes(sides, find_apothem(sides), fall, eave + height)

    def corners(p: Parameters) -> Corners:
        """Return the apex, then ring by ring the corners of the facets, last the eave's."""
        values, ring = shape.shape(p), np.array(rim) * (p["length"] / 2, p["width"] / 2)
        rings = [
            np.column_stack([share * ring, np.full(sides, height.at(values))])
            for share, height in zip(profile.knots[1:], profile.heights[1:], strict=True)
        ]
        return np.vstack([[[0.0, 0.0, p["height"]]], *rings])

    faces = list_ring_faces(sides, len(profile.chords))
    shape = make_shape(
        name, constants, planes=planes, corners=corners, faces=faces, rim=rim, **changes
    )
    return shape


def list_ring_faces(sides: int, rings: int) -> tuple[tuple[int, ...], ...]:
    """Return the corners of every facet of so many rings."""
    first = np.arange(1, sides + 1)
    pairs = np.column_stack([first, np.roll(first, -1)])
    faces = [(*pair, 0) for pair in pairs.tolist()]
    for start in range(sides, rings * sides, sides):
        faces += np.hstack([pairs + start, pairs[:, ::-1] + start - sides]).tolist()
    return tuple(map(tuple, faces))


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
    return ChordProfile([*top, *bulge[1:]], [*heights, *(q1 * V * z for z in ellipse[1:])])


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


ONION = with_facets(
    make_onion,
    side_counts=tuple(sides for sides in SIDE_COUNTS if sides <= MOST_SIDES),
    chords=ALL_CHORDS,
    rise="neck_height",
)


MOST_SPLITS = 8  # Parts of each chord of a barrel.
EAVE = q0 - q1 * V


@cache
def make_dome(sides: int, splits: int = 1) -> Primitive:
    """Return the dome of so many facets around, each chord of its profile split."""
    return revolve("dome", sides, draw_profile(True, splits), EAVE)


@cache
def make_barrel(splits: int = 1) -> Primitive:
    """Return the barrel vault, straight along its length, each chord of its arc split."""
    profile = draw_profile(False, splits)
    shares = [-r for r in profile.knots[:0:-1]] + profile.knots
    heights = profile.heights[:0:-1] + profile.heights
    chords = [(fall, EAVE + height) for height, fall in profile.chords]

    def corners(p: Parameters) -> Corners:
        """Return pairs at -u and +u, from the eave at -v to the eave at +v."""
        u, v, values = p["length"] / 2, p["width"] / 2, vault.shape(p)
        return [
            (x, share * v, height.at(values))
            for share, height in zip(shares, heights, strict=True)
            for x in (-u, u)
        ]

    strips = [(2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2) for k in range(len(shares) - 1)]
    front, back = strips[: len(chords)], strips[len(chords) :]
    vault = make_shape(
        "barrel",
        planes=(
            *((0, fall / V, top) for fall, top in chords),
            *((0, -(fall / V), top) for fall, top in chords),
        ),
        corners=corners,
        faces=(*front[::-1], *back),
    )
    return vault


DOME = with_facets(make_dome, chords=len(PROFILE_DEG) - 1, rise="height")
BARREL = replace(
    make_barrel(),
    refine=lambda p, chord_m: make_barrel(find_splits(p["height"], chord_m, MOST_SPLITS)),
)
