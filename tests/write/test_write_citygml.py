"""CityGML against its own schema, and what stands in it against the buildings."""

import datetime
import itertools
from dataclasses import replace

import numpy as np
import pyogrio
import pytest
from hypothesis import given, settings
from lxml import etree

from any_text import ANY_TEXT
from handmade import RD_ORIGIN, box, courtyard, gable_house, make_building, make_lost_building
from hiproof.write.citygml.version2 import NAMESPACES, write_citygml
from hiproof.write.naming import gml_name
from hiproof.write.values import xml_attribute, xml_text
from written_run import require_schema

GML_ID, HREF = f"{{{NAMESPACES['gml']}}}id", f"{{{NAMESPACES['xlink']}}}href"


def street():
    odd = replace(make_building(box()).quality, psd_mean=float("inf"))
    return [
        make_lost_building(),
        make_building(gable_house(), "0503100000012345"),
        make_building(courtyard(), "a b/ä", ("flat", "hip")),
        make_building(box(), "same"),
        make_building(box(), "same", terrain_intersection=()),
        make_building(box(), "same-1", quality=odd),
    ]


def write_and_read(tmp_path, buildings, crs="EPSG:7415", **options):
    write_citygml(tmp_path / "a.gml", buildings, crs, **options)
    return etree.parse(tmp_path / "a.gml").getroot()


def find(root, path):
    return root.xpath(path, namespaces=NAMESPACES)


@pytest.fixture(scope="module")
def schema():
    return require_schema("citygml2")


@pytest.mark.parametrize("crs", ["EPSG:7415", "EPSG:28992", None])
@pytest.mark.parametrize(
    "buildings", [street(), [], [make_lost_building()]], ids=["street", "none", "no model"]
)
def test_valid_by_the_schema(tmp_path, schema, buildings, crs):
    date = datetime.date(2020, 2, 3)
    root = write_and_read(tmp_path, buildings, crs, creation_date=date)
    schema.assertValid(root.getroottree())


def test_strange_attributes_are_valid(tmp_path, schema):
    strange = {"\x00": "\x01ok\ud800", "<": 10**30, "flag": True, "list": [1], "": 0.5}
    strange["when"] = datetime.date(2020, 1, 2)
    root = write_and_read(tmp_path, [make_building(box(), "\x02", attributes=strange)])
    schema.assertValid(root.getroottree())
    assert find(root, "//gen:stringAttribute[@name='flag']/gen:value/text()") == ["true"]


def test_the_text_is_what_lxml_would_print(tmp_path):
    strange = {'a & <b> "c"': "\r\n\t & <ö> 'x'\u2028\x85", "ü": -0.5}
    root = write_and_read(
        tmp_path, [*street(), make_building(courtyard(), "<&\"'>\x07ß", attributes=strange)]
    )
    text = (tmp_path / "a.gml").read_bytes()
    assert etree.tostring(root, encoding="utf-8") == text.partition(b"\n")[2]


@settings(max_examples=40)
@given(ANY_TEXT)
def test_any_text_comes_back_from_xml(text):
    allowed = "".join(
        c
        if c in "\t\n\r" or " " <= c <= "\ud7ff" or "\ue000" <= c <= "\ufffd" or c > "\uffff"
        else "\ufffd"
        for c in text
    )
    element = etree.fromstring(f'<a b="{xml_attribute(text)}">{xml_text(text)}</a>')
    assert (element.get("b"), element.text or "") == (allowed, allowed)


def test_ids_are_unique_and_links_lead_somewhere(tmp_path):
    root = write_and_read(tmp_path, street())
    ids = [element.get(GML_ID) for element in root.iter() if element.get(GML_ID)]
    assert len(ids) == len(set(ids))
    links = {element.get(HREF)[1:] for element in root.iter() if element.get(HREF)}
    assert links == set(find(root, "//gml:Polygon/@gml:id"))
    assert find(root, "//bldg:Building/gml:name/text()") == [b.id for b in street()]
    assert len(find(root, "//bldg:lod2Solid")) == 5
    assert find(root, "//bldg:Building/@gml:id")[-3:] == [
        "bldg-same",
        "bldg-same..2",
        "bldg-same-1",
    ]


@pytest.mark.parametrize(
    "kinds, code",
    [(("hip",), "1040"), (("hip", "hip"), "1040"), (("hip", "flat"), "1130"), (("free",), "1130")],
)
def test_roof_type(tmp_path, kinds, code):
    """A slope of the house belongs to each part."""
    house, roof = gable_house(), itertools.cycle(range(len(kinds)))
    faces = [replace(f, part=next(roof)) if f.kind == "RoofSurface" else f for f in house.faces]
    building = make_building(replace(house, faces=tuple(faces)), kinds=kinds)
    (element,) = find(write_and_read(tmp_path, [building]), "//bldg:roofType")
    assert element.text == code
    assert element.get("codeSpace").endswith("_AbstractBuilding_roofType.xml")


def test_heights_attributes_and_date(tmp_path):
    date = datetime.date(2020, 2, 3)
    root = write_and_read(tmp_path, [make_building(gable_house())], creation_date=date)

    def find_values(kind, name):
        return find(root, f"//gen:{kind}Attribute[@name='{name}']/gen:value/text()")

    assert find(root, "//bldg:measuredHeight[@uom='m']/text()") == ["7.0000"]
    assert find(root, "//core:creationDate/text()") == ["2020-02-03"]
    assert find_values("double", "rf_h_roof_ridge") == ["7.0"]
    assert find_values("string", "naam") == ["Café <&>"]
    assert find_values("double", "azimuth") == ["270.0", "90.0"]


def read_rings(texts):
    return [np.array(text.split(), float).reshape(-1, 3) for text in texts]


def test_polygons_are_the_solid(tmp_path):
    solid = courtyard()
    root = write_and_read(tmp_path, [make_building(solid)])
    polygons = find(root, "//bldg:boundedBy//gml:Polygon")
    for polygon, face in zip(polygons, solid.faces, strict=True):
        rings = read_rings(find(polygon, ".//gml:posList/text()"))
        assert len(rings) == len(face.rings) == len(find(polygon, "gml:exterior|gml:interior"))
        for ring, indices in zip(rings, face.rings, strict=True):
            expected = solid.vertices[[*indices, indices[0]]] + RD_ORIGIN
            np.testing.assert_allclose(ring, expected, atol=1e-9)


@pytest.mark.parametrize(
    "crs", ["EPSG:2193+7839", "EPSG:2193", "EPSG:3035", "EPSG:2154+5720", "EPSG:25832"]
)
def test_gdal_reads_the_place_also_where_the_crs_counts_north_first(tmp_path, crs):
    write_and_read(tmp_path, [make_building(box(), terrain_intersection=())], crs)
    west, south, east, north = pyogrio.read_info(tmp_path / "a.gml")["total_bounds"]
    assert (west, south, east, north) == (85000.0, 446000.0, 85004.0, 446005.0)


def test_envelope_holds_everything(tmp_path):
    root = write_and_read(tmp_path, street())
    (box_,) = find(root, "/core:CityModel/gml:boundedBy/gml:Envelope")
    assert box_.get("srsName") == "urn:ogc:def:crs,crs:EPSG::28992,crs:EPSG::5709"
    assert box_.get("srsDimension") == "3"
    corners = [np.array(corner.text.split(), float) for corner in box_]
    xyz = np.concatenate(read_rings(find(root, "//gml:posList/text()")))
    np.testing.assert_allclose(corners, [xyz.min(axis=0), xyz.max(axis=0)])


@pytest.mark.parametrize("origin", [(1e7, 1e7, -430.0), (-1e7, 12345678.9, 8848.0)])
def test_far_away_and_under_water(tmp_path, schema, origin):
    root = write_and_read(tmp_path, [make_building(box(), origin=np.array(origin))])
    schema.assertValid(root.getroottree())
    assert find(root, "//bldg:measuredHeight/text()") == ["3.0000"]


@pytest.mark.parametrize("id", ["a", "ä", "1", " ", "", "<&>", "x" * 300, "a:b", "\n"])
def test_any_id_becomes_a_name(id):
    name = "bldg-" + gml_name(id)
    assert (
        etree.fromstring(f"<a xmlns:xml='http://www.w3.org/XML/1998/namespace' xml:id='{name}'/>")
        is not None
    )
    assert all(c.isascii() and (c.isalnum() or c in "_.-") for c in name)


@pytest.mark.parametrize("line", [np.zeros((0, 3)), np.zeros((1, 3)), np.full((4, 3), np.nan)])
def test_a_terrain_intersection_that_is_no_line_is_left_out(tmp_path, schema, line):
    root = write_and_read(tmp_path, [make_building(box(), terrain_intersection=(line,))])
    schema.assertValid(root.getroottree())
    assert find(root, "//bldg:lod1TerrainIntersection | //bldg:lod2TerrainIntersection") == []
