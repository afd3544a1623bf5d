"""Domes and barrel vaults: chords of an arc around an axis or along a ridge.

facets.py says how an arc is written.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from .algebra import U, V, q0, q1
from .contract import Corners, DerivedStart, Primitive, at_quarters
from .drawing import drawn_plan
from .facets import (
    MOST_FACETS,
    PROFILE_DEG,
    SIDE_COUNTS,
    count_sides,
    draw_profile,
    find_apothem,
    find_sides,
    find_splits,
    make_rim,
)
from .gable import shape, typical
from .revolved import list_ring_corners, list_ring_faces, make_ring_planes

LOWEST, HIGHEST = 0.1, 1.0  # Height over half the width: flatter is level, and higher no arc.
CHORDS = len(PROFILE_DEG) - 1  # of half a profile
MOST_SPLITS = 8  # Parts of each chord of a barrel.
CROWN = q1 * V  # height of the crown above the eave
STARTS = (0.5, 0.9)  # Shares of a gable's or a pyramid's slope at which an arc begins.


def make_vault(
    name: str, codes: tuple[str, str, str], starts: tuple[DerivedStart, ...], **own: Any
) -> Primitive:
    """Return a vault with its `own` planes, corners, faces and plan.

    `codes` are those of CityGML, AdV and OpenStreetMap.
    """
    return Primitive(
        name=name,
        citygml_code=codes[0],
        adv_code=codes[1],
        osm_shape=codes[2],
        measures={"width": 2 * V, "length": 2 * U, "height": CROWN},
        eave=q0 - CROWN,
        shape=shape,
        typical=lambda width, length, height: typical(width, length, min(height, width / 2)),
        bounds=((LOWEST, HIGHEST),),
        starts=starts,
        **own,
    )


def make_starts(source: str) -> tuple[DerivedStart, ...]:
    """Return starts from the fit of a `source` with straight slopes, along and across."""
    return tuple(
        start
        for share in STARTS
        for start in at_quarters(source, (q0 - 0.2 * q1 * V, share * q1), (0, 1))
    )


@cache
def make_dome(sides: int, splits: int = 1) -> Primitive:
    """Return the dome of so many facets around, each chord of its profile split."""
    profile = draw_profile(True, splits)
    return make_vault(
        "dome",
        ("1090", "3700", "dome"),
        make_starts("pyramid"),
        planes=make_ring_planes(sides, profile, q0 - CROWN),
        corners=partial(list_ring_corners, sides, profile, shape),
        faces=list_ring_faces(sides, len(profile.chords)),
        rim=make_rim(sides, find_apothem(sides)),
        draw=lambda rng, width: typical(width, width, width / 2 * float(rng.uniform(0.3, 1.0))),
    )


@cache
def make_barrel(splits: int = 1) -> Primitive:
    """Return the barrel vault: an arc across the width, straight along the length.

    Each chord of the arc is split into so many.
    """
    profile = draw_profile(False, splits)
    shares = [-r for r in profile.knots[:0:-1]] + profile.knots
    heights = profile.heights[:0:-1] + profile.heights
    chords = [(fall, q0 - CROWN + height) for height, fall in profile.chords]

    def corners(p: Mapping[str, float]) -> Corners:
        """Return pairs at -u and +u, from the eave at -v to the eave at +v."""
        u, v, values = p["length"] / 2, p["width"] / 2, shape(p)
        return [
            (x, share * v, height.at(values))
            for share, height in zip(shares, heights, strict=True)
            for x in (-u, u)
        ]

    def draw(rng: np.random.Generator, width: float) -> dict[str, float]:
        return drawn_plan(rng, width, 1.0, 2.5) | {"height": width / 2 * float(rng.uniform(0.3, 1))}

    strips = [(2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2) for k in range(len(shares) - 1)]
    front, back = strips[: len(chords)], strips[len(chords) :]
    return make_vault(
        "barrel",
        ("1110", "3900", "round"),
        make_starts("gable"),
        planes=(
            *((0, fall / V, top) for fall, top in chords),
            *((0, -(fall / V), top) for fall, top in chords),
        ),
        corners=corners,
        faces=(*front[::-1], *back),
        draw=draw,
    )


def refine_dome(p: Mapping[str, float], chord_m: float) -> Primitive:
    """Return the dome with facets within a tolerance, at most MOST_FACETS."""
    sides = min(find_sides(p["length"] / 2, chord_m), max(SIDE_COUNTS))
    return make_dome(sides, find_splits(p["height"], chord_m, MOST_FACETS // sides // CHORDS))


first, *others = (make_dome(sides) for sides in SIDE_COUNTS)
DOME = replace(
    first,
    more=tuple(replace(dome, starts=()) for dome in others),
    choose=count_sides,
    refine=refine_dome,
)
BARREL = replace(
    make_barrel(),
    refine=lambda p, chord_m: make_barrel(find_splits(p["height"], chord_m, MOST_SPLITS)),
)
