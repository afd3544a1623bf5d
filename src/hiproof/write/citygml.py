"""CityGML 2.0: a streamed CityModel of LoD2 buildings.

Each building becomes one piece of text, written and dropped, so a city needs no more memory than a street. The
envelope stands before the buildings but is known only after them: its place is left blank and filled in at the end.
All ids in the text are names by XML's rules already; what comes from outside is escaped where it enters.
"""

from __future__ import annotations

import datetime
import math
import os
from collections.abc import Iterable
from contextlib import ExitStack
from typing import Any

import numpy as np

from ..frames import METRES, Units
from ..model import GROUND, ROOF, WALL, Building, Face
from .building_attributes import PREFIX, building_attributes, figures_of, ground_height, rounded
from .fragments import Fragment, Sheet
from .head import FileHead
from .naming import FileUnits, UniqueNames, gml_name, srs_name
from .roof_codes import roof_type_code
from .roof_figures import RoofFigures
from .writer import BuildingWriter
from .xml_text import xml_attribute, xml_text

NAMESPACES = {
    "bldg": "http://www.opengis.net/citygml/building/2.0",
    "core": "http://www.opengis.net/citygml/2.0",
    "gen": "http://www.opengis.net/citygml/generics/2.0",
    "gml": "http://www.opengis.net/gml",
    "xlink": "http://www.w3.org/1999/xlink",
}
ROOF_TYPE_CODES = "http://www.sig3d.org/codelists/standard/building/2.0/_AbstractBuilding_roofType.xml"
GENERIC = {int: "gen:intAttribute", float: "gen:doubleAttribute", str: "gen:stringAttribute"}
ROLES = {ROOF: "roof", WALL: "wall", GROUND: "ground"}
WIDEST = -123456789.1234


def write_citygml(
    path: str | os.PathLike,
    buildings: Iterable[Building],
    crs: Any = None,
    prefix: str = PREFIX,
    creation_date: datetime.date | None = None,
) -> None:
    """Write `buildings` (solids in world metres) to `path` as CityGML 2.0, LoD 2.

    `crs` is anything pyproj understands or None; `prefix` goes before roofer's attribute names; `creation_date` is
    written on every building if given (never taken from a clock, so that the same input gives the same file). A
    building without a solid is written without geometry. Coordinates are written in the unit of `crs`. Raises OutputError when the file cannot be written.
    """
    with CityGMLWriter(path, crs, prefix, creation_date) as writer:
        for building in buildings:
            writer.add(building)


class CityGMLWriter(BuildingWriter):
    """Incremental form of `write_citygml`."""

    namespaces, root_id = NAMESPACES, ""

    def __init__(
        self,
        path: str | os.PathLike,
        crs: Any = None,
        prefix: str = PREFIX,
        creation_date: datetime.date | None = None,
        units: Units | None = None,
    ) -> None:
        super().__init__(path)
        self.srs_name, self.units = srs_name(crs), FileUnits.of(crs, units).gml
        self.prefix, self.creation_date = prefix, creation_date
        self.low, self.high = np.full(3, np.inf), np.full(3, -np.inf)
        self.names = UniqueNames()

    def begin(self, stack: ExitStack) -> None:
        declared = " ".join(f'xmlns:{prefix}="{uri}"' for prefix, uri in self.namespaces.items())
        self.file.write(f"<?xml version='1.0' encoding='utf-8'?>\n<core:CityModel {declared}{self.root_id}>\n".encode())
        self.envelope_at = self.file.tell()
        self.envelope_length = len(self.envelope(np.full(3, WIDEST), np.full(3, WIDEST)))
        self.file.write(b" " * self.envelope_length)

    def add(self, building: Building, figures: RoofFigures | None = None) -> None:
        figures = figures or figures_of(building)
        attributes = building_attributes(building, figures, self.prefix, self.units)
        name = self.names.take(gml_name(building.id))
        self.add_member(gml_member(building, figures, attributes, name, self.units, self.creation_date))

    def add_member(self, member: Fragment) -> None:
        """Write a building, told in CityGML 2.0."""
        self.put(member)

    def put(self, fragment: Fragment) -> None:
        if fragment.extent is not None:
            self.low = np.minimum(self.low, fragment.extent[:3])
            self.high = np.maximum(self.high, fragment.extent[3:])
        self.file.write(b"\n" + fragment.text)

    def finish(self) -> None:
        self.file.write(b"\n</core:CityModel>")
        if np.isfinite(self.low).all():
            end = self.file.tell()
            self.file.seek(self.envelope_at)
            self.file.write(self.envelope(self.low, self.high).ljust(self.envelope_length))
            self.file.seek(end)

    def envelope(self, low: np.ndarray, high: np.ndarray) -> bytes:
        srs = "" if self.srs_name is None else f' srsName="{xml_attribute(self.srs_name)}"'
        lower, upper = positions(np.array([low, high]))
        return (
            f'<gml:boundedBy><gml:Envelope srsDimension="3"{srs}><gml:lowerCorner>{lower}</gml:lowerCorner>'
            f"<gml:upperCorner>{upper}</gml:upperCorner></gml:Envelope></gml:boundedBy>"
        ).encode()


def writer(path: str | os.PathLike, head: FileHead) -> CityGMLWriter:
    """The writer of a run's file."""
    return CityGMLWriter(path, head.crs)


def fragment(sheet: Sheet) -> Fragment:
    """A building's part of a run's file."""
    return gml_member(sheet.building, sheet.figures, sheet.attributes, sheet.gml_name, sheet.head.units.gml)


def gml_member(
    building: Building,
    figures: RoofFigures | None,
    attributes: dict[str, Any],
    name: str,
    units: Units = METRES,
    creation_date: datetime.date | None = None,
) -> Fragment:
    """The cityObjectMember of `building`, whose gml:ids end in `name`; the root's namespaces are taken as declared."""
    text = city_object_member(building, figures, attributes, name, units, creation_date)
    lines = terrain_lines(building, units)
    if figures is not None:
        lines = [*lines, units.from_metres(building.solid.vertices)]
    if not lines:
        return Fragment(text.encode())
    xyz = np.concatenate(lines)
    return Fragment(text.encode(), (*xyz.min(axis=0).tolist(), *xyz.max(axis=0).tolist()))


def city_object_member(
    building: Building,
    figures: RoofFigures | None,
    attributes: dict[str, Any],
    name: str,
    units: Units,
    creation_date: datetime.date | None = None,
) -> str:
    """One bldg:Building, its children in the schema's order; all its gml:ids end in `name`, unique in the file."""
    text = [f'<core:cityObjectMember><bldg:Building gml:id="bldg-{name}"><gml:name>{xml_text(building.id)}</gml:name>']
    if creation_date is not None:
        text.append(f"<core:creationDate>{creation_date.isoformat()}</core:creationDate>")
    text += [generic_attribute(key, value) for key, value in attributes.items()]
    code = roof_type_code(building)
    if code is not None:
        text.append(f'<bldg:roofType codeSpace="{ROOF_TYPE_CODES}">{code}</bldg:roofType>')
    polygon_ids = [] if figures is None else surface_ids(building.solid.faces, name)
    if figures is not None:
        height = figures.h_max - min(ground_height(building, figures), figures.h_base)
        text.append(f'<bldg:measuredHeight uom="m">{height:.4f}</bldg:measuredHeight>')
        text.append(solid_text(polygon_ids, name))
    text.append(terrain_intersection(terrain_lines(building, units)))
    if figures is not None:
        text += boundary_surfaces(building, figures, polygon_ids, units)
    text.append("</bldg:Building></core:cityObjectMember>")
    return "".join(text)


def generic_attribute(name: str, value: Any) -> str:
    """A gen:*Attribute of the value's kind; None is left out."""
    if value is None:
        return ""
    tag = GENERIC.get(type(value), GENERIC[str])
    text = str(value).lower() if isinstance(value, bool) else xml_text(value)
    return f'<{tag} name="{xml_attribute(name)}"><gen:value>{text}</gen:value></{tag}>'


def surface_ids(faces: tuple[Face, ...], name: str) -> list[str]:
    """Each face's polygon named by kind and number; the building's name comes last, so that no two names meet."""
    counts = dict.fromkeys(ROLES, 0)
    ids = []
    for face in faces:
        counts[face.kind] += 1
        ids.append(f"{ROLES[face.kind]}-{counts[face.kind]}-{name}")
    return ids


def solid_text(polygon_ids: list[str], name: str) -> str:
    """The closed shell, made of the boundary surfaces' own polygons."""
    members = "".join(f'<gml:surfaceMember xlink:href="#poly-{polygon_id}"/>' for polygon_id in polygon_ids)
    return (
        f'<bldg:lod2Solid><gml:Solid gml:id="solid-{name}"><gml:exterior><gml:CompositeSurface>{members}'
        "</gml:CompositeSurface></gml:exterior></gml:Solid></bldg:lod2Solid>"
    )


def terrain_lines(building: Building, units: Units) -> list[np.ndarray]:
    """The terrain intersection's lines (m, 3) in `units` that are lines: two points at least, all known."""
    lines = (line for line in building.terrain_intersection if len(line) > 1 and np.isfinite(line).all())
    return [units.from_metres(line) for line in lines]


def terrain_intersection(lines: list[np.ndarray]) -> str:
    """The lines (m, 3) along which the building meets the terrain."""
    if not lines:
        return ""
    members = "".join(
        f"<gml:curveMember><gml:LineString>{position_list(positions(line))}</gml:LineString></gml:curveMember>"
        for line in lines
    )
    return f"<bldg:lod2TerrainIntersection><gml:MultiCurve>{members}</gml:MultiCurve></bldg:lod2TerrainIntersection>"


def boundary_surfaces(building: Building, figures: RoofFigures, polygon_ids: list[str], units: Units) -> list[str]:
    """A RoofSurface, WallSurface or GroundSurface for every face; roofs say their slope and azimuth in degrees."""
    place = positions(units.from_metres(building.solid.vertices))
    surfaces = []
    for index, (face, polygon_id) in enumerate(zip(building.solid.faces, polygon_ids, strict=True)):
        tag = f"bldg:{face.kind}"
        angles = angle_attributes(figures, index) if face.kind == ROOF else ""
        surfaces.append(
            f'<bldg:boundedBy><{tag} gml:id="{polygon_id}">{angles}<bldg:lod2MultiSurface><gml:MultiSurface>'
            f'<gml:surfaceMember><gml:Polygon gml:id="poly-{polygon_id}">{polygon_rings(face, place)}</gml:Polygon>'
            f"</gml:surfaceMember></gml:MultiSurface></bldg:lod2MultiSurface></{tag}></bldg:boundedBy>"
        )
    return surfaces


def angle_attributes(figures: RoofFigures, index: int) -> str:
    """Slope and azimuth of roof face `index`, as far as they are known."""
    angles = {"slope": figures.face_slope_deg[index], "azimuth": figures.face_azimuth_deg[index]}
    return "".join(generic_attribute(key, rounded(angle, 3)) for key, angle in angles.items() if math.isfinite(angle))


def polygon_rings(face: Face, place: list[str]) -> str:
    """The rings of a face, `place` being the vertices' coordinates as text."""
    text = ""
    for number, ring in enumerate(face.rings):
        bound = "gml:interior" if number else "gml:exterior"
        closed = position_list([place[vertex] for vertex in (*ring, ring[0])])
        text += f"<{bound}><gml:LinearRing>{closed}</gml:LinearRing></{bound}>"
    return text


def position_list(place: list[str]) -> str:
    return f'<gml:posList srsDimension="3">{" ".join(place)}</gml:posList>'


def positions(xyz: np.ndarray) -> list[str]:
    """Each of the coordinates (n, 3) as text, to a ten-thousandth of their unit."""
    return ["%.4f %.4f %.4f" % (x, y, z) for x, y, z in (np.round(xyz, 4) + 0.0).tolist()]  # noqa: UP031
