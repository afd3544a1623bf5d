"""All facets of one curved roof are one surface in every file, and each is a polygon of it."""

import dataclasses
import itertools
import json
from collections import Counter

import numpy as np
import pytest
import shapely
from lxml import etree

import hiproof
from hiproof.primitives import CATALOGUE
from hiproof.write import roof_figures
from hiproof.write.citygml.version2 import NAMESPACES
from hiproof.write.surfaces import join_values, number_surfaces
from written_run import list_faults, require_json_schema, write_all

GML_ID = f"{{{NAMESPACES['gml']}}}id"
HEIGHT_M, WIDTH_M = 3.0, 6.0


def build_tower(kind="cone"):
    """Build a flat block with a curved roof on a round tower."""
    shape, place = CATALOGUE[kind], [10.0, 5.0, 8.0]
    parameters = shape.typical(WIDTH_M, WIDTH_M, HEIGHT_M)
    theta = shape.to_theta(parameters, 0.0, place)
    plan = shape.variant(parameters).part(theta, {"height": 0.1}).pieces[0].outline
    block = shapely.box(0.0, 0.0, 20.0, 10.0)
    flat = {"type": "flat", "parameters": {}, "position": [0, 0, 5]}
    top = {"type": kind, "parameters": parameters, "position": place}
    parts = [flat | {"outlines": [rings(block - plan)]}, top | {"outlines": [rings(plan)]}]
    place = {"origin": [85000, 446000, 2], "outline": rings(block), "z_ground": 2}
    return hiproof.build({"id": kind, **place, "parts": parts})


def count_polygons(surface):
    return len(find(surface, ".//gml:Polygon"))


def rings(polygon):
    return [shapely.get_coordinates(r).tolist() for r in (polygon.exterior, *polygon.interiors)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("curved")
    write_all(place, [build_tower("cone"), build_tower("broach")], "EPSG:7415")
    return place


def find(element, path):
    return element.xpath(path, namespaces=NAMESPACES)


def test_facets_of_a_cone_are_one_roof_surface_of_citygml(folder):
    root = etree.parse(folder / "buildings.gml").getroot()
    surfaces = [find(building, ".//bldg:RoofSurface") for building in find(root, "//bldg:Building")]
    cone, broach = (sorted(roof, key=count_polygons) for roof in surfaces)
    assert [[count_polygons(s) for s in roof] for roof in (cone, broach)] == [[1, 16], [1] * 9]
    slope = find(cone[-1], "./gen:doubleAttribute[@name='slope']/gen:value/text()")
    apothem = CATALOGUE["cone"].rim[0][0] * WIDTH_M / 2
    assert float(slope[0]) == pytest.approx(np.degrees(np.arctan2(HEIGHT_M, apothem)), abs=0.1)
    assert not find(cone[-1], "./gen:doubleAttribute[@name='azimuth']")


def test_every_link_of_the_solid_leads_to_a_polygon(folder):
    root = etree.parse(folder / "buildings.gml").getroot()
    ids = Counter(element.get(GML_ID) for element in root.iter() if element.get(GML_ID))
    links = find(root, "//bldg:lod2Solid//@xlink:href")
    assert set(ids.values()) == {1}
    assert {link[1:] for link in links} == set(find(root, "//bldg:boundedBy//gml:Polygon/@gml:id"))


def test_files_with_curved_surfaces_are_valid(tmp_path, folder):
    assert list_faults(tmp_path, [build_tower("cone"), build_tower("broach")], {}) == []
    validator = require_json_schema("cityjsonfeature.min.schema.json")
    _, *features = read_lines(folder)
    assert [error.message for item in features for error in validator.iter_errors(item)] == []


def read_lines(folder):
    text = (folder / "buildings.city.jsonl").read_text("utf-8")
    return [json.loads(line) for line in text.splitlines()]


def test_facets_of_a_cone_refer_to_one_surface_of_cityjson(folder):
    _, cone, broach = read_lines(folder)
    numbers = []
    for feature in (cone, broach):
        geometries = feature["CityObjects"][feature["id"]]["geometry"]
        (semantics,) = (g["semantics"] for g in geometries if g["type"] == "Solid")
        surfaces, values = semantics["surfaces"], semantics["values"][0]
        roofs = [value for value in values if surfaces[value]["type"] == "RoofSurface"]
        numbers.append(sorted(Counter(roofs).values()))
        curved = [s for s in surfaces if s.get("hiproof_part_type") == feature["id"]]
        assert all(surface["hiproof_part"] == 1 for surface in curved)
    assert numbers == [[1, 16], [1] * 9]


def test_rows_of_facets_have_one_number(folder):
    pyogrio = pytest.importorskip("pyogrio")
    table = pyogrio.read_dataframe(
        folder / "buildings.gpkg", layer="roof_surfaces", read_geometry=False
    )
    of_cone = table[(table.building_id == "cone") & (table.type == "cone")]
    of_broach = table[(table.building_id == "broach") & (table.type == "broach")]
    assert (len(of_cone), of_cone.number.nunique()) == (16, 1)
    assert (len(of_broach), of_broach.number.nunique()) == (8, 8)


def test_values_of_facets_are_joined_by_area():
    building = build_tower()
    figures = roof_figures(building.solid)
    numbers = number_surfaces(building.solid.faces, building.parts)
    facets = [face for face, number in enumerate(numbers) if numbers.count(number) > 1]
    values = {face: {"sun_kwh_m2": 1000.0, "pv_kwh": 5.0} for face in facets}
    values[facets[0]]["sun_kwh_m2"] = 2000.0
    joined = join_values(values, numbers, figures)
    share = figures.face_area_m2[facets[0]] / figures.face_area_m2[facets].sum()
    assert list(joined) == [facets[0]]
    assert joined[facets[0]]["pv_kwh"] == pytest.approx(5.0 * len(facets))
    assert joined[facets[0]]["sun_kwh_m2"] == pytest.approx(1000.0 * (1.0 + share), abs=1e-3)


def test_planar_faces_stay_surfaces_of_their_own():
    building = build_tower("broach")
    faces = building.solid.faces
    assert number_surfaces(faces, building.parts) == list(range(len(faces)))
    values = {face: {"sun_kwh_m2": float(face)} for face in range(len(faces))}
    figures = roof_figures(building.solid)
    assert join_values(values, list(range(len(faces))), figures) == values
    half = dataclasses.replace(building.parts[1], type="cone")
    assert len(set(number_surfaces(faces, (building.parts[0], half)))) == len(faces) - 7
    assert all(a <= b for a, b in itertools.pairwise(number_surfaces(faces, building.parts)))
