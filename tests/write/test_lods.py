"""Levels of detail, building parts and what GIS programs see of the files."""

import json
import re
import sqlite3
from dataclasses import asdict, replace

import numpy as np
import pyogrio
import pytest
import shapely
from lxml import etree

from handmade import RD_ORIGIN, gable_house, make_building, make_lost_building
from hiproof.compose import check_solid, compose
from hiproof.evaluate.models import read_models
from hiproof.frames import LocalFrame
from hiproof.geometry.rings import ring_normal
from hiproof.model import GROUND, ROOF, Building, Model, Part, Piece, Quality, Roof
from hiproof.parametric.finished import open_run
from hiproof.parametric.run import build_file
from hiproof.read.models.solids import read_solids
from hiproof.settings import WriteSettings
from hiproof.status import Status
from hiproof.write import (
    FileHead,
    roof_figures,
    write_attributes,
    write_citygml,
    write_cityjson,
    write_parameters,
)
from hiproof.write.citygml.version2 import CODE_SPACES, NAMESPACES, CityGMLWriter
from hiproof.write.citygml.version3 import CityGML3Writer
from hiproof.write.colours import ROOF_COLOURS, list_legend, type_colour
from hiproof.write.tables.styles import STYLES, TABLE
from written_run import list_faults

ALL = ("0", "1.2", "1.3", "2.2")
WHOLE = WriteSettings(lods=ALL)
IN_PARTS = WriteSettings(lods=ALL, parts_as="buildingparts", roof_codes="adv")


def terrace(id="terrace"):
    """A gable beside a lower flat roof, which meet at a wall."""
    slopes, level = np.array([[0.0, 0.5, 4.0], [0.0, -0.5, 8.0]]), np.array([[0.0, 0.0, 3.0]])
    size = {"width": 8.0, "length": 6.0, "height": 2.0}
    pieces = Piece(shapely.box(0, 0, 6, 8), slopes), Piece(shapely.box(6, 0, 10, 8), level)
    gable = Part("gable", pieces[:1], size, 0.0, np.array([3.0, 4.0, 4.0]))
    flat = Part("flat", pieces[1:], {}, 0.0, np.array([8, 4, 3.0]))
    roof = Roof((gable, flat), shapely.box(0, 0, 10, 8), LocalFrame(RD_ORIGIN))
    line = np.array([[0, 0, 0.2], [10, 0, 0.0], [10, 8, 0.1], [0, 0, 0.2]]) + RD_ORIGIN
    model, quality = Model(roof, compose(roof, 0.0).move(RD_ORIGIN)), Quality(points=99)
    return Building(id, Status.MODELLED, "", model, quality, 0.0, "ground class", (line,))


def gml(tmp_path, buildings, write):
    write_citygml(tmp_path / "a.gml", buildings, "EPSG:7415", write=write)
    return etree.parse(tmp_path / "a.gml").getroot()


def find(root, path):
    return root.xpath(path, namespaces=NAMESPACES)


def objects(tmp_path, buildings, write, name="a.city.jsonl"):
    """CityObjects of all features by id."""
    write_cityjson(tmp_path / name, buildings, "EPSG:7415", write=write)
    features = map(json.loads, (tmp_path / name).read_text().splitlines()[1:])
    return {id: value for feature in features for id, value in feature["CityObjects"].items()}


def lods(city_object):
    return [geometry["lod"] for geometry in city_object.get("geometry", [])]


@pytest.mark.parametrize("write", [WriteSettings(), WHOLE, IN_PARTS])
def test_all_that_is_written_is_valid(tmp_path, write):
    assert list_faults(tmp_path, [terrace("a"), terrace("b")], asdict(write)) == []
    write_cityjson(tmp_path / "a.city.json", [terrace()], "EPSG:7415", write=write)
    ((_, solid), *_) = read_solids(tmp_path / "a.city.json")
    assert check_solid(solid, 0.01) == ()


@pytest.mark.parametrize(
    ("shift", "lower", "upper"), [((0, 0), (0, 0), (10, 8)), ((1.5, -0.5), (-1.5, 0), (10, 8.5))]
)
def test_the_envelope_holds_a_footprint_that_was_moved(tmp_path, shift, lower, upper):
    root = gml(tmp_path, [replace(terrace(), shift=shift)], WHOLE)
    corners = [np.array(text.split(), float)[:2] for text in find(root, "//gml:Envelope/*/text()")]
    np.testing.assert_allclose(corners, RD_ORIGIN[:2] + np.array([lower, upper]))


def test_levels_of_detail_have_the_heights_that_the_rule_says(tmp_path):
    building = terrace()
    figures = roof_figures(building.solid)
    city_object = objects(tmp_path, [building], WHOLE)["terrace"]
    assert lods(city_object) == ["0", "0", "1.2", "1.3", "2.2"]
    semantics = [geometry["semantics"]["surfaces"][0] for geometry in city_object["geometry"][:2]]
    assert [surface["type"] for surface in semantics] == ["GroundSurface", "RoofSurface"]
    block, steps, roof = (solid for _, solid in read_solids(tmp_path / "a.city.jsonl"))
    assert block.volume == pytest.approx(80 * figures.h_70p, rel=1e-4)
    # of a gable's heights over the plan, which are spread evenly from eave to ridge
    gable_70p = 6.0 - 2.0 * 0.3
    assert steps.volume == pytest.approx(48 * gable_70p + 32 * 3.0, rel=1e-3)
    assert roof.volume == pytest.approx(48 * 5.0 + 32 * 3.0, rel=1e-4)


def test_citygml_has_each_level_in_its_property(tmp_path):
    root = gml(tmp_path, [terrace()], WHOLE)

    def list_heights(name):
        rings = find(root, f"//bldg:{name}//gml:posList/text()")
        return {z for ring in rings for z in ring.split()[2::3]}

    for name in ("lod0FootPrint", "lod0RoofEdge", "lod1Solid", "lod2Solid"):
        assert len(find(root, f"//bldg:Building/bldg:{name}")) == 1
    assert list_heights("lod0FootPrint") == {"0.0000"}
    assert list_heights("lod0RoofEdge") == {f"{roof_figures(terrace().solid).h_eave:.4f}"}
    # the finer LoD1: the two blocks' tops
    tops = sorted(map(float, list_heights("lod1Solid")))
    assert tops == pytest.approx([0.0, 3.0, 5.4], abs=0.01)


def test_eaves_are_where_roofs_end():
    assert roof_figures(gable_house(eave=3.0, ridge=7.0)).h_eave == pytest.approx(3.0, abs=1e-3)
    # a quantile by area: 48 m2 of the gable, 32 m2 of the flat roof, whose edges are longer
    assert roof_figures(terrace().solid).h_eave == pytest.approx(4.0, abs=1e-3)


def test_building_parts_have_solids_types_heights_and_parameters(tmp_path):
    by_id = objects(tmp_path, [terrace()], IN_PARTS)
    whole, gable, flat = by_id["terrace"], by_id["terrace-part1"], by_id["terrace-part2"]
    assert whole["children"] == ["terrace-part1", "terrace-part2"]
    assert gable["parents"] == flat["parents"] == ["terrace"]
    assert lods(whole) == ["0", "0", "1.2"] and lods(gable) == lods(flat) == ["1.3", "2.2"]
    assert gable["attributes"]["rf_volume_lod22"] == pytest.approx(240.0)
    assert flat["attributes"]["rf_h_roof_max"] == 3.0
    (primitive,) = gable["attributes"]["hiproof_primitives"]
    expected = {"type": "gable", "width": 8.0, "height": 2.0, "z_eave": 4.0}
    assert {name: primitive[name] for name in expected} == expected
    root = gml(tmp_path, [terrace()], IN_PARTS)
    parts = find(root, "//bldg:consistsOfBuildingPart/bldg:BuildingPart")
    assert [find(part, "bldg:roofType/text()") for part in parts] == [["3100"], ["1000"]]
    heights = [find(part, "bldg:measuredHeight/text()") for part in parts]
    assert heights == [["6.0000"], ["3.0000"]]
    assert set(find(root, "//bldg:roofType/@codeSpace")) == {CODE_SPACES["adv"]}
    width = "gen:genericAttributeSet/gen:doubleAttribute[@name='width']/gen:value/text()"
    assert find(parts[0], width) == ["8.0"]
    ids = find(root, "//@gml:id")
    assert len(set(ids)) == len(ids)


@pytest.mark.parametrize("write", [WHOLE, IN_PARTS], ids=["whole", "parts"])
def test_whoever_reads_models_gets_the_whole_building_at_its_finest(tmp_path, write):
    building = terrace()
    objects(tmp_path, [building, make_building(gable_house(), "house")], write)
    model, house = read_models(tmp_path / "a.city.jsonl")
    assert (model.id, house.id) == ("terrace", "house")
    assert check_solid(model.solid, 0.01) == ()
    assert model.solid.volume == pytest.approx(building.solid.volume, rel=1e-4)
    for face in model.solid.select_faces(ROOF):
        x, y, z = ring_normal(model.solid.vertices[list(face.rings[0])])
        assert model.part_types[face.part] == ("gable" if np.hypot(x, y) > 0.1 * z else "flat")


def test_a_files_head_says_how_it_is_drawn_and_a_build_obeys_it_or_options(tmp_path):
    one, two, three = (tmp_path / name for name in ("one", "two", "three"))
    write_parameters(tmp_path / "p.jsonl", [terrace()], head=FileHead("EPSG:7415", write=IN_PARTS))
    build_file(tmp_path / "p.jsonl", one)
    build_file(one / "parameters.jsonl", two)
    for name in ("buildings.gml", "buildings.city.jsonl", "parameters.jsonl", "buildings.gpkg"):
        assert (one / name).read_bytes() == (two / name).read_bytes(), name
    assert b"BuildingPart" in (two / "buildings.city.jsonl").read_bytes()
    changes = {"write": {"parts_as": "one", "lods": ["1.2"]}}
    build_file(tmp_path / "p.jsonl", three, changes=changes)
    (feature,) = (three / "buildings.city.jsonl").read_text().splitlines()[1:]
    (city_object,) = json.loads(feature)["CityObjects"].values()
    assert lods(city_object) == ["0", "1.2"]


@pytest.mark.parametrize("write", [WriteSettings(), WHOLE], ids=["default", "all levels"])
def test_gdal_reads_a_building_as_its_surfaces(tmp_path, write):
    solid = terrace().solid
    root = gml(tmp_path, [terrace(), make_building(gable_house(), "house")], write)
    assert len(find(root, "//bldg:lod1TerrainIntersection")) == 2
    assert pyogrio.read_info(tmp_path / "a.gml")["geometry_type"] == "MultiPolygon Z"
    _, _, shapes, _ = pyogrio.raw.read(tmp_path / "a.gml")
    faces = shapely.get_parts(shapely.from_wkb(shapes[0]))
    assert len(faces) == len(solid.faces)
    heights = shapely.get_coordinates(faces, include_z=True)[:, 2]
    assert max(heights) == solid.vertices[:, 2].max()


def test_without_surfaces_by_value_the_line_is_that_of_the_solids_level(tmp_path):
    root = gml(tmp_path, [terrace()], WriteSettings(gml_surfaces=False))
    assert len(find(root, "//bldg:lod2TerrainIntersection")) == 1
    assert (
        find(root, "//bldg:Building/bldg:lod2MultiSurface | //bldg:lod1TerrainIntersection") == []
    )
    bare = gml(tmp_path, [terrace()], WriteSettings(terrain_intersection=False))
    assert find(bare, "//bldg:lod1TerrainIntersection | //bldg:lod2TerrainIntersection") == []


def test_a_geopackage_is_of_an_old_version_and_brings_a_style_for_each_layer(tmp_path):
    path, columns = tmp_path / "a.gpkg", "f_table_name, f_geometry_column, useAsDefault, styleQML"
    write_attributes(path, [terrace(), make_lost_building()], "EPSG:7415")
    with sqlite3.connect(path) as file:
        assert file.execute("pragma user_version").fetchone() == (10200,)
        styles = file.execute(f"select {columns} from {TABLE}").fetchall()
        kind, entry = file.execute(f"select type, {STYLES[1].expression} from parts").fetchone()
    assert entry == list_legend(kind) and ROOF_COLOURS[entry] == type_colour(kind)
    expected = [(style.layer, "geom", int(style.is_default)) for style in STYLES]
    assert [row[:3] for row in styles] == expected
    layers = [name for name, _ in pyogrio.list_layers(path) if name != TABLE]
    assert [style.layer for style in STYLES if style.is_default] == layers
    for (name, _, _, qml), style in zip(styles, STYLES, strict=True):
        renderer = etree.fromstring(qml.encode()).find("renderer-v2")
        columns = set(re.findall('"([^"]+)"', renderer.get("attr"))) or {renderer.get("attr")}
        assert columns <= set(pyogrio.read_info(path, layer=name)["fields"])
        assert len(renderer.findall("symbols/symbol")) == len(style.colours)


@pytest.mark.parametrize(
    ("lods", "grounds"), [(("0",), 0), (("0", "1.2"), 1), (("1.3",), 1), (("2.2",), 1)]
)
def test_a_building_in_parts_is_read_as_one_shell_at_every_level(tmp_path, lods, grounds):
    write = replace(IN_PARTS, lods=lods)
    write_cityjson(tmp_path / "buildings.city.jsonl", [terrace()], "EPSG:7415", write=write)
    (building,) = open_run(tmp_path)
    assert len(building.solid.select_faces(GROUND) if building.built else ()) == grounds


@pytest.mark.parametrize("kind", [CityGMLWriter, CityGML3Writer])
def test_footprints_and_roof_edges_are_no_solids_to_be_checked(tmp_path, kind):
    head = FileHead("EPSG:7415", write=WriteSettings(lods=("0",)))
    kind(tmp_path / "a.gml", head).add_all([terrace()])
    assert list(read_solids(tmp_path / "a.gml")) == []
