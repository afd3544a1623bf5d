"""CityGML 2.0: a streamed CityModel of LoD2 buildings.

Each building is built as one small tree, written and dropped, so a city needs no more memory than a street. The
envelope stands before the buildings but is known only after them: its place is left blank and filled in at the end.
"""

from __future__ import annotations

import datetime
import math
import os
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from lxml import etree

from ..model import GROUND, ROOF, WALL, Building, Face
from .building_attributes import PREFIX, building_attributes, figures_of, ground_height, rounded
from .naming import UniqueNames, gml_name, srs_name, xml_text
from .roof_codes import roof_type_code
from .roof_figures import RoofFigures
from .writer import BuildingWriter

NAMESPACES = {
    "core": "http://www.opengis.net/citygml/2.0",
    "bldg": "http://www.opengis.net/citygml/building/2.0",
    "gen": "http://www.opengis.net/citygml/generics/2.0",
    "gml": "http://www.opengis.net/gml",
    "xlink": "http://www.w3.org/1999/xlink",
}
CORE, BLDG, GEN, GML, XLINK = (f"{{{uri}}}" for uri in NAMESPACES.values())
ROOF_TYPE_CODES = "http://www.sig3d.org/codelists/standard/building/2.0/_AbstractBuilding_roofType.xml"
GENERIC = {int: f"{GEN}intAttribute", float: f"{GEN}doubleAttribute", str: f"{GEN}stringAttribute"}
GENERIC_VALUE = f"{GEN}value"
ROLES = {ROOF: "roof", WALL: "wall", GROUND: "ground"}
WIDEST = -123456789.1234
# lxml declares all namespaces again on every building's element; the root's declarations are enough
OPENING = b"<core:cityObjectMember"


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
    building without a solid is written without geometry. Raises OutputError when the file cannot be written.
    """
    with CityGMLWriter(path, crs, prefix, creation_date) as writer:
        for building in buildings:
            writer.add(building)


class CityGMLWriter(BuildingWriter):
    """Incremental form of `write_citygml`."""

    def __init__(
        self,
        path: str | os.PathLike,
        crs: Any = None,
        prefix: str = PREFIX,
        creation_date: datetime.date | None = None,
    ) -> None:
        super().__init__(path)
        self.srs_name = srs_name(crs)
        self.prefix, self.creation_date = prefix, creation_date
        self.low, self.high = np.full(3, np.inf), np.full(3, -np.inf)
        self.names = UniqueNames()

    def begin(self, stack: ExitStack) -> None:
        self.xml = stack.enter_context(etree.xmlfile(self.file, encoding="utf-8"))
        self.xml.write_declaration()
        stack.enter_context(self.xml.element(f"{CORE}CityModel", nsmap=NAMESPACES))
        self.xml.write("\n")
        self.xml.flush()
        self.envelope_at = self.file.tell()
        self.envelope_length = len(self.envelope(np.full(3, WIDEST), np.full(3, WIDEST)))
        self.file.write(b" " * self.envelope_length)

    def add(self, building: Building, figures: RoofFigures | None = None) -> None:
        figures = figures or figures_of(building)
        attributes = building_attributes(building, figures, self.prefix)
        name = self.names.take(gml_name(building.id))
        self.put(gml_member(building, figures, attributes, name, self.creation_date))

    def put(self, member: Member) -> None:
        """Write a building that `gml_member` made, here or in another process."""
        self.low, self.high = np.minimum(self.low, member.low), np.maximum(self.high, member.high)
        self.xml.flush()
        self.file.write(b"\n" + member.text)

    def finish(self) -> None:
        self.xml.write("\n")
        self.xml.flush()
        if np.isfinite(self.low).all():
            end = self.file.tell()
            self.file.seek(self.envelope_at)
            self.file.write(self.envelope(self.low, self.high).ljust(self.envelope_length))
            self.file.seek(end)

    def envelope(self, low: np.ndarray, high: np.ndarray) -> bytes:
        bounded_by = etree.Element(f"{GML}boundedBy", nsmap={"gml": NAMESPACES["gml"]})
        attributes = {} if self.srs_name is None else {"srsName": self.srs_name}
        box = etree.SubElement(bounded_by, f"{GML}Envelope", attributes, srsDimension="3")
        etree.SubElement(box, f"{GML}lowerCorner").text = " ".join(positions(low[None]))
        etree.SubElement(box, f"{GML}upperCorner").text = " ".join(positions(high[None]))
        return etree.tostring(bounded_by)


@dataclass(frozen=True)
class Member:
    """One building as XML text, and its extent (3,) in world metres; infinite and reversed where it has none."""

    text: bytes
    low: np.ndarray
    high: np.ndarray


def gml_member(
    building: Building,
    figures: RoofFigures | None,
    attributes: dict[str, Any],
    name: str,
    creation_date: datetime.date | None = None,
) -> Member:
    """The cityObjectMember of `building`, whose gml:ids end in `name`; the root's namespaces are taken as declared."""
    element = city_object_member(building, figures, attributes, name, creation_date)
    text = etree.tostring(element, encoding="utf-8", xml_declaration=False)
    lines = terrain_lines(building)
    if figures is not None:
        lines = [*lines, building.solid.vertices]
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for line in lines:
        low, high = np.minimum(low, line.min(axis=0)), np.maximum(high, line.max(axis=0))
    return Member(OPENING + text[text.index(b">") :], low, high)


def city_object_member(
    building: Building,
    figures: RoofFigures | None,
    attributes: dict[str, Any],
    name: str,
    creation_date: datetime.date | None = None,
) -> etree._Element:
    """One bldg:Building, its children in the schema's order; all its gml:ids end in `name`, unique in the file."""
    member = etree.Element(f"{CORE}cityObjectMember", nsmap=NAMESPACES)
    element = etree.SubElement(member, f"{BLDG}Building", {f"{GML}id": f"bldg-{name}"})
    etree.SubElement(element, f"{GML}name").text = xml_text(building.id)
    if creation_date is not None:
        etree.SubElement(element, f"{CORE}creationDate").text = creation_date.isoformat()
    for key, value in attributes.items():
        add_generic_attribute(element, key, value)
    code = roof_type_code(building)
    if code is not None:
        etree.SubElement(element, f"{BLDG}roofType", codeSpace=ROOF_TYPE_CODES).text = code
    if figures is not None:
        height = figures.h_max - min(ground_height(building, figures), figures.h_base)
        etree.SubElement(element, f"{BLDG}measuredHeight", uom="m").text = f"{height:.4f}"
        polygon_ids = surface_ids(building.solid.faces, name)
        add_solid(element, polygon_ids, name)
    add_terrain_intersection(element, terrain_lines(building))
    if figures is not None:
        add_boundary_surfaces(element, building, figures, polygon_ids)
    return member


def add_generic_attribute(element: etree._Element, name: str, value: Any) -> None:
    """A gen:*Attribute of the value's kind; None is left out."""
    if value is None:
        return
    text = str(value).lower() if isinstance(value, bool) else xml_text(value)
    attribute = etree.SubElement(element, GENERIC.get(type(value), GENERIC[str]), name=xml_text(name))
    etree.SubElement(attribute, GENERIC_VALUE).text = text


def surface_ids(faces: tuple[Face, ...], name: str) -> list[str]:
    """Each face's polygon named by kind and number; the building's name comes last, so that no two names meet."""
    counts = dict.fromkeys(ROLES, 0)
    ids = []
    for face in faces:
        counts[face.kind] += 1
        ids.append(f"{ROLES[face.kind]}-{counts[face.kind]}-{name}")
    return ids


def add_solid(element: etree._Element, polygon_ids: list[str], name: str) -> None:
    """The closed shell, made of the boundary surfaces' own polygons."""
    lod2 = etree.SubElement(element, f"{BLDG}lod2Solid")
    solid = etree.SubElement(lod2, f"{GML}Solid", {f"{GML}id": f"solid-{name}"})
    exterior = etree.SubElement(solid, f"{GML}exterior")
    shell = etree.SubElement(exterior, f"{GML}CompositeSurface")
    for polygon_id in polygon_ids:
        etree.SubElement(shell, f"{GML}surfaceMember", {f"{XLINK}href": f"#poly-{polygon_id}"})


def terrain_lines(building: Building) -> list[np.ndarray]:
    """The terrain intersection's lines (m, 3) that are lines: two points at least, all known."""
    return [line for line in building.terrain_intersection if len(line) > 1 and np.isfinite(line).all()]


def add_terrain_intersection(element: etree._Element, lines: list[np.ndarray]) -> None:
    """The lines (m, 3) along which the building meets the terrain."""
    if not lines:
        return
    lod2 = etree.SubElement(element, f"{BLDG}lod2TerrainIntersection")
    curves = etree.SubElement(lod2, f"{GML}MultiCurve")
    for line in lines:
        curve = etree.SubElement(curves, f"{GML}curveMember")
        add_positions(etree.SubElement(curve, f"{GML}LineString"), positions(line))


def add_boundary_surfaces(
    element: etree._Element, building: Building, figures: RoofFigures, polygon_ids: list[str]
) -> None:
    """A RoofSurface, WallSurface or GroundSurface for every face; roofs say their slope and azimuth in degrees."""
    place = positions(building.solid.vertices)
    for index, (face, polygon_id) in enumerate(zip(building.solid.faces, polygon_ids, strict=True)):
        bounded_by = etree.SubElement(element, f"{BLDG}boundedBy")
        surface = etree.SubElement(bounded_by, f"{BLDG}{face.kind}", {f"{GML}id": polygon_id})
        if face.kind == ROOF:
            for key, angle in (("slope", figures.face_slope_deg[index]), ("azimuth", figures.face_azimuth_deg[index])):
                if math.isfinite(angle):
                    add_generic_attribute(surface, key, rounded(angle, 3))
        lod2 = etree.SubElement(surface, f"{BLDG}lod2MultiSurface")
        member = etree.SubElement(etree.SubElement(lod2, f"{GML}MultiSurface"), f"{GML}surfaceMember")
        polygon = etree.SubElement(member, f"{GML}Polygon", {f"{GML}id": f"poly-{polygon_id}"})
        for number, ring in enumerate(face.rings):
            bound = etree.SubElement(polygon, f"{GML}interior" if number else f"{GML}exterior")
            closed = [place[vertex] for vertex in (*ring, ring[0])]
            add_positions(etree.SubElement(bound, f"{GML}LinearRing"), closed)


def add_positions(element: etree._Element, place: list[str]) -> None:
    etree.SubElement(element, f"{GML}posList", srsDimension="3").text = " ".join(place)


def positions(xyz: np.ndarray) -> list[str]:
    """Each of the coordinates (n, 3) as text, to a tenth of a millimetre."""
    return ["%.4f %.4f %.4f" % (x, y, z) for x, y, z in (np.round(xyz, 4) + 0.0).tolist()]  # noqa: UP031
