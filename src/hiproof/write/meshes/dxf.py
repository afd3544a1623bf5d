"""DXF for AutoCAD and other CAD programs: 3D faces and outlines on layers (needs ezdxf).

Layers are the kinds of surface, Outline, and BuildingId with a text over each building. Edges
between triangles of one face are invisible, so roofs are drawn as a person would draw them.

Coordinates are those of the CRS, heights too in the unit of its plan, because a drawing has one
unit. The CRS is a custom property of the drawing.
"""

from __future__ import annotations

from collections.abc import Iterable
from io import TextIOWrapper
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ...extras import import_extra
from ...model import CEILING, GROUND, ROOF, WALL
from ..colours import GROUND_COLOUR, ROOF_COLOURS, WALL_COLOUR
from ..naming import PlacedNames, make_uuid
from .triangles import faces_triangles
from .viewed import ViewedModel

DXF_VERSION = "R2010"  # the first with all that is used here; AutoCAD 2010 and later read it
OUTLINE_LAYER, BUILDING_ID_LAYER = "Outline", "BuildingId"
# The colour of each layer; None is white on a dark background and black on a light one.
LAYERS = {
    ROOF: ROOF_COLOURS["gable"],
    WALL: WALL_COLOUR,
    GROUND: GROUND_COLOUR,
    CEILING: GROUND_COLOUR,
    OUTLINE_LAYER: None,
    BUILDING_ID_LAYER: None,
}

DRAWING_UNITS = {"metre": 6, "foot": 2, "US survey foot": 21}  # $INSUNITS; 0 is no unit
INVISIBLE_EDGES = (1, 2, 8)  # bits of a 3DFACE whose fourth corner is its third
TEXT_HEIGHT_M = 0.5  # of ids: legible beside a house on a plan at 1:500


def write_models(path: Path, buildings: Iterable[ViewedModel], crs: str | None = None) -> int:
    """Write `buildings` to `path`; returns how many.

    The drawing is made in memory. Attributes other than the id have no place in it. Raises
    InputError where ezdxf is missing, OutputError when the file cannot be written.
    """
    from ..files import atomic_file

    document, unit_m = start_drawing(import_extra("ezdxf", "dxf", "DXF"), crs)
    space, count = document.modelspace(), 0
    for model in buildings:
        if not count:  # names of drawings are kept by other programs
            town = PlacedNames(crs).name_square(model.corner)
            document.header["$FINGERPRINTGUID"] = f"{{{make_uuid('drawing', town)}}}".upper()
        draw_building(space, model, unit_m)
        count += 1
    with atomic_file(path) as file:
        text = TextIOWrapper(file, encoding="utf-8", errors="dxfreplace", newline="\r\n")
        document.write(text)
        text.detach()
    return count


def start_drawing(ezdxf: Any, crs: str | None) -> tuple[Any, float]:
    """Return an empty drawing with its layers, and metres in one unit of it."""
    from pyproj import CRS

    from ...frames import Units
    from ...read.crs import find_units

    units = Units() if crs is None else find_units(CRS(crs))
    document = ezdxf.new(DXF_VERSION)
    document.header["$INSUNITS"] = DRAWING_UNITS.get(units.plan_name, 0)
    if crs is not None:
        document.header.custom_vars.append("CRS", crs)
    for name, colour in LAYERS.items():
        document.layers.add(name, true_color=colour and int(colour[1:], 16))
    return document, units.plan


def draw_building(space: Any, model: ViewedModel, unit_m: float) -> None:
    """Draw the faces, the outlines and the id of a building."""
    solid = model.solid
    places = solid.vertices / unit_m
    for face, triangles in zip(
        solid.faces, faces_triangles(solid.vertices, solid.faces), strict=True
    ):
        pairs = {pair for ring in face.rings for pair in pairwise((*ring, ring[0]))}
        edges = pairs | {(b, a) for a, b in pairs}
        for a, b, c in triangles.tolist():
            sides = zip(INVISIBLE_EDGES, ((a, b), (b, c), (c, a)), strict=True)
            hidden = sum(bit for bit, side in sides if side not in edges)
            space.add_3dface(
                places[[a, b, c]], dxfattribs={"layer": face.kind, "invisible_edges": hidden}
            )
    ground = shapely.union_all([solid.project_face(face) for face in solid.select_faces(GROUND)])
    elevation = float(places[:, 2].min())
    for polygon in shapely.get_parts(ground):
        for ring in (polygon.exterior, *polygon.interiors):
            space.add_lwpolyline(
                np.array(ring.coords)[:-1, :2] / unit_m,
                close=True,
                dxfattribs={"layer": OUTLINE_LAYER, "elevation": elevation},
            )
    attributes = {"layer": BUILDING_ID_LAYER, "height": TEXT_HEIGHT_M / unit_m}
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    space.add_text(" ".join(model.id.split()), dxfattribs=attributes).set_placement(
        (*middle[:2], places[:, 2].max())
    )
