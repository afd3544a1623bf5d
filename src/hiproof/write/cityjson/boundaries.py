"""The geometry of a building in CityJSON: footprint, roof edge, blocks, Solids, semantics."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
import shapely

from ...compose.settle import round_number
from ...data_files import Values
from ...frames import METRES, Units
from ...model import GROUND, ROOF, Building, Face, Solid
from ...model.roof_figures import RoofFigures
from ..building_attributes import OWN
from ..fragments import Sheet
from ..shapes import PartShape, Shapes
from ..surfaces import group_faces, join_values, measure_angles, number_surfaces
from ..values import plain

LOD_SOLID, LOD_OVERHANGS, LOD_FOOTPRINT = "2.2", "2.3", "0"


class Vertices:
    """The vertices of one feature, each once, as integers * scale + origin in `units`."""

    def __init__(self, origin: np.ndarray, scale: float, units: Units = METRES) -> None:
        self.origin, self.scale, self.units = origin, scale, units
        self.numbers: dict[tuple[int, ...], int] = {}

    @property
    def grid(self) -> list[tuple[int, ...]]:
        """The vertices in the order of their numbers."""
        return list(self.numbers)

    def add(self, xyz: np.ndarray) -> list[int]:
        """Add world coordinates `xyz` (n, 3), metres, and return their numbers."""
        grid = np.rint((self.units.from_metres(xyz) - self.origin) / self.scale).astype(np.int64)
        return [self.numbers.setdefault(tuple(p), len(self.numbers)) for p in grid.tolist()]


def building_geometry(sheet: Sheet, vertices: Vertices) -> list[Values]:
    """Return the geometry of the building itself, as far as it is asked for.

    The footprint comes always, then roof edge, blocks, and solid. Vertices go to `vertices`. A
    building in parts has no solid of its own.
    """
    building, shapes, lods = sheet.building, sheet.shapes, sheet.head.write.lods
    if sheet.figures is None:
        footprint = level_footprint(building)
        return (
            []
            if footprint is None
            else [multi_surface(outline_boundaries(footprint, building.z_ground, vertices))]
        )
    solids = []
    if LOD_SOLID in lods and not shapes.parts:
        whole = building.solid, sheet.figures, vertices, LOD_SOLID, sheet.surfaces
        solids.append(describe_solid(sheet, *whole))
    if LOD_OVERHANGS in lods:
        solids.append(describe_solid(sheet, *sheet.finest, vertices, LOD_OVERHANGS, {}))
    blocks = [(shapes.lod12, "1.2"), (shapes.lod13, "1.3")]
    return [
        *level_surfaces(building, shapes, vertices),
        *(solid_geometry(block, vertices, lod) for block, lod in blocks if block is not None),
        *solids,
    ]


def part_geometry(sheet: Sheet, part: PartShape, vertices: Vertices) -> list[Values]:
    """Return block and solid of a building part, as far as they are asked for."""
    geometry = [] if part.block is None else [solid_geometry(part.block, vertices, "1.3")]
    if LOD_SOLID in sheet.head.write.lods:
        whole = part.solid, part.figures, vertices, LOD_SOLID
        geometry.append(describe_solid(sheet, *whole, {}))
    return geometry


def level_surfaces(building: Building, shapes: Shapes, vertices: Vertices) -> list[Values]:
    """Return LoD0, told apart by semantics: the unmoved footprint and the roof's edge."""
    solid = building.model.on_one_level
    corners, grounds = solid.vertices, solid.select_faces(GROUND)
    unmoved = corners - np.array([*building.shift, 0.0]) if any(building.shift) else corners
    footprint = multi_surface(ground_boundaries(grounds, unmoved, vertices))
    if shapes.outline is None:
        return [footprint]
    edge = multi_surface(
        ground_boundaries((shapes.outline,), shapes.edge_vertices(solid), vertices)
    )
    return [name_surfaces(footprint, GROUND), name_surfaces(edge, ROOF)]


def ground_boundaries(
    grounds: tuple[Face, ...], corners: np.ndarray, vertices: Vertices
) -> list[list[list[int]]]:
    """Return ground faces at `corners` (n, 3), turned to look up."""
    return [[vertices.add(corners[list(ring)])[::-1] for ring in face.rings] for face in grounds]


def multi_surface(boundaries: list) -> Values:
    return {"type": "MultiSurface", "lod": LOD_FOOTPRINT, "boundaries": boundaries}


def name_surfaces(surface: Values, kind: str) -> Values:
    return {
        **surface,
        "semantics": {"surfaces": [{"type": kind}], "values": [0] * len(surface["boundaries"])},
    }


def solid_geometry(
    solid: Solid,
    vertices: Vertices,
    lod: str,
    described: Mapping[int, Values] = MappingProxyType({}),
    numbers: Sequence[int] | None = None,
) -> Values:
    """Return the Solid with its semantics.

    A surface in `described` is a semantic surface of its own; all other faces of a kind share one.
    `numbers` are those of the faces' surfaces.
    """
    vertex_numbers = vertices.add(solid.vertices)
    surfaces: dict[int | str, Values] = {}
    keys = []
    for number, face in zip(numbers or range(len(solid.faces)), solid.faces, strict=True):
        keys.append(number if number in described else face.kind)
        surfaces.setdefault(keys[-1], described.get(number, {"type": face.kind}))
    places = {key: place for place, key in enumerate(surfaces)}
    boundaries = [
        [[vertex_numbers[vertex] for vertex in ring] for ring in face.rings] for face in solid.faces
    ]
    semantics = {"surfaces": [*surfaces.values()], "values": [[places[key] for key in keys]]}
    return {"type": "Solid", "lod": lod, "boundaries": [boundaries], "semantics": semantics}


def describe_solid(
    sheet: Sheet,
    solid: Solid,
    figures: RoofFigures,
    vertices: Vertices,
    lod: str,
    attributes: Mapping[int, Values],
) -> Values:
    """Return a solid, the building's or a part's, whose roof surfaces have semantics of their own.

    They are slope, azimuth (degrees), and the roof part to which a surface belongs. `attributes`
    has further ones of faces.
    """
    parts, prefix = sheet.building.parts, sheet.head.prefix
    numbers = number_surfaces(solid.faces, parts)
    described: dict[int, Values] = {}
    for number, faces in group_faces(numbers).items():
        face = solid.faces[number]
        if face.kind != ROOF:
            continue
        slope, azimuth = measure_angles(figures, faces)
        described[number] = {
            "type": ROOF,
            f"{prefix}slope": plain(round_number(slope, 3)),
            f"{prefix}azimuth": plain(round_number(azimuth, 3)),
        }
        if 0 <= face.part < len(parts):
            own = {f"{OWN}part": int(face.part), f"{OWN}part_type": parts[face.part].type}
            described[number] |= own
    for number, more in join_values(attributes, numbers, figures).items():
        kind = {"type": solid.faces[number].kind}
        described[number] = described.get(number, kind) | more
    return solid_geometry(solid, vertices, lod, described, numbers)


def level_footprint(building: Building) -> shapely.Polygon | None:
    """Return the footprint without a solid, or None without one or without its height."""
    footprint = building.footprint
    if footprint is None or footprint.is_empty or not math.isfinite(building.z_ground):
        return None
    return footprint


def outline_boundaries(
    outline: shapely.Geometry, z: float, vertices: Vertices
) -> list[list[list[int]]]:
    """Return surfaces of `outline` at height `z`, outer rings counter-clockwise from above."""
    surfaces = []
    for polygon in shapely.get_parts(shapely.normalize(outline)):
        polygon = shapely.geometry.polygon.orient(polygon)
        rings = []
        for ring in (polygon.exterior, *polygon.interiors):
            xy = shapely.get_coordinates(ring)[:-1]
            rings.append(vertices.add(np.column_stack([xy, np.full(len(xy), z)])))
        surfaces.append(rings)
    return surfaces


def first_corner(building: Building) -> np.ndarray | None:
    """Return a corner (3,) of what `building_geometry` would draw, or None."""
    if building.built is not None:
        return building.solid.vertices.min(axis=0)
    footprint = level_footprint(building)
    return None if footprint is None else np.array([*footprint.bounds[:2], building.z_ground])
