"""The geometry of one building in CityGML, each function one property or surface.

`place` is each vertex' coordinates as text, `rings` each face's rings: they are made once, though a
solid is told more than once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from ...compose.settle import round_number
from ...data_files import Values
from ...frames import Units
from ...model import CEILING, GROUND, ROOF, WALL, Face, Part, Solid
from ...model.roof_figures import RoofFigures
from ..surfaces import group_faces, join_values, measure_angles, number_surfaces
from ..values import generic_attribute

ROLES = {ROOF: "roof", WALL: "wall", GROUND: "ground", CEILING: "ceiling"}


def surface_ids(faces: tuple[Face, ...], name: str, part: str = "") -> list[str]:
    """Return ids of faces' polygons by part, kind, number and, last, the building's name."""
    counts = dict.fromkeys(ROLES, 0)
    ids = []
    for face in faces:
        counts[face.kind] += 1
        ids.append(f"{ROLES[face.kind]}-{part}{counts[face.kind]}-{name}")
    return ids


def lod1_solid(solid: Solid | None, units: Units) -> str:
    """Return the GML of a block; nothing for None."""
    if solid is None:
        return ""
    members = surface_members(list_face_rings(solid.faces, units.from_metres(solid.vertices)))
    return (
        f"<bldg:lod1Solid><gml:Solid><gml:exterior><gml:CompositeSurface>{members}</gml:CompositeSurface></gml:exterior>"
        "</gml:Solid></bldg:lod1Solid>"
    )


def lod2_solid(polygon_ids: list[str], id: str) -> str:
    """Return the shell of the boundary surfaces' own polygons under its gml:id."""
    members = "".join(
        f'<gml:surfaceMember xlink:href="#poly-{polygon_id}"/>' for polygon_id in polygon_ids
    )
    return (
        f'<bldg:lod2Solid><gml:Solid gml:id="{id}"><gml:exterior><gml:CompositeSurface>{members}'
        "</gml:CompositeSurface></gml:exterior></gml:Solid></bldg:lod2Solid>"
    )


def lod2_surfaces(rings: list[str]) -> str:
    """Return the solid's surfaces by value, for readers that follow no links."""
    return f"<bldg:lod2MultiSurface>{multi_surface(rings)}</bldg:lod2MultiSurface>"


def multi_surface(rings: list[str]) -> str:
    return f"<gml:MultiSurface>{surface_members(rings)}</gml:MultiSurface>"


def surface_members(rings: list[str]) -> str:
    return "".join(
        [
            f"<gml:surfaceMember><gml:Polygon>{of_face}</gml:Polygon></gml:surfaceMember>"
            for of_face in rings
        ]
    )


def terrain_element(lines: list[np.ndarray], level: int) -> str:
    """Return the lines (m, 3) where building and terrain meet, of a level, as GML."""
    members = "".join(
        f"<gml:curveMember><gml:LineString>{position_list(positions(line))}</gml:LineString></gml:curveMember>"
        for line in lines
    )
    tag = f"bldg:lod{level}TerrainIntersection"
    return f"<{tag}><gml:MultiCurve>{members}</gml:MultiCurve></{tag}>"


def boundary_surfaces(
    solid: Solid,
    parts: Sequence[Part],
    figures: RoofFigures,
    polygon_ids: list[str],
    rings: list[str],
    attributes: dict[int, Values],
) -> list[str]:
    """Return the RoofSurfaces, WallSurfaces and GroundSurfaces of a solid.

    There is one for every face, but one for all facets of a curved one of the roof's `parts`. Roofs
    have their slope and azimuth in degrees; `attributes` has others by face.
    """
    numbers = number_surfaces(solid.faces, parts)
    values = join_values(attributes, numbers, figures)
    surfaces = []
    for number, faces in group_faces(numbers).items():
        tag, id = f"bldg:{solid.faces[number].kind}", polygon_ids[number]
        known = dict(values.get(number, {}))
        if solid.faces[number].kind == ROOF:
            angles = zip(("slope", "azimuth"), measure_angles(figures, faces), strict=True)
            known = {
                n: round_number(angle, 3) for n, angle in angles if math.isfinite(angle)
            } | known
        generic = "".join(generic_attribute(name, value) for name, value in known.items())
        members = "".join(
            f'<gml:surfaceMember><gml:Polygon gml:id="poly-{polygon_ids[face]}">{rings[face]}'
            "</gml:Polygon></gml:surfaceMember>"
            for face in faces
        )
        surfaces.append(
            f'<bldg:boundedBy><{tag} gml:id="{id}">{generic}<bldg:lod2MultiSurface>'
            f"<gml:MultiSurface>{members}</gml:MultiSurface></bldg:lod2MultiSurface></{tag}>"
            "</bldg:boundedBy>"
        )
    return surfaces


def list_face_rings(faces: Iterable[Face], xyz: np.ndarray) -> list[str]:
    """Return the rings of each of the faces over the vertices `xyz` (n, 3)."""
    place, texts = positions(xyz), []
    for face in faces:
        text = ""
        for number, ring in enumerate(face.rings):
            bound = "gml:interior" if number else "gml:exterior"
            closed = position_list([place[vertex] for vertex in (*ring, ring[0])])
            text += f"<{bound}><gml:LinearRing>{closed}</gml:LinearRing></{bound}>"
        texts.append(text)
    return texts


def position_list(place: list[str]) -> str:
    return f'<gml:posList srsDimension="3">{" ".join(place)}</gml:posList>'


def positions(xyz: np.ndarray) -> list[str]:
    """Return coordinates (n, 3) as text, to a ten-thousandth of their unit."""
    return ["%.4f %.4f %.4f" % (x, y, z) for x, y, z in (np.round(xyz, 4) + 0.0).tolist()]  # noqa: UP031
