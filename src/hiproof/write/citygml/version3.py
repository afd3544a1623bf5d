"""CityGML 3.0, translated from CityGML 2.0 by data/citygml3.xsl.

It has other names, another order, and an id for every geometry. So everything that the writer of
2.0 knows stands in 3.0 too.
"""

from __future__ import annotations

import dataclasses
from functools import cache
from importlib import resources

from lxml import etree

from ..fragments import Fragment, Sheet
from .version2 import NAMESPACES, CityGMLWriter

NAMESPACES_3 = {
    "bldg": "http://www.opengis.net/citygml/building/3.0",
    "con": "http://www.opengis.net/citygml/construction/3.0",
    "core": "http://www.opengis.net/citygml/3.0",
    "gen": "http://www.opengis.net/citygml/generics/3.0",
    "gml": "http://www.opengis.net/gml/3.2",
    "xlink": "http://www.w3.org/1999/xlink",
}
ID = f"{{{NAMESPACES_3['gml']}}}id"
WITH_ID = tuple(
    f"{{{NAMESPACES_3['gml']}}}{kind}"
    for kind in ("MultiSurface", "CompositeSurface", "Solid", "Polygon", "MultiCurve", "LineString")
)
BUILDING_ELEMENTS = tuple(
    f"{{{NAMESPACES_3['bldg']}}}{kind}"
    for kind in ("Building", "BuildingPart", "BuildingInstallation")
)
HUGE = etree.XMLParser(huge_tree=True, resolve_entities=False)


class CityGML3Writer(CityGMLWriter):
    """Incremental writer of CityGML 3.0; all else is as in `CityGMLWriter`."""

    namespaces, root_id = NAMESPACES_3, ' gml:id="city"'

    @staticmethod
    def fragment(sheet: Sheet) -> Fragment:
        """Return a building's part, without an extension of CityGML 2.0."""
        return upgrade_member(CityGMLWriter.fragment(dataclasses.replace(sheet, extension="")))


writer = CityGML3Writer


def upgrade_member(member: Fragment) -> Fragment:
    """Translate a cityObjectMember of CityGML 2.0 to 3.0, namespaces as declared in both."""
    declared = " ".join(f'xmlns:{prefix}="{uri}"' for prefix, uri in NAMESPACES.items())
    old = etree.fromstring(f"<root {declared}>".encode() + member.text + b"</root>", HUGE)
    root = load_translation()(old).getroot()
    for owner in reversed(list(root.iter(*BUILDING_ELEMENTS))):  # parts before their building
        for number, geometry in enumerate(owner.iter(*WITH_ID), 1):
            if geometry.get(ID) is None:
                geometry.set(ID, f"geom-{number}-{owner.get(ID)}")
    text = etree.tostring(root, encoding="utf-8")
    return Fragment(text[text.index(b">") + 1 : text.rindex(b"<")], member.extent)


@cache
def load_translation() -> etree.XSLT:
    path = resources.files("hiproof") / "data" / "citygml3.xsl"
    return etree.XSLT(etree.fromstring(path.read_bytes(), HUGE))
