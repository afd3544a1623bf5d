"""The edges of roofs, and of objects on them, that may shade a building."""

from __future__ import annotations

import functools

import numpy as np

from ..compose.boxes import make_box
from ..model import ROOF, Building, Solid
from .records import MOST_KEPT
from .town import Town

SHADE_REACH_M = 200.0  # distance (m) up to which buildings shade
# Elevation (degrees) below which buildings count as none: the sun is weak there, and trees and
# terrain hide it.
LOWEST_HORIZON_DEG = 1.0


class ShadingEdges:
    """The roof edges of every building of a town, found once."""

    def __init__(self, town: Town) -> None:
        self.town = town
        self.list_edges = functools.lru_cache(MOST_KEPT)(self.find_edges)

    def find_edges(self, number: int) -> np.ndarray:
        building = self.town.read(number)
        if building.built is None:
            return np.empty((0, 2, 3))
        return np.concatenate([*map(roof_edges, (building.solid, *list_objects(building)))])

    def find_shading_edges(self, number: int, z_low: float) -> np.ndarray:
        """Return the edges (m, 2, 3) that shade places of building `number`.

        The lowest of these places is at `z_low`.
        """
        numbers = [number, *self.town.records.find_near(number, SHADE_REACH_M)]
        edges = np.concatenate([self.list_edges(k) for k in numbers])
        low_x, low_y, high_x, high_y = self.town.records.index.boxes[number]
        start, end = edges[:, 0], edges[:, 1]
        low, high = np.minimum(start, end), np.maximum(start, end)
        aside = [
            np.maximum(np.maximum(low[:, axis] - upper, lower - high[:, axis]), 0.0)
            for axis, lower, upper in ((0, low_x, high_x), (1, low_y, high_y))
        ]
        distance = np.hypot(*aside)
        rise = high[:, 2] - z_low
        return edges[rise > np.tan(np.radians(LOWEST_HORIZON_DEG)) * distance]


def list_objects(building: Building) -> list[Solid]:
    """Return the chimneys and other objects on a building's roof, in the world."""
    origin = building.roof.frame.origin
    return [make_box(item).move(origin) for item in building.model.installations]


def roof_edges(solid: Solid) -> np.ndarray:
    """Return the edges (m, 2, 3) of a solid's roof faces, each once."""
    pairs = {
        (min(start, end), max(start, end))
        for face in solid.faces
        if face.kind == ROOF
        for ring in face.rings
        for start, end in zip(ring, (*ring[1:], ring[0]), strict=True)
    }
    return solid.vertices[np.array(sorted(pairs), int).reshape(-1, 2)]
