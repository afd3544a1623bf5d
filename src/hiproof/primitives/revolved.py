"""Turn a profile of chords around an axis: rings of facets, the innermost first.

Domes and onions are made so. facets.py draws their profiles.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .algebra import Formula
from .contract import Corners, Plane, Primitive
from .facets import ChordProfile, find_apothem, make_facet_planes, make_rim
from .table import make_shape


def revolve(
    name: str,
    sides: int,
    profile: ChordProfile,
    eave: Formula,
    constants: Mapping[str, float] | None = None,
    **changes: Any,
) -> Primitive:
    """Return the shape of a row whose profile is turned, in so many facets around."""
    rim = make_rim(sides, find_apothem(sides))
    planes: tuple[Plane, ...] = ()
    for height, fall in profile.chords:
        planes += make_facet_planes(sides, find_apothem(sides), fall, eave + height)

    def corners(p: Mapping[str, float]) -> Corners:
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
    places = [(k, (k + 1) % sides) for k in range(sides)]
    faces: list[tuple[int, ...]] = [(1 + k, 1 + after, 0) for k, after in places]
    for ring in range(1, rings):
        lower, upper = 1 + ring * sides, 1 + (ring - 1) * sides
        faces += [(lower + k, lower + after, upper + after, upper + k) for k, after in places]
    return tuple(faces)
