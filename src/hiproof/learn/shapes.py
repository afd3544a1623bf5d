"""Real building shapes to scan.

They are solids of a CityJSON file with a CityGML roofType code.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from ..errors import InputError
from ..model import GROUND, ROOF, Solid
from ..primitives.catalogue import CATALOGUE
from ..read.models.cityjson import features
from ..read.models.solids import read_solids

# Types that share a code (both gables) are read as the first, the commoner one; 1120 is a pyramidal
# broach.
TYPE_OF_CODE = {CATALOGUE[name].citygml_code: name for name in reversed(CATALOGUE)} | {
    "1120": "pyramid"
}
# of the buildings: shapes are few, and a test on a fifth would tell little
HELD_OUT_SHAPES_PERCENT = 40
SMALLEST_AREA_M2 = 12.0  # m2 of ground; smaller are sheds, whose type is often wrong in the file


@dataclass(frozen=True)
class Shape:
    """One solid in world coordinates with its roof type.

    It has a plan `outline`, and tells whether training may see it.
    """

    id: str
    type: str
    solid: Solid
    outline: shapely.Geometry
    held_out: bool


def read_shapes(path: Path) -> list[Shape]:
    """Read the solids of a CityJSON file with a known roofType.

    They have 12 m2 or more of ground.

    All parts of a building are held out together. Raises InputError for a file that is no CityJSON.
    """
    solids = dict(read_solids(path))
    objects = {name: item for feature in features(path) for name, item in feature.objects.items()}
    shapes = []
    for name, solid in solids.items():
        item = objects.get(name, {})
        type = TYPE_OF_CODE.get(str(item.get("attributes", {}).get("roofType")))
        outline = ground_outline(solid)
        if type is not None and outline.area >= SMALLEST_AREA_M2:
            shapes.append(
                Shape(name, type, solid, outline, is_held_out((item.get("parents") or [name])[0]))
            )
    if not shapes:
        raise InputError(
            f"expected solids with a known roofType attribute in {path}, got none among "
            f"{len(solids)} solids"
        )
    return shapes


def is_held_out(building: str) -> bool:
    return zlib.crc32(building.encode()) % 100 < HELD_OUT_SHAPES_PERCENT


def ground_outline(solid: Solid) -> shapely.Geometry:
    """Plan outline of the ground surfaces (of the roof's where there are none)."""
    faces = solid.select_faces(GROUND) or solid.select_faces(ROOF)
    rings = [solid.vertices[list(face.rings[0])][:, :2] for face in faces]
    return shapely.union_all(
        [
            shapely.make_valid(shapely.Polygon(ring))
            for ring in rings
            if len(np.unique(ring, axis=0)) > 2
        ]
    )
