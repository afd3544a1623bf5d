"""CityGML 3.0 against what 2.0 tells of the same buildings, and against OGC's schemas."""

import datetime

import numpy as np
import pytest
from lxml import etree

from handmade import box, courtyard, gable_house, make_building, make_lost_building
from hiproof.read.models.solids import read_solids
from hiproof.write.citygml.version2 import NAMESPACES as OLD
from hiproof.write.citygml.version2 import CityGMLWriter
from hiproof.write.citygml.version3 import ID, NAMESPACES_3, CityGML3Writer, upgrade_member
from hiproof.write.fragments import Fragment
from hiproof.write.head import FileHead
from written_run import require_schema

HREF = f"{{{NAMESPACES_3['xlink']}}}href"

WITH_ID = ("CityModel", "Building", "BuildingPart", "RoofSurface", "WallSurface", "GroundSurface")
WITH_ID += ("MultiSurface", "Solid", "Polygon", "MultiCurve", "LineString")

TWO_PARTS = """<core:cityObjectMember><bldg:Building gml:id="bldg-x"><gml:name>x</gml:name>
<bldg:roofType codeSpace="c">1130</bldg:roofType><bldg:measuredHeight uom="m">7.5</bldg:measuredHeight>
<bldg:lod0FootPrint><gml:MultiSurface><gml:surfaceMember><gml:Polygon><gml:exterior><gml:LinearRing>
<gml:posList>0 0 0 1 0 0 1 1 0 0 0 0</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember>
</gml:MultiSurface></bldg:lod0FootPrint><bldg:lod0RoofEdge><gml:MultiSurface/></bldg:lod0RoofEdge>
<bldg:consistsOfBuildingPart><bldg:BuildingPart gml:id="part-1-x">
<gen:intAttribute name="k"><gen:value>3</gen:value></gen:intAttribute><gen:genericAttributeSet name="s">
<gen:doubleAttribute name="width"><gen:value>8.5</gen:value></gen:doubleAttribute></gen:genericAttributeSet><bldg:roofType>1030</bldg:roofType>
<bldg:lod1Solid><gml:Solid><gml:exterior><gml:CompositeSurface>
<gml:surfaceMember><gml:Polygon><gml:exterior><gml:LinearRing>
<gml:posList>0 0 2 1 0 2 1 1 2 0 0 2</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember>
</gml:CompositeSurface></gml:exterior></gml:Solid></bldg:lod1Solid>
</bldg:BuildingPart></bldg:consistsOfBuildingPart></bldg:Building></core:cityObjectMember>"""  # noqa: E501


def list_attributes(building, version):
    """(name, value) of each generic attribute of a building of that version."""
    if version == 2:
        return [(a.get("name"), a[0].text) for a in building.xpath("gen:*", namespaces=OLD)]
    found = new(building, "core:genericAttribute/*")
    texts = ("gen:name", "gen:value")
    return [tuple(a.findtext(text, None, NAMESPACES_3) for text in texts) for a in found]


def street():
    strange = {'a & <b> "c"': "\r\n <ö> 'x'", "flag": True, "n": 3, "x": -0.5, "unknown": None}
    return [
        make_lost_building(),
        make_building(gable_house(), "0503100000012345", attributes=strange),
        make_building(courtyard(), "a b/ä", ("flat", "hip")),
        make_building(box(), "same"),
        make_building(box(), "same", terrain_intersection=()),
    ]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("citygml")
    head = FileHead("EPSG:7415", creation_date=datetime.date(2020, 2, 3))
    for name, writer in (("old", CityGMLWriter), ("new", CityGML3Writer)):
        writer(folder / f"{name}.gml", head).add_all(street())
    return folder / "old.gml", folder / "new.gml"


@pytest.fixture(scope="module")
def roots(files):
    return tuple(etree.parse(file).getroot() for file in files)


def new(root, path):
    return root.xpath(path, namespaces=NAMESPACES_3)


def assert_told_as_the_schemas_ask(root):
    ids = new(root, "//@gml:id")
    assert len(set(ids)) == len(ids)
    for element in root.iter(etree.Element):
        assert etree.QName(element).namespace in NAMESPACES_3.values()
        if etree.QName(element).localname in WITH_ID:
            assert element.get(ID), element
    assert {href.removeprefix("#") for href in new(root, "//@xlink:href")} <= set(ids)
    assert {child.tag for child in new(root, "//gml:Solid/gml:exterior/*")} <= {
        f"{{{NAMESPACES_3['gml']}}}Shell"
    }
    require_schema("citygml3").assertValid(etree.fromstring(etree.tostring(root)))


def test_order_names_and_ids_are_as_the_schemas_ask(roots):
    assert_told_as_the_schemas_ask(roots[1])


def test_the_same_solids_come_back(files):
    old, later = (list(read_solids(file)) for file in files)
    assert [name for name, _ in later] == [name for name, _ in old] and len(later) >= 4
    for (_, solid), (_, solid_back) in zip(old, later, strict=True):
        np.testing.assert_array_equal(solid_back.vertices, solid.vertices)
        assert solid_back.faces == solid.faces and solid_back.defects == ()


def test_the_same_attributes_stand_in_both(roots):
    old, later = roots
    old_attributes = [list_attributes(b, 2) for b in old.iter(f"{{{OLD['bldg']}}}Building")]
    assert [list_attributes(b, 3) for b in new(later, "//bldg:Building")] == old_attributes
    assert all(old_attributes)
    assert new(later, "//gen:IntAttribute[gen:name='n']/gen:value/text()") == ["3"]
    texts = ("bldg:roofType/text()", "bldg:roofType/@codeSpace", "gml:name/text()")
    for path in (*texts, "gml:posList/text()"):
        assert sorted(new(later, f"//{path}")) == sorted(old.xpath(f"//{path}", namespaces=OLD))


def test_heights_dates_and_terrain_lines_are_told_in_the_newer_way(roots):
    old, later = roots

    def find_old(path):
        return old.xpath(path, namespaces=OLD)

    height = "//con:height/con:Height[con:status='measured']/con:value[@uom='m']/text()"
    assert new(later, height) == find_old("//bldg:measuredHeight/text()")
    assert set(new(later, "//core:creationDate/text()")) == {"2020-02-03T00:00:00"}
    for level in (1, 2):
        lines = find_old(f"//bldg:lod{level}TerrainIntersection//gml:posList/text()")
        assert new(later, f"//core:lod{level}TerrainIntersectionCurve//gml:posList/text()") == lines
    assert new(later, "//gml:MultiCurve")
    envelope = "/core:CityModel/gml:boundedBy/gml:Envelope/@srsName"
    assert new(later, envelope) == find_old("//@srsName")


def test_parts_and_level_0_are_told_in_the_newer_way():
    member = upgrade_member(Fragment(TWO_PARTS.replace("\n", "").encode(), (0.0,) * 6))
    declared = " ".join(f'xmlns:{prefix}="{uri}"' for prefix, uri in NAMESPACES_3.items())
    head = f'<core:CityModel {declared} gml:id="c">'.encode()
    root = etree.fromstring(head + member.text + b"</core:CityModel>")
    assert b"xmlns" not in member.text and member.extent == (0.0,) * 6
    assert_told_as_the_schemas_ask(root)
    (part,) = new(root, "//bldg:Building/bldg:buildingPart/bldg:BuildingPart")
    assert new(part, "bldg:roofType/text()") == ["1030"] and new(part, "core:lod1Solid/gml:Solid")
    assert new(part, "core:genericAttribute/gen:IntAttribute/gen:value/text()") == ["3"]
    one_set = "core:genericAttribute/gen:GenericAttributeSet[gen:name='s']/gen:genericAttribute"
    width = f"{one_set}/gen:DoubleAttribute[gen:name='width']/gen:value/text()"
    assert new(part, width) == ["8.5"]
    ground = "//core:boundary/con:GroundSurface/core:lod0MultiSurface//gml:posList/text()"
    assert new(root, ground) == ["0 0 0 1 0 0 1 1 0 0 0 0"]
    roof = "//core:boundary/con:RoofSurface/core:lod0MultiSurface/gml:MultiSurface"
    assert len(new(root, roof)) == 1


def test_no_buildings_make_an_empty_model(tmp_path):
    CityGML3Writer(tmp_path / "a.gml", FileHead()).add_all([])
    root = etree.parse(tmp_path / "a.gml").getroot()
    assert root.tag == f"{{{NAMESPACES_3['core']}}}CityModel" and len(root) == 0
