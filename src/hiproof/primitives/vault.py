"""Domes and barrel vaults: chords of an arc around an axis or along a ridge.

facets.py says how an arc is written.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

from .algebra import V, q0, q1
from .contract import Corners, Primitive
from .facets import (
    MOST_FACETS,
    PROFILE_DEG,
    SIDE_COUNTS,
    count_sides,
    draw_profile,
    find_sides,
    find_splits,
    with_facets,
)
from .revolved import revolve
from .table import make_shape

CHORDS = len(PROFILE_DEG) - 1  # of half a profile
MOST_SPLITS = 8  # Parts of each chord of a barrel.
EAVE = q0 - q1 * V


@cache
def make_dome(sides: int, splits: int = 1) -> Primitive:
    """Return the dome of so many facets around, each chord of its profile split."""
    return revolve("dome", sides, draw_profile(True, splits), EAVE)


@cache
def make_barrel(splits: int = 1) -> Primitive:
    """Return the barrel vault: an arc across the width, straight along the length.

    Each chord of the arc is split into so many.
    """
    profile = draw_profile(False, splits)
    shares = [-r for r in profile.knots[:0:-1]] + profile.knots
    heights = profile.heights[:0:-1] + profile.heights
    chords = [(fall, EAVE + height) for height, fall in profile.chords]

    def corners(p: Mapping[str, float]) -> Corners:
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


def refine_dome(p: Mapping[str, float], chord_m: float) -> Primitive:
    """Return the dome with facets within a tolerance, at most MOST_FACETS."""
    sides = min(find_sides(p["length"] / 2, chord_m), max(SIDE_COUNTS))
    return make_dome(sides, find_splits(p["height"], chord_m, MOST_FACETS // sides // CHORDS))


DOME = with_facets(make_dome, choose=lambda p: count_sides(p["length"]), refine=refine_dome)
BARREL = replace(
    make_barrel(),
    refine=lambda p, chord_m: make_barrel(find_splits(p["height"], chord_m, MOST_SPLITS)),
)
