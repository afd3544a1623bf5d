"""CityGML 2.0: a streamed CityModel of LoD2 buildings.

Each building becomes one piece of text, written and dropped, so a city needs no more memory than a
street. The envelope stands before the buildings but is known only after them: its place is left
blank and filled in at the end. All ids in the text are names by XML's rules already; what comes
from outside is escaped where it enters.
"""

from __future__ import annotations

import datetime
import os
from collections.abc import Iterable
from contextlib import ExitStack
from typing import Any

import numpy as np

from ...model import GROUND, Building, Face, Solid
from ...model.roof_figures import RoofFigures, find_ground_height
from ...primitives.catalogue import CATALOGUE
from ...settings import WriteSettings
from ..building_attributes import OWN, PREFIX
from ..fragments import Fragment, Sheet
from ..head import FileHead
from ..naming import FUNCTION_SPACE, FUNCTIONS, srs_name
from ..shapes import PartShape
from ..values import WIDEST, format_attribute_set, generic_attribute, xml_attribute, xml_text
from ..writer import BuildingWriter
from .surfaces import (
    boundary_surfaces,
    list_face_rings,
    lod1_solid,
    lod2_solid,
    lod2_surfaces,
    multi_surface,
    positions,
    surface_ids,
    surface_members,
    terrain_element,
)

CODE_SPACES = {
    "sig3d": "http://www.sig3d.org/codelists/standard/building/2.0/_AbstractBuilding_roofType.xml",
    "adv": "https://repository.gdi-de.org/schemas/adv/citygml/Codelisten/RoofTypeTypeAdV.xml",
}
# Roofs of several forms, and of a form that the list does not know.
MIXED = {"sig3d": "1130", "adv": "5000"}


def roof_type_code(types: Iterable[str], code_list: str = "sig3d") -> str:
    """Return the code that roof parts of `types` have in common, else that of a mixed roof.

    >>> roof_type_code(["gable", "asymmetric_gable"]), roof_type_code(["gable",
    ...     "hip"]), roof_type_code(["hip"], "adv")
    ('1030', '1130', '3200')
    """
    field = "citygml_code" if code_list == "sig3d" else "adv_code"
    codes = {getattr(CATALOGUE.get(name), field, MIXED[code_list]) for name in types}
    return codes.pop() if len(codes) == 1 else MIXED[code_list]


NAMESPACES = {
    "bldg": "http://www.opengis.net/citygml/building/2.0",
    "core": "http://www.opengis.net/citygml/2.0",
    "gen": "http://www.opengis.net/citygml/generics/2.0",
    "gml": "http://www.opengis.net/gml",
    "xlink": "http://www.w3.org/1999/xlink",
}


def write_citygml(
    path: str | os.PathLike[str],
    buildings: Iterable[Building],
    crs: Any = None,
    prefix: str = PREFIX,
    creation_date: datetime.date | None = None,
    write: WriteSettings | None = None,
) -> None:
    """Write `buildings` (solids in world metres) to `path` as CityGML 2.0, LoD 2.

    `crs` is anything pyproj understands or None; `prefix` goes before roofer's attribute names;
    `creation_date` is written on every building if given (never taken from a clock, so that the
    same input gives the same file); `write` says what is drawn of a building. A building without a
    solid is written without geometry. Coordinates are written in the unit of `crs`. Raises
    OutputError when the file cannot be written.
    """
    head = FileHead(crs, write=write or WriteSettings(), prefix=prefix, creation_date=creation_date)
    CityGMLWriter(path, head).add_all(buildings)


class CityGMLWriter(BuildingWriter):
    """Incremental form of `write_citygml`."""

    namespaces, root_id = NAMESPACES, ""

    def __init__(self, path: str | os.PathLike[str], head: FileHead) -> None:
        super().__init__(path, head)
        self.srs_name = srs_name(self.head.crs_of_files)

    def begin(self, stack: ExitStack) -> None:
        declared = " ".join(f'xmlns:{prefix}="{uri}"' for prefix, uri in self.namespaces.items())
        self.file.write(
            "<?xml version='1.0' encoding='utf-8'?>\n<core:CityModel "
            f"{declared}{self.root_id}>\n".encode()
        )
        self.envelope_at = self.file.tell()
        self.envelope_length = len(self.envelope(np.full(3, WIDEST), np.full(3, WIDEST)))
        self.file.write(b" " * self.envelope_length)

    @staticmethod
    def fragment(sheet: Sheet) -> Fragment:
        """Return a cityObjectMember with ids that end in its name, namespaces as declared."""
        text = f"<core:cityObjectMember>{building_element(sheet)}</core:cityObjectMember>".encode()
        lines = terrain_lines(sheet)
        if sheet.figures is not None:
            solid, _ = choose_solid(sheet) or (sheet.building.solid, None)
            lines += [in_file(sheet, solid) for solid in (solid, *sheet.boxes)]
            lines += [undo_shift(sheet)] if sheet.shapes.outline is not None else []
        if not lines:
            return Fragment(text)
        xyz = np.concatenate(lines)
        return Fragment(text, (*xyz.min(axis=0).tolist(), *xyz.max(axis=0).tolist()))

    def put(self, fragment: Fragment) -> None:
        self.extend(fragment)
        self.file.write(b"\n" + fragment.text)

    def finish(self) -> None:
        self.file.write(b"\n</core:CityModel>")
        if np.isfinite(self.low).all():
            end = self.file.tell()
            self.file.seek(self.envelope_at)
            self.file.write(self.envelope(self.low, self.high).ljust(self.envelope_length))
            self.file.seek(end)

    def envelope(self, low_value: np.ndarray, high_value: np.ndarray) -> bytes:
        srs = "" if self.srs_name is None else f' srsName="{xml_attribute(self.srs_name)}"'
        lower, upper = positions(np.array([low_value, high_value]))
        return (
            "<gml:boundedBy><gml:Envelope "
            f'srsDimension="3"{srs}><gml:lowerCorner>{lower}</gml:lowerCorner>'
            f"<gml:upperCorner>{upper}</gml:upperCorner></gml:Envelope></gml:boundedBy>"
        ).encode()


writer = CityGMLWriter


def building_element(sheet: Sheet) -> str:
    """Return one bldg:Building, its children in the schema's order, ids ending in its name."""
    building, figures, name, write = sheet.building, sheet.figures, sheet.gml_name, sheet.head.write
    text = [f'<bldg:Building gml:id="bldg-{name}"><gml:name>{xml_text(building.id)}</gml:name>']
    change = building.change or {}
    dates = {
        "creationDate": sheet.head.creation_date or change.get("valid_from"),
        "terminationDate": change.get("valid_to"),
    }
    text += [f"<core:{date}>{value}</core:{date}>" for date, value in dates.items() if value]
    text += [generic_attribute(key, value) for key, value in sheet.attributes.items()]
    if figures is not None:
        types = [
            part.type
            for part, area in zip(building.parts, building.model.visible_m2, strict=True)
            if area > 0.0
        ]
        text.append(
            format_roof_and_height(types, figures, find_ground_height(building, figures), write)
        )
        text.append(level_surfaces(sheet))
        text.append(lod1_solid(sheet.shapes.lod13 or sheet.shapes.lod12, sheet.head.units.gml))
    shell, rings, surfaces = "", [], []
    if drawn := choose_solid(sheet):
        solid, of_solid = drawn
        ids = surface_ids(solid.faces, name)
        shell, rings = lod2_solid(ids, f"solid-{name}"), list_rings(sheet, solid)
        more = sheet.surfaces if solid is building.solid else {}
        surfaces = boundary_surfaces(solid, building.parts, of_solid, ids, rings, more)
    text += [with_terrain(sheet, shell, rings), *installation_elements(sheet), *surfaces]
    text += [part_element(sheet, number, part) for number, part in enumerate(sheet.shapes.parts, 1)]
    return "".join([*text, sheet.extension, "</bldg:Building>"])


def installation_elements(sheet: Sheet) -> list[str]:
    """Return the bldg:BuildingInstallation of every object on the roof."""
    elements = []
    for number, box in enumerate(sheet.boxes):
        members = surface_members(list_rings(sheet, box))
        code = FUNCTIONS[sheet.building.model.installations[number].type]
        elements.append(
            "<bldg:outerBuildingInstallation><bldg:BuildingInstallation "
            f'gml:id="installation-{number + 1}-{sheet.gml_name}">'
            f'<bldg:function codeSpace="{FUNCTION_SPACE}">{code}</bldg:function>'
            f"<bldg:lod2Geometry><gml:Solid><gml:exterior><gml:CompositeSurface>{members}"
            "</gml:CompositeSurface></gml:exterior></gml:Solid></bldg:lod2Geometry>"
            "</bldg:BuildingInstallation></bldg:outerBuildingInstallation>"
        )
    return elements


def part_element(sheet: Sheet, number: int, part: PartShape) -> str:
    """Return one bldg:BuildingPart with its solid; ids have its number before the name."""
    name, ground = f"{number}-{sheet.gml_name}", find_ground_height(sheet.building, sheet.figures)
    sets = part.attributes.get(f"{OWN}primitives", [])
    text = [f'<bldg:consistsOfBuildingPart><bldg:BuildingPart gml:id="part-{name}">']
    text += [
        generic_attribute(key, value)
        for key, value in part.attributes.items()
        if not isinstance(value, list)
    ]
    text += [format_attribute_set(f"{OWN}primitive_{k}", values) for k, values in enumerate(sets)]
    text.append(format_roof_and_height(part.types, part.figures, ground, sheet.head.write))
    text.append(lod1_solid(part.block, sheet.head.units.gml))
    if "2.2" in sheet.head.write.lods:
        ids = surface_ids(part.solid.faces, sheet.gml_name, f"{number}.")
        text.append(lod2_solid(ids, f"shell-{name}"))
        rings = list_rings(sheet, part.solid)
        text += [lod2_surfaces(rings)] if sheet.head.write.gml_surfaces else []
        text += boundary_surfaces(part.solid, sheet.building.parts, part.figures, ids, rings, {})
    return "".join([*text, "</bldg:BuildingPart></bldg:consistsOfBuildingPart>"])


def format_roof_and_height(
    types: Iterable[str], figures: RoofFigures, z_ground: float, write: WriteSettings
) -> str:
    """Return roofType, if any, and measuredHeight over the ground."""
    roof = ""
    if types:
        code, space = roof_type_code(types, write.roof_codes), CODE_SPACES[write.roof_codes]
        roof = f'<bldg:roofType codeSpace="{space}">{code}</bldg:roofType>'
    height = figures.h_max - min(z_ground, figures.h_base)
    return f'{roof}<bldg:measuredHeight uom="m">{height:.4f}</bldg:measuredHeight>'


def level_surfaces(sheet: Sheet) -> str:
    """Return footprint and roof edge (LoD0), where requested."""
    shapes = sheet.shapes
    if shapes.outline is None:
        return ""
    solid = sheet.building.model.on_one_level
    upward = Face(tuple(ring[::-1] for ring in shapes.outline.rings), GROUND)
    edge_xyz = sheet.head.units.gml.from_metres(shapes.edge_vertices(solid))
    surface, edge = (
        multi_surface(list_face_rings((upward,), xyz)) for xyz in (undo_shift(sheet), edge_xyz)
    )
    return (
        f"<bldg:lod0FootPrint>{surface}</bldg:lod0FootPrint>"
        f"<bldg:lod0RoofEdge>{edge}</bldg:lod0RoofEdge>"
    )


def undo_shift(sheet: Sheet) -> np.ndarray:
    """Return the solid's vertices (n, 3), footprint unmoved, in the file's unit."""
    return sheet.head.units.gml.from_metres(
        sheet.building.model.on_one_level.vertices - np.array([*sheet.building.shift, 0.0])
    )


def with_terrain(sheet: Sheet, shell: str, rings: list[str]) -> str:
    """Return the building's own LoD2 solid, surfaces and terrain line.

    The solid is `shell`, the surfaces are of these `rings`, all as far as requested. GDAL and QGIS
    show the last geometry of a building. Where surfaces are to be that, the line, which is the same
    at all levels, stands before them as LoD1's; without LoD2 it would be the last, and is left out.
    """
    lines, is_last = terrain_lines(sheet), not sheet.head.write.gml_surfaces
    has_lod2 = sheet.head.write.has_lod2
    first = terrain_element(lines, 1) if lines and not is_last and has_lod2 else ""
    last = terrain_element(lines, 2 if has_lod2 else 1) if lines and is_last else ""
    surfaces = lod2_surfaces(rings) if shell and sheet.head.write.gml_surfaces else ""
    return f"{first}{shell}{surfaces}{last}"


def terrain_lines(sheet: Sheet) -> list[np.ndarray]:
    """Return known terrain lines (m, 3), m > 1, in the file's unit."""
    if not sheet.head.write.terrain_intersection:
        return []
    lines = (
        line
        for line in sheet.building.terrain_intersection
        if len(line) > 1 and np.isfinite(line).all()
    )
    return [sheet.head.units.gml.from_metres(line) for line in lines]


def in_file(sheet: Sheet, solid: Solid) -> np.ndarray:
    """Return the vertices (n, 3) of a solid in the file's unit."""
    return sheet.head.units.gml.from_metres(solid.vertices)


def list_rings(sheet: Sheet, solid: Solid) -> list[str]:
    """Return the rings of each of a solid's faces."""
    return list_face_rings(solid.faces, in_file(sheet, solid))


def choose_solid(sheet: Sheet) -> tuple[Solid, RoofFigures] | None:
    """Return the finest requested solid with its figures; None where its parts have solids."""
    lods = sheet.head.write.lods
    if sheet.figures is None or (sheet.shapes.parts and "2.2" in lods):
        return None
    if "2.3" in lods:
        return sheet.finest
    return (sheet.building.solid, sheet.figures) if "2.2" in lods else None
