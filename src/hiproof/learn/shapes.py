"""Real building shapes to scan: the solids of a CityJSON file that carry a CityGML roofType code."""

from __future__ import annotations

import json
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from ..errors import InputError
from ..model import GROUND, ROOF, WALL, Face, Solid

TYPE_OF_CODE = {
    "1000": "flat", "1010": "monopitch", "1030": "gable", "1040": "hip", "1050": "half_hip", "1060": "mansard",
    "1070": "pyramid", "1100": "shed", "1120": "pyramid",
}  # fmt: skip
HELD_OUT_PERCENT = 40
SMALLEST_AREA_M2 = 12.0


@dataclass(frozen=True)
class Shape:
    """One solid in world coordinates with its roof type, plan `outline`, and whether training may not see it."""

    id: str
    type: str
    solid: Solid
    outline: shapely.Geometry
    held_out: bool


def read_shapes(path: Path) -> list[Shape]:
    """The solids of a CityJSON file with a known roofType and 12 m2 or more of ground.

    All parts of a building are held out together. Raises InputError for a file that is no CityJSON.
    """
    try:
        city = json.loads(path.read_text())
        transform = city.get("transform", {"scale": (1, 1, 1), "translate": (0, 0, 0)})
        vertices = np.array(city["vertices"], float) * transform["scale"] + transform["translate"]
        objects = city["CityObjects"].items()
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"expected a CityJSON file at {path}, got: {error}; give one with roofType attributes"
        ) from error
    shapes = []
    for name, item in objects:
        type = TYPE_OF_CODE.get(str(item.get("attributes", {}).get("roofType")))
        for geometry in item.get("geometry", []):
            if type is None or geometry["type"] != "Solid":
                continue
            solid = solid_of(geometry, vertices)
            outline = ground_outline(solid)
            if outline.area >= SMALLEST_AREA_M2:
                shapes.append(Shape(name, type, solid, outline, is_held_out(item.get("parents", [name])[0])))
    return shapes


def is_held_out(building: str) -> bool:
    return zlib.crc32(building.encode()) % 100 < HELD_OUT_PERCENT


def solid_of(geometry: dict, vertices: np.ndarray) -> Solid:
    """The outer shell of a CityJSON Solid with its own vertices."""
    shell, semantics = geometry["boundaries"][0], geometry.get("semantics", {})
    surfaces, values = semantics.get("surfaces", []), semantics.get("values", [[None] * len(shell)])[0]
    used, index = np.unique([v for face in shell for ring in face for v in ring], return_inverse=True)
    local = iter(index.tolist())
    faces = []
    for face, value in zip(shell, values, strict=True):
        kind = surfaces[value]["type"] if value is not None else WALL
        rings = tuple(tuple(next(local) for _ in ring) for ring in face)
        faces.append(Face(rings, kind if kind in (ROOF, GROUND) else WALL))
    return Solid(vertices[used], tuple(faces))


def ground_outline(solid: Solid) -> shapely.Geometry:
    """Plan outline of the ground surfaces (of the roof's where there are none)."""
    faces = solid.of_kind(GROUND) or solid.of_kind(ROOF)
    rings = [solid.vertices[list(face.rings[0])][:, :2] for face in faces]
    return shapely.union_all([shapely.make_valid(shapely.Polygon(ring)) for ring in rings])
