"""Solids from CityJSON, CityJSONSeq and CityGML 2.0 files, as they stand.

The validity check and the simulated scanner use them.

Each shell of each solid of a building or building part comes out by itself: a CompositeSolid or
MultiSolid as several, the inner shells of a Solid turned inside out, so that each is a closed shell
whose faces should point outwards. A MultiSurface comes out as one shell too, unless it is a
footprint (LoD 0); that it is rarely closed is for the check to say.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, explain_fault
from ...frames import METRES, Units
from ...log import count_things
from ...model import WALL, Face, Solid
from ..crs import find_named_units, refuse_other_crs
from .cityjson import UNUSABLE, features, read_geometries, read_shell, require_list, unusable
from .damage import Damaged, refuse

GML_NAMESPACES = ("http://www.opengis.net/gml", "http://www.opengis.net/gml/3.2")
XLINK_HREF = "{http://www.w3.org/1999/xlink}href"
CITYGML_SUFFIXES = (".gml", ".xml", ".citygml")
BUILDING_OBJECT = "BuildingInstallation"
# City objects whose shells come out by themselves.
OWNERS = ("Building", "BuildingPart", BUILDING_OBJECT)

SURFACES = tuple(
    f"{{*}}{kind}Surface"
    for kind in ("Roof", "Wall", "Ground", "OuterCeiling", "OuterFloor", "Closure")
)
MEMBERS = ("{*}cityObjectMember", "{*}featureMember")


def read_solids(path: str | Path, damaged: Damaged = refuse) -> Iterator[tuple[str, Solid]]:
    """Yield (id, Solid) for each shell in a file, in metres.

    Files end in `.json`, `.jsonl` or `.gml`.

    They are the file's coordinates, times the unit of the CRS that the file names.

    The id is the city object's, with `#2`, `#3` ... for its further shells. CityJSONSeq is read
    line by line and CityGML city object by city object, so memory does not grow with the file. A
    city object that cannot be read is told to `damaged`, which refuses the file by default. Raises
    InputError when the file cannot be read as what its name says.
    """
    path = Path(path)
    readers = {
        **dict.fromkeys((".json", ".jsonl"), cityjson_solids),
        **dict.fromkeys(CITYGML_SUFFIXES, citygml_solids),
    }
    read = readers.get(path.suffix.lower())
    if path.is_dir():
        raise InputError(
            f"expected a file of solids, got the folder {path}; name one in it, such as "
            "buildings.city.jsonl"
        )
    if read is None:
        raise InputError(
            f"expected a CityJSON (.json), CityJSONSeq (.jsonl) or CityGML (.gml) file, got {path};"
            " rename it if it is one of these"
        )
    if not path.is_file():
        raise InputError(f"expected a file at {path}, got none; check the name")
    yield from read(path, damaged)


def read_building_solids(path: Path, damaged: Damaged, units: Units) -> Iterator[tuple[str, Solid]]:
    """Yield (id, Solid) of buildings' shells in a CityGML file; see `read_solids`."""
    return citygml_solids(path, damaged, BUILDING_OBJECT, units)


def number_solids(name: str, solids: list[Solid]) -> Iterator[tuple[str, Solid]]:
    """Yield the shells of one city object under its id."""
    for k, solid in enumerate(solids):
        yield (name if k == 0 else f"{name}#{k + 1}"), solid


# CityJSON


def cityjson_solids(path: Path, damaged: Damaged = refuse) -> Iterator[tuple[str, Solid]]:
    """Yield the shells of CityJSON 1.x, 2.0 or CityJSONSeq; a transform holds for later lines."""
    for feature in features(path, damaged=damaged):
        for name, city_object in feature.objects.items():
            try:
                if isinstance(city_object, dict) and not str(city_object.get("type")).startswith(
                    "Building"
                ):
                    continue
                result = [
                    solid
                    for geometry in read_geometries(city_object)
                    if not str(geometry.get("lod", "")).startswith("0")
                    for solid in geometry_shells(geometry, feature.vertices)
                ]
            except UNUSABLE as error:
                damaged(unusable(name, feature, error))
                continue
            yield from number_solids(name, result)


def geometry_shells(geometry: dict[str, Any], vertices: np.ndarray) -> list[Solid]:
    """Return the shells of a CityJSON geometry; points, lines and templates have none."""
    kind, boundaries = geometry.get("type"), geometry.get("boundaries", [])
    semantics = geometry.get("semantics") or {}
    surfaces, values = semantics.get("surfaces", []), semantics.get("values")
    if kind in ("MultiSurface", "CompositeSurface"):
        return [shell_solid(boundaries, values, surfaces, vertices)] if boundaries else []
    if kind == "Solid":
        boundaries, values = [boundaries], [values]
    elif kind not in ("MultiSolid", "CompositeSolid"):
        return []
    shells = []
    for s, solid in enumerate(require_list(boundaries, "boundaries")):
        for k, shell in enumerate(require_list(solid, "the boundaries of a solid")):
            named_crs = values[s][k] if values and values[s] else None
            shells.append(shell_solid(shell, named_crs, surfaces, vertices, inward=k > 0))
    return shells


def shell_solid(
    shell: Any, values: Any, surfaces: Any, vertices: np.ndarray, inward: bool = False
) -> Solid:
    """Return a shell, faces of rings of indices, with semantics, on the vertices it uses."""
    faces = tuple(
        Face(tuple(ring[::-1] if inward else ring for ring in surface.rings), surface.kind)
        for surface in read_shell(shell, values, surfaces, len(vertices))
    )
    return Solid(vertices, faces).drop_unused_vertices()


# CityGML


def local_name(element: Any) -> str:
    tag = element.tag
    return tag.rpartition("}")[2] if isinstance(tag, str) else ""


def citygml_solids(
    path: Path, damaged: Damaged = refuse, without: str = "", crs_units: Units | None = None
) -> Iterator[tuple[str, Solid]]:
    """Yield the shells of all solids of a CityGML file, member by member.

    City objects of the kind `without` are left out. `crs_units` are the units of its coordinates,
    by default those of the CRS that it names. An object without a gml:Solid gives its boundary
    surfaces as one shell.
    """
    from lxml import etree

    members, units, first_name = 0, crs_units or METRES, None
    try:
        for _, element in etree.iterparse(
            str(path), tag=("{*}Envelope", *MEMBERS), huge_tree=True, resolve_entities=False
        ):
            if local_name(element) == "Envelope":
                if not members:
                    first_name = element.get("srsName")
                    units = crs_units or find_named_units(first_name)
                continue
            members += 1
            for name in {part.get("srsName") for part in element.iter()} if first_name else ():
                refuse_other_crs(first_name, name, f"{gml_id(element[0])} in {path}")
            try:
                solids = list(member_solids(element, path, without))
            except InputError as error:
                damaged(error)
                solids = []
            for name, solid in solids:
                yield name, replace(solid, vertices=units.to_metres(solid.vertices))
            element.clear()
            while element.getprevious() is not None:
                del element.getparent()[0]
    except (etree.XMLSyntaxError, OSError) as error:
        raise InputError(
            f"expected well-formed CityGML in {path}, got "
            f"{explain_fault(path) or f'{error}; the file is damaged or cut off'}"
        ) from error
    if members == 0:
        raise InputError(
            f"expected cityObjectMember elements in {path}, got none; is this a CityGML 2.0 file?"
        )


def find_citygml_crs(path: Path) -> str | None:
    """Return the CRS's name in a CityGML file's first envelope, None before the first object."""
    from lxml import etree

    tags = ("{*}Envelope", *MEMBERS)
    # who reads the solids says what is wrong
    with suppress(etree.XMLSyntaxError, OSError, StopIteration):
        events = etree.iterparse(str(path), events=("start",), tag=tags, resolve_entities=False)
        return next(events)[1].get("srsName")
    return None


def gml_id(element: Any) -> str | None:
    names = (element.get(f"{{{namespace}}}id") for namespace in GML_NAMESPACES)
    return next(filter(None, names), None)


def member_solids(member: Any, path: Path, without: str) -> Iterator[tuple[str, Solid]]:
    """Yield shells of a cityObjectMember; parts and installations with solids have own ids."""
    polygons = {gml_id(element): element for element in member.iter("{*}Polygon")}
    owners = [*member.iter(*(f"{{*}}{kind}" for kind in OWNERS if kind != without))]
    for owner in owners or list(member)[:1]:
        place = f"{gml_id(owner) or 'a building without an id'} in {path}"
        own = list(iterate_own_descendants(owner))
        shells = (gml_shells(e, polygons, place) for e in own if local_name(e) == "Solid")
        solids = [solid for of_element in shells for solid in of_element]
        if not solids and local_name(owner) != BUILDING_OBJECT:
            loose = [element for element in own if is_loose(element)]
            solids = [polygons_solid(loose, place)] if loose else []
        yield from number_solids(gml_id(owner) or "unnamed", solids)


def is_loose(element: Any) -> bool:
    """Return whether an element is a polygon of a boundary surface, and not of LoD 0."""
    return (
        local_name(element) == "Polygon"
        and next(element.iterancestors(*SURFACES), None) is not None
        and not any(local_name(a).startswith("lod0") for a in element.iterancestors())
    )


def iterate_own_descendants(owner: Any) -> Iterator[Any]:
    """Yield the elements below `owner` outside its parts and installations."""
    for child in owner:
        if local_name(child) not in OWNERS:
            yield child
            yield from iterate_own_descendants(child)


def gml_shells(solid: Any, polygons: dict[str | None, Any], place: str) -> list[Solid]:
    """Return outer and inner shells of a gml:Solid, surfaces by value or by xlink."""
    shells = []
    for boundary in solid.iterchildren("{*}exterior", "{*}interior"):
        members = []
        for element in boundary.iter():
            reference = element.get(XLINK_HREF)
            if reference is not None:
                element = polygons.get(reference.lstrip("#"))
                if element is None:
                    raise InputError(
                        f"expected a polygon with id {reference} among the surfaces of {place}, "
                        "got none; the solid refers to a surface that is missing"
                    )
            if local_name(element) == "Polygon":
                members.append(element)
        shells.append(polygons_solid(members, place, inward=local_name(boundary) == "interior"))
    return shells


def polygons_solid(polygons: list[Any], place: str, inward: bool = False) -> Solid:
    """Return a shell of gml:Polygons with equal corners joined; open rings are defect 103."""
    number: dict[tuple[float, ...], int] = {}
    faces: list[Face] = []
    defects: list[tuple[int, int]] = []
    for polygon in polygons:
        rings = []
        for ring in polygon.iter("{*}LinearRing"):
            points = ring_points(ring, place)
            if len(points) > 1 and points[0] == points[-1]:
                points = points[:-1]
            else:
                defects.append((103, len(faces)))
            indices = tuple(number.setdefault(point, len(number)) for point in points)
            rings.append(indices[::-1] if inward else indices)
        surface = next(polygon.iterancestors(*SURFACES), None)
        faces.append(Face(tuple(rings), WALL if surface is None else local_name(surface)))
    return Solid(np.array(list(number), float).reshape(-1, 3), tuple(faces), tuple(defects))


def ring_points(ring: Any, place: str) -> list[tuple[float, ...]]:
    """Return the points of a gml:LinearRing from posList or pos."""
    texts = [element.text or "" for element in ring.iter("{*}posList", "{*}pos")]
    try:
        values = [float(word) for word in " ".join(texts).split()]
    except ValueError as error:
        raise InputError(
            f"expected numbers in a gml:posList of {place}, got: {error}; export the file anew"
        ) from error
    if len(values) % 3:
        raise InputError(
            f"expected three coordinates a point in a gml:LinearRing of {place}, got "
            f"{count_things(len(values), 'number')}; export the file anew, in 3D"
        )
    return [tuple(values[k : k + 3]) for k in range(0, len(values), 3)]
