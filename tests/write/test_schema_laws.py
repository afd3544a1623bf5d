"""The rules of CityGML 2.0 and CityJSON 2.0 that readers rely on most, asked without the schemas
themselves.
"""

import json
import re

import pytest
from lxml import etree

from handmade import box, courtyard, gable_house, make_building, make_lost_building
from hiproof.write import write_all

CORE = "{http://www.opengis.net/citygml/2.0}"
BLDG = "{http://www.opengis.net/citygml/building/2.0}"
GEN = "{http://www.opengis.net/citygml/generics/2.0}"
GML = "{http://www.opengis.net/gml}"
XLINK = "{http://www.w3.org/1999/xlink}"
NAME = re.compile(r"[A-Za-z_][\w.-]*\Z")

GENERIC = tuple(
    GEN + kind + "Attribute" for kind in ("string", "int", "double", "date", "uri", "measure")
)
BUILDING_ORDER = (
    (GML + "description", GML + "name", GML + "boundedBy"),
    (CORE + "creationDate", CORE + "terminationDate", CORE + "externalReference"),
    GENERIC,
    *(
        (BLDG + name,)
        for name in (
            "class",
            "function",
            "usage",
            "yearOfConstruction",
            "roofType",
            "measuredHeight",
        )
    ),
    *((BLDG + name,) for name in ("lod1Solid", "lod1TerrainIntersection")),
    *(
        (BLDG + name,)
        for name in ("lod2Solid", "lod2MultiSurface", "lod2MultiCurve", "lod2TerrainIntersection")
    ),
    (BLDG + "boundedBy",),
)
SURFACE_ORDER = ((GML + "description", GML + "name"), GENERIC, (BLDG + "lod2MultiSurface",))
SURFACES = tuple(BLDG + kind for kind in ("RoofSurface", "WallSurface", "GroundSurface"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run's files with a gable, a courtyard, two of one id, ids that XML forbids, and one without
    a model.
    """
    place = tmp_path_factory.mktemp("schema")
    solids = {"a": gable_house(), "yard": courtyard(), "1 b/<c>": box()}
    buildings = [make_building(solid, id) for id, solid in solids.items()]
    write_all(
        place,
        [*buildings, make_building(box(), "yard"), make_lost_building(), make_lost_building("ü")],
        "EPSG:7415",
    )
    return place


@pytest.fixture(scope="module")
def gml(folder):
    return etree.parse(folder / "buildings.gml").getroot()


@pytest.fixture(scope="module")
def sequence(folder):
    header, *features = map(json.loads, (folder / "buildings.city.jsonl").read_text().splitlines())
    return header, features


def in_order(element, order):
    places = [
        next((k for k, group in enumerate(order) if child.tag in group), None) for child in element
    ]
    assert None not in places, [child.tag for child in element]
    assert places == sorted(places)


def test_citygml_elements_stand_in_the_schemas_order(gml):
    assert gml.tag == CORE + "CityModel" and gml[0].tag == GML + "boundedBy"
    assert {child.tag for child in gml[1:]} == {CORE + "cityObjectMember"}
    buildings = list(gml.iter(BLDG + "Building"))
    assert len(buildings) == 6
    for building in buildings:
        in_order(building, BUILDING_ORDER)
    for surface in gml.iter(*SURFACES):
        in_order(surface, SURFACE_ORDER)


def test_citygml_ids_are_names_unique_and_all_references_lead_to_one(gml):
    ids = [element.get(GML + "id") for element in gml.iter() if element.get(GML + "id") is not None]
    assert len(set(ids)) == len(ids) and all(NAME.match(id) for id in ids)
    targets = [element.get(XLINK + "href") for element in gml.iter() if element.get(XLINK + "href")]
    assert (
        targets
        and {target[0] for target in targets} == {"#"}
        and {target[1:] for target in targets} <= set(ids)
    )
    assert all(
        element.get(GML + "id") for element in gml.iter(BLDG + "Building", GML + "Solid", *SURFACES)
    )


def test_citygml_has_its_required_members(gml):
    (envelope,) = gml[0]
    assert envelope.get("srsDimension") == "3" and envelope.get("srsName").startswith(
        "urn:ogc:def:crs"
    )
    assert [child.tag for child in envelope] == [GML + "lowerCorner", GML + "upperCorner"]
    for attribute in gml.iter(*GENERIC):
        assert attribute.get("name") and [child.tag for child in attribute] == [GEN + "value"]
    assert all(height.get("uom") == "m" for height in gml.iter(BLDG + "measuredHeight"))
    assert all(code.get("codeSpace") for code in gml.iter(BLDG + "roofType"))
    for element in gml.iter(BLDG + "boundedBy"):
        assert len(element) == 1 and element[0].tag in SURFACES


def test_citygml_rings_are_closed(gml):
    for ring in gml.iter(GML + "LinearRing"):
        (positions,) = ring
        numbers = [float(number) for number in positions.text.split()]
        assert positions.tag == GML + "posList" and positions.get("srsDimension") == "3"
        assert len(numbers) >= 12 and len(numbers) % 3 == 0 and numbers[:3] == numbers[-3:]
    for polygon in gml.iter(GML + "Polygon"):
        assert [child.tag for child in polygon] == [GML + "exterior"] + [GML + "interior"] * (
            len(polygon) - 1
        )


def test_cityjson_header_has_its_required_members(sequence):
    header, _ = sequence
    assert (header["type"], header["version"], header["CityObjects"], header["vertices"]) == (
        "CityJSON",
        "2.0",
        {},
        [],
    )
    assert set(header["transform"]) == {"scale", "translate"}
    assert (
        all(len(values) == 3 for values in header["transform"].values())
        and min(header["transform"]["scale"]) > 0
    )
    assert len(header["metadata"]["geographicalExtent"]) == 6
    assert re.fullmatch(
        r"https://www\.opengis\.net/def/crs/\w+/\w+/\w+", header["metadata"]["referenceSystem"]
    )


def test_cityjson_features_hold_their_object_and_its_vertices(sequence):
    _, features = sequence
    ids = [feature["id"] for feature in features]
    assert len(set(ids)) == len(ids) == 6
    for feature in features:
        assert feature["type"] == "CityJSONFeature" and set(feature) == {
            "type",
            "id",
            "CityObjects",
            "vertices",
        }
        assert list(feature["CityObjects"]) == [feature["id"]]
        (city_object,) = feature["CityObjects"].values()
        assert city_object["type"] == "Building" and isinstance(city_object["attributes"], dict)
        assert not city_object.keys() & {"parents", "children"}  # both ways or none
        assert all(len(v) == 3 and all(type(c) is int for c in v) for v in feature["vertices"])
        assert len(set(map(tuple, feature["vertices"]))) == len(feature["vertices"])


def test_cityjson_geometries_have_type_lod_boundaries_and_matching_semantics(sequence):
    _, features = sequence
    for feature in features:
        (city_object,) = feature["CityObjects"].values()
        indices = set()
        for geometry in city_object.get("geometry", []):
            assert isinstance(geometry["lod"], str)
            shells = (
                geometry["boundaries"] if geometry["type"] == "Solid" else [geometry["boundaries"]]
            )
            assert geometry["type"] in ("Solid", "MultiSurface")
            rings = [ring for shell in shells for surface in shell for ring in surface]
            # not closed, no repeats
            assert all(len(ring) >= 3 and len(set(ring)) == len(ring) for ring in rings)
            indices |= {index for ring in rings for index in ring}
            if "semantics" in geometry:
                semantics = geometry["semantics"]
                assert set(semantics) == {"surfaces", "values"}
                assert {s["type"] for s in semantics["surfaces"]} <= {
                    "RoofSurface",
                    "WallSurface",
                    "GroundSurface",
                }
                assert [len(values) for values in semantics["values"]] == [
                    len(shell) for shell in shells
                ]
                assert {v for values in semantics["values"] for v in values} == set(
                    range(len(semantics["surfaces"]))
                )
        assert indices == set(range(len(feature["vertices"])))
