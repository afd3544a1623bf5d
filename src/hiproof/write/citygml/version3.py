"""CityGML 3.0, translated from CityGML 2.0.

It has other names, another order, and an id for every geometry.

What 3.0 tells otherwise: surfaces are boundaries of a space and belong to constructions, heights
say from where to where they were measured, generic attributes are elements of their own, footprint
and roof edge are boundaries of level 0, and a solid has a shell. So everything that the writer of
2.0 knows stands in 3.0 too.
"""

from __future__ import annotations

import dataclasses
import datetime
import os
from collections.abc import Iterable
from typing import Any

from lxml import etree

from ...model import Building
from ..attribute_list import OWN
from ..building_attributes import PREFIX
from ..fragments import Fragment, Sheet
from ..head import FileHead
from . import version2
from .version2 import CityGMLWriter

NAMESPACES_3 = {
    "bldg": "http://www.opengis.net/citygml/building/3.0",
    "con": "http://www.opengis.net/citygml/construction/3.0",
    "core": "http://www.opengis.net/citygml/3.0",
    "gen": "http://www.opengis.net/citygml/generics/3.0",
    "gml": "http://www.opengis.net/gml/3.2",
    "xlink": "http://www.w3.org/1999/xlink",
}
ID, OLD_ID = f"{{{NAMESPACES_3['gml']}}}id", f"{{{version2.NAMESPACES['gml']}}}id"
ORDER = (
    *(
        "name",
        "creationDate",
        "terminationDate",
        "validFrom",
        "validTo",
        "genericAttribute",
        "boundary",
        "lod0MultiSurface",
        "lod1MultiSurface",
        "lod1Solid",
    ),
    *(
        "lod2Solid",
        "lod2MultiSurface",
        "lod1TerrainIntersectionCurve",
        "lod2TerrainIntersectionCurve",
        "height",
    ),
    *("function", "roofType", "buildingInstallation", "buildingPart"),
)
"""The order of what we write of buildings and their surfaces, as the schemas inherit it: core,
construction, building.
"""

GENERIC = {
    "intAttribute": "IntAttribute",
    "doubleAttribute": "DoubleAttribute",
    "stringAttribute": "StringAttribute",
}
VALIDITY = {f"{OWN}valid_from": "validFrom", f"{OWN}valid_to": "validTo"}
SET = "genericAttributeSet"
LEVEL_0 = {"lod0FootPrint": "GroundSurface", "lod0RoofEdge": "RoofSurface"}
WITH_ID = ("MultiSurface", "CompositeSurface", "Solid", "Polygon", "MultiCurve", "LineString")


def write_citygml3(
    path: str | os.PathLike,
    buildings: Iterable[Building],
    crs: Any = None,
    prefix: str = PREFIX,
    creation_date: datetime.date | None = None,
) -> None:
    """Write `buildings` to `path` as CityGML 3.0; all else as `write_citygml`."""
    head = FileHead(crs, prefix=prefix, creation_date=creation_date)
    with CityGML3Writer(path, head) as writer:
        for building in buildings:
            writer.add(building)


class CityGML3Writer(CityGMLWriter):
    """Incremental form of `write_citygml3`."""

    namespaces, root_id = NAMESPACES_3, ' gml:id="city"'

    def add_member(self, member: Fragment) -> None:
        self.put(upgrade_member(member))


writer = CityGML3Writer


def fragment(sheet: Sheet) -> Fragment:
    """Return a building's part of a run's file, without an extension of CityGML 2.0."""
    return upgrade_member(version2.fragment(dataclasses.replace(sheet, extension="")))


def upgrade_member(member: Fragment) -> Fragment:
    """Translate a cityObjectMember of CityGML 2.0 to 3.0.

    The root's namespaces are taken as declared in both.
    """
    declared = " ".join(f'xmlns:{prefix}="{uri}"' for prefix, uri in version2.NAMESPACES.items())
    (old,) = etree.fromstring(f"<root {declared}>".encode() + member.text + b"</root>", HUGE)
    root = etree.Element("root", nsmap=NAMESPACES_3)
    root.append(make_element("core:cityObjectMember", upgrade_building(old[0])))
    text = etree.tostring(root, encoding="utf-8")
    return Fragment(text[text.index(b">") + 1 : text.rindex(b"<")], member.extent)


HUGE = etree.XMLParser(huge_tree=True, resolve_entities=False)


def upgrade_building(old: Any) -> Any:
    """Translate a building, a part or an installation with all that is in it.

    The result is in the order of the schemas.
    """
    new = make_element(f"bldg:{local(old)}", **{ID: old.get(OLD_ID)})
    owner = new.get(ID)
    properties = [upgrade_property(child, owner) for child in old]
    properties += [
        make_date(VALIDITY[n], child[0].text) for child in old if (n := find_name(child))
    ]
    new.extend(sorted(properties, key=lambda child: ORDER.index(local(child))))
    for number, geometry in enumerate(
        new.iter(*(qualify_name(f"gml:{kind}") for kind in WITH_ID)), 1
    ):
        if geometry.get(ID) is None:
            geometry.set(ID, f"geom-{number}-{owner}")
    return new


def upgrade_property(old: Any, owner: str) -> Any:
    """Translate a property of a building or surface.

    `owner` ends the ids that are new.
    """
    name = local(old)
    if name in (*GENERIC, SET):
        return make_element("core:genericAttribute", upgrade_generic(old))
    if name == "boundedBy":
        return make_element("core:boundary", upgrade_surface(old[0], owner))
    if name in LEVEL_0:
        surfaces = make_element("core:lod0MultiSurface", upgrade_geometry(old[0]))
        return make_element(
            "core:boundary",
            make_element(f"con:{LEVEL_0[name]}", surfaces, **{ID: f"{name}-{owner}"}),
        )
    if name == "measuredHeight":
        return make_element("con:height", upgrade_height(old))
    if name == "consistsOfBuildingPart":
        return make_element("bldg:buildingPart", upgrade_building(old[0]))
    if name == "outerBuildingInstallation":
        return make_element("bldg:buildingInstallation", upgrade_building(old[0]))
    if name == "lod2Geometry":
        return make_element("core:lod2Solid", *map(upgrade_geometry, old))
    if name in ("creationDate", "terminationDate"):
        return make_date(name, old.text)
    if name.startswith("lod"):
        renamed = name.replace("TerrainIntersection", "TerrainIntersectionCurve")
        return make_element(f"core:{renamed}", *map(upgrade_geometry, old))
    return make_element(
        f"{'gml' if name == 'name' else 'bldg'}:{name}", text=old.text, **old.attrib
    )


def find_name(old: Any) -> str | None:
    """Return the name of a generic attribute that is a date of validity, else None."""
    name = old.get("name")
    return name if name in VALIDITY else None


def make_date(name: str, day: str) -> Any:
    """Make a date of a feature's life; in CityGML 3.0 it has a time."""
    return make_element(f"core:{name}", text=f"{day}T00:00:00")


def upgrade_generic(old: Any) -> Any:
    """Translate a generic attribute, or a named set of them."""
    name = make_element("gen:name", text=old.get("name"))
    if local(old) == SET:
        return make_element(
            "gen:GenericAttributeSet",
            name,
            *(make_element("gen:genericAttribute", upgrade_generic(item)) for item in old),
        )
    return make_element(
        f"gen:{GENERIC[local(old)]}", name, make_element("gen:value", text=old[0].text)
    )


def upgrade_surface(old: Any, owner: str) -> Any:
    """Translate a RoofSurface, WallSurface or GroundSurface."""
    properties = sorted(
        (upgrade_property(child, owner) for child in old),
        key=lambda child: ORDER.index(local(child)),
    )
    return make_element(f"con:{local(old)}", *properties, **{ID: old.get(OLD_ID)})


def upgrade_height(old: Any) -> Any:
    """Translate a measuredHeight, adding from where to where it was measured."""
    properties = {
        "highReference": "highestRoofEdge",
        "lowReference": "lowestGroundPoint",
        "status": "measured",
    }
    how = [make_element(f"con:{name}", text=value) for name, value in properties.items()]
    return make_element(
        "con:Height", *how, make_element("con:value", text=old.text, uom=old.get("uom"))
    )


def upgrade_geometry(old: Any) -> Any:
    """Translate a geometry of GML 3.1 to 3.2.

    A solid's boundary is a shell there.
    """
    is_shell = local(old) == "CompositeSurface" and local(old.getparent().getparent()) == "Solid"
    new = make_element(
        f"gml:{'Shell' if is_shell else local(old)}", *map(upgrade_geometry, old), text=old.text
    )
    for name, value in old.attrib.items():
        new.set(ID if name == OLD_ID else name, value)
    return new


def make_element(tag: str, *children: Any, text: str | None = None, **attributes: str) -> Any:
    """Make an element `prefix:name`."""
    element = etree.Element(qualify_name(tag), attributes, nsmap=NAMESPACES_3)
    element.text = text
    element.extend(children)
    return element


def qualify_name(tag: str) -> str:
    """Return `prefix:name` in lxml's form."""
    prefix, _, name = tag.partition(":")
    return f"{{{NAMESPACES_3[prefix]}}}{name}"


def local(element: Any) -> str:
    return etree.QName(element).localname
