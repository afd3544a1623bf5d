"""The geometry of one building in CityJSON: a Solid with semantics, and its footprint."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely

from ..frames import METRES, Units
from ..model import GROUND, ROOF, Building, Face
from .building_attributes import OWN, plain, rounded
from .roof_figures import RoofFigures

LOD_SOLID, LOD_FOOTPRINT = "2.2", "0"


class Vertices:
    """The vertices of one feature as integers: integer * scale + origin, in `units`; equal ones are one."""

    def __init__(self, origin: np.ndarray, scale: float, units: Units = METRES) -> None:
        self.origin, self.scale, self.units = origin, scale, units
        self.grid: list[tuple[int, int, int]] = []
        self.index_of: dict[tuple[int, int, int], int] = {}

    def add(self, xyz: np.ndarray) -> list[int]:
        """Indices of the world coordinates `xyz` (n, 3), metres."""
        integers = np.rint((self.units.from_metres(xyz) - self.origin) / self.scale).astype(np.int64).tolist()
        return [self.index(tuple(integer)) for integer in integers]

    def index(self, integer: tuple[int, int, int]) -> int:
        index = self.index_of.setdefault(integer, len(self.grid))
        if index == len(self.grid):
            self.grid.append(integer)
        return index


def building_geometry(
    building: Building, figures: RoofFigures | None, vertices: Vertices, prefix: str
) -> list[dict[str, Any]]:
    """LoD 0 footprint and LoD 2.2 solid of `building`, as far as it has them; their vertices go to `vertices`."""
    if figures is not None:
        number = vertices.add(building.solid.vertices)
        boundaries = [numbered(face, number) for face in building.solid.faces]
        footprint = [
            [ring[::-1] for ring in rings]
            for face, rings in zip(building.solid.faces, boundaries, strict=True)
            if face.kind == GROUND
        ]
        footprint = unmoved_footprint(building, vertices) if any(building.shift) else footprint
        return [multi_surface(footprint), solid_geometry(building, figures, boundaries, prefix)]
    if has_level_footprint(building):
        return [multi_surface(footprint_boundaries(building, vertices))]
    return []


def unmoved_footprint(building: Building, vertices: Vertices) -> list[list[list[int]]]:
    """The ground surfaces of a solid whose footprint was moved, where the footprint lay."""
    corners = building.solid.vertices - np.array([*building.shift, 0.0])
    grounds = building.solid.of_kind(GROUND)
    return [[vertices.add(corners[list(ring)])[::-1] for ring in face.rings] for face in grounds]


def numbered(face: Face, number: list[int]) -> list[list[int]]:
    """Rings of `face` by the feature's vertex numbers."""
    return [[number[index] for index in ring] for ring in face.rings]


def multi_surface(boundaries: list) -> dict[str, Any]:
    return {"type": "MultiSurface", "lod": LOD_FOOTPRINT, "boundaries": boundaries}


def solid_geometry(building: Building, figures: RoofFigures, boundaries: list, prefix: str) -> dict[str, Any]:
    """The Solid: every roof face is a semantic surface of its own, walls share one and so does the ground."""
    surfaces: list[dict[str, Any]] = []
    shared: dict[str, int] = {}
    values = []
    for index, face in enumerate(building.solid.faces):
        if face.kind == ROOF:
            values.append(len(surfaces))
            surfaces.append(roof_surface(building, face, index, figures, prefix))
        else:
            if face.kind not in shared:
                shared[face.kind] = len(surfaces)
                surfaces.append({"type": face.kind})
            values.append(shared[face.kind])
    semantics = {"surfaces": surfaces, "values": [values]}
    return {"type": "Solid", "lod": LOD_SOLID, "boundaries": [boundaries], "semantics": semantics}


def roof_surface(building: Building, face: Face, index: int, figures: RoofFigures, prefix: str) -> dict[str, Any]:
    """Semantics of one roof face: slope, azimuth (degrees) and the roof part it belongs to."""
    surface: dict[str, Any] = {
        "type": ROOF,
        f"{prefix}slope": plain(rounded(figures.face_slope_deg[index], 3)),
        f"{prefix}azimuth": plain(rounded(figures.face_azimuth_deg[index], 3)),
    }
    if 0 <= face.part < len(building.parts):
        surface[f"{OWN}part"] = int(face.part)
        surface[f"{OWN}part_type"] = building.parts[face.part].type
    return surface


def has_level_footprint(building: Building) -> bool:
    """Whether a building without a solid still has an outline and a height to draw it at."""
    footprint = building.footprint
    return footprint is not None and not footprint.is_empty and math.isfinite(building.z_ground)


def footprint_boundaries(building: Building, vertices: Vertices) -> list[list[list[int]]]:
    """Surfaces of the footprint at ground height, outer rings counter-clockwise seen from above."""
    surfaces = []
    for polygon in shapely.get_parts(shapely.normalize(building.footprint)):
        polygon = shapely.geometry.polygon.orient(polygon)
        rings = []
        for ring in (polygon.exterior, *polygon.interiors):
            xy = shapely.get_coordinates(ring)[:-1]
            rings.append(vertices.add(np.column_stack([xy, np.full(len(xy), building.z_ground)])))
        surfaces.append(rings)
    return surfaces


def first_corner(building: Building) -> np.ndarray | None:
    """A corner (3,) of what `building_geometry` would draw, None if that is nothing."""
    if building.solid is not None:
        return building.solid.vertices.min(axis=0)
    if has_level_footprint(building):
        return np.array([*building.footprint.bounds[:2], building.z_ground])
    return None
