"""A building's thermal zone and boundaries in the Energy ADE of CityGML 2.0.

Angles are those of the outward normal: the azimuth clockwise from grid north, and the inclination 0
for what faces up, 90 for a wall, 180 for what faces down.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..compose.settle import round_number
from ..errors import InputError
from ..model import GROUND, ROOF
from ..model.roof_figures import FLAT_SLOPE_DEG
from ..settings import Settings
from ..write.attribute_list import OWN
from ..write.citygml.surfaces import surface_ids
from ..write.citygml.version2 import choose_solid
from ..write.fragments import Sheet
from ..write.values import xml_text
from .answer import is_house
from .walls import measure_faces

ENERGY_NAMESPACE = "http://www.sig3d.org/citygml/2.0/energy/1.0"
BUILDING_TYPES = "https://episcope.eu/building-typology/"  # TABULA's classes
# The type of the boundary that a face is; a wall is a sharedWall or an outerWall.
BOUNDARY_TYPES = {ROOF: "roof", GROUND: "groundSlab"}


def write_energy(sheet: Sheet) -> str:
    """Return the ADE's properties that end a building's element, none without a model."""
    if sheet.building.built is None:
        return ""
    values = sheet.attributes
    floors = [values.get(f"{OWN}gross_floor_area_{end}_m2") for end in ("min", "max")]
    known = [area for area in floors if area is not None]
    area = sum(known) / len(known) if known else None
    volume = measure(
        "volume", "VolumeType", "grossVolume", "m3", values.get(f"{OWN}heated_volume_m3")
    )
    floor = measure("floorArea", "FloorArea", "grossFloorArea", "m2", area)
    properties = [volume, floor, write_zone(sheet, floor + volume)]
    kind = values.get(f"{OWN}tabula_class")
    if kind is not None:
        text = f'<energy:buildingType codeSpace="{BUILDING_TYPES}">{xml_text(kind)}'
        properties.insert(0, f"{text}</energy:buildingType>")
    return "".join(declare_namespace(text) for text in properties if text)


def declare_namespace(text: str) -> str:
    """Declare the ADE's namespace in an element: files without the ADE do not have it."""
    end = min(text.index(mark) for mark in (" ", ">") if mark in text)
    return f'{text[:end]} xmlns:energy="{ENERGY_NAMESPACE}"{text[end:]}'


def measure(name: str, kind: str, type: str, unit: str, value: float | None) -> str:
    """Return a measure with its type, nothing where it is unknown."""
    if value is None:
        return ""
    inner = f"<energy:type>{type}</energy:type>"
    inner += f'<energy:value uom="{unit}">{round_number(value, 2)}</energy:value>'
    return f"<energy:{name}><energy:{kind}>{inner}</energy:{kind}></energy:{name}>"


def write_zone(sheet: Sheet, measures: str) -> str:
    """Return a building as one thermal zone, heated unless it is a shed or a garage."""
    name = sheet.gml_name
    own, _ = choose_solid(sheet) or (sheet.building.solid, None)  # that of LoD2.3 has other faces
    has_solid = sheet.head.write.has_lod2 and own is sheet.building.solid
    is_heated = str(is_house(sheet.building)).lower()
    text = f'<energy:thermalZone><energy:ThermalZone gml:id="zone-{name}">{measures}'
    text += "<energy:isCooled>false</energy:isCooled>"
    text += f"<energy:isHeated>{is_heated}</energy:isHeated>"
    if has_solid:
        text += f'<energy:volumeGeometry xlink:href="#solid-{name}"/>'
    text += "".join(write_boundaries(sheet, has_solid))
    return f"{text}</energy:ThermalZone></energy:thermalZone>"


def write_boundaries(sheet: Sheet, has_solid: bool) -> Iterator[str]:
    """Yield the thermal boundary that each face of a building is."""
    solid = sheet.building.solid
    sizes, normals = measure_faces(solid)
    ids = surface_ids(solid.faces, sheet.gml_name)
    for face, (item, id) in enumerate(zip(solid.faces, ids, strict=True)):
        is_party = f"{OWN}party_with" in sheet.surfaces.get(face, {})
        kind = BOUNDARY_TYPES.get(item.kind, "sharedWall" if is_party else "outerWall")
        text = f'<energy:ThermalBoundary gml:id="thermal-{id}">'
        text += f"<energy:thermalBoundaryType>{kind}</energy:thermalBoundaryType>"
        text += write_angles(normals[face])
        text += f'<energy:area uom="m2">{round_number(float(sizes[face]), 4)}</energy:area>'
        if has_solid:
            member = f'<gml:surfaceMember xlink:href="#poly-{id}"/>'
            surface = f"<gml:MultiSurface>{member}</gml:MultiSurface>"
            text += f"<energy:surfaceGeometry>{surface}</energy:surfaceGeometry>"
        text += f'<energy:delimits xlink:href="#zone-{sheet.gml_name}"/>'
        yield f"<energy:boundedBy>{text}</energy:ThermalBoundary></energy:boundedBy>"


def write_angles(normal: np.ndarray) -> str:
    """Return azimuth and inclination of a face; what is level has no azimuth."""
    flat = float(np.hypot(normal[0], normal[1]))
    inclination = float(np.degrees(np.arctan2(flat, normal[2])))
    text = ""
    if FLAT_SLOPE_DEG <= inclination <= 180.0 - FLAT_SLOPE_DEG:
        azimuth = float(np.degrees(np.arctan2(normal[0], normal[1])) % 360.0)
        text = f'<energy:azimuth uom="deg">{round_number(azimuth, 3)}</energy:azimuth>'
    return (
        f'{text}<energy:inclination uom="deg">{round_number(inclination, 3)}</energy:inclination>'
    )


def refuse_other_citygml(settings: Settings) -> None:
    """Raise InputError for a run without the CityGML that the ADE is for."""
    if settings.enrich.energy_ade and settings.write.citygml == "3.0":
        raise InputError(
            "expected a run with CityGML 2.0 for --energy-ade, got one with 3.0; run `hiproof "
            "build` with --citygml both, and enrich its folder"
        )
