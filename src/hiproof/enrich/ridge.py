"""The direction of a roof's ridge."""

from __future__ import annotations

import numpy as np

from ..model import ROOF, Solid
from ..model.roof_figures import LEVEL_RIDGE_M
from .areas import area_vectors


def find_ridge_direction(solid: Solid) -> float | None:
    """Return the compass direction (degrees, 0 to 180) of the longest level ridge.

    A ridge is an edge from which the roof faces on both sides fall away. None without one.
    """
    vectors = area_vectors(solid)
    sides: dict[tuple[int, int], int] = {}
    for number, face in enumerate(solid.faces):
        if face.kind == ROOF:
            for ring in face.rings:
                pairs = zip(ring, (*ring[1:], ring[0]), strict=True)
                sides |= {(start, end): number for start, end in pairs}
    best, direction = 0.0, None
    for (start, end), left in sides.items():
        other = sides.get((end, start))
        along = solid.vertices[end] - solid.vertices[start]
        length = round(float(np.hypot(along[0], along[1])), 3)
        if other is None or start > end or abs(along[2]) >= LEVEL_RIDGE_M or length <= best:
            continue
        if tell_fall(vectors[left], along) and tell_fall(vectors[other], -along):
            best, direction = length, float(np.degrees(np.arctan2(along[0], along[1])) % 180.0)
    return direction


def tell_fall(vector: np.ndarray, along: np.ndarray) -> bool:
    """Return whether a face left of an edge falls away from it, by its vector area."""
    return bool(vector[1] * along[0] - vector[0] * along[1] > 1e-9)
