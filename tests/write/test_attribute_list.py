"""Every attribute that is written is declared with unit and meaning, and the documents list it."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

import parametric_house
from handmade import box, gable_house, make_building, make_lost_building
from hiproof.cli.attributes import attributes as print_attributes
from hiproof.evaluate.evaluation import BuildingFigures, Comparison
from hiproof.frames import METRES, Units
from hiproof.model import ROOF
from hiproof.model.roof_figures import roof_figures
from hiproof.primitives import CATALOGUE
from hiproof.primitives.family import COMPONENTS
from hiproof.primitives.parameters import list_parameters, list_side_parameters
from hiproof.write.attribute_list import OWN, PREFIX, TABLES
from hiproof.write.building_attributes import (
    ONE_ENDED,
    building_attributes,
    measure_figures,
    osm_tags,
)
from hiproof.write.parameters import FileHead, building_record, head_record
from written_run import write_all

DOCUMENT = Path(__file__).parents[2] / "docs/attributes.md"
KINDS = {"number": (int, float), "count": int, "text": str}


def names(table, prefix=""):
    return [prefix + name for name in TABLES[table].names]


def test_the_document_is_current(capsys):
    print_attributes()
    assert DOCUMENT.read_text() == capsys.readouterr().out


def test_everything_is_explained():
    for table in TABLES.values():
        assert len(set(table.names)) == len(table.attributes)
        assert all(attribute.meaning and attribute.kind for attribute in table.attributes)


PLACE = {"kind": "roof_raised", "difference": 1.0, "sigma": 0.1, "area": 9.0, "parts": [0]}
CHANGED = {
    "class": "changed",
    "survey": "2024-05-01",
    "chance": 1e-9,
    "places": [PLACE | {"outlines": []}],
    "lineage": [],
    "predecessors": [],
    "valid_from": "2024-05-01",
    "valid_to": None,
    "history": [],
}
# keys that only some buildings have
FURTHER = """installations passages walls overhangs roof_thickness footprint_kind volume_lod23
survey_date epochs_used"""
FURTHER = set(FURTHER.split())
OF_A_CHANGE = {"change", "change_kind", "change_m", "change_sigma_m", "valid_from", "valid_to"}


def change_building(building):
    return replace(building, change=CHANGED)


def test_buildings_have_the_attributes_declared():
    feet, prefixes = Units(0.3048, 0.3048, "foot", "foot"), {"roofer": PREFIX, "hiproof": OWN}
    sound = make_building(gable_house())
    declared = {name for table, prefix in prefixes.items() for name in names(table, prefix)}
    declared -= {OWN + name for name in FURTHER}
    for building in (sound, make_lost_building(), change_building(sound)):
        result = building_attributes(building, measure_figures(building), units=feet)
        absent = {OWN + name for name in OF_A_CHANGE if building.change is None}
        assert set(result) - set(building.attributes) == declared - absent
        for table, prefix in prefixes.items():
            for attribute in TABLES[table].attributes:
                value = result.get(prefix + attribute.name)
                assert value is None or isinstance(value, KINDS[attribute.kind]), attribute.name
    assert OWN + "units" not in building_attributes(make_lost_building(), None, units=METRES)


def test_validity_stands_under_our_own_name_only():
    house = make_building(gable_house())
    attributes = building_attributes(house, measure_figures(house))
    assert attributes["hiproof_iso19107_lod22"] == "[]"
    assert building_attributes(make_lost_building())["hiproof_iso19107_lod22"] is None
    assert not any("val3dity" in name for name in attributes)


def test_roof_surfaces_parameters_and_tables_are_as_declared(tmp_path):
    house = make_building(gable_house())
    write_all(tmp_path, [house])
    feature = json.loads((tmp_path / "buildings.city.jsonl").read_text().splitlines()[1])
    (city_object,) = feature["CityObjects"].values()
    solids = [g for g in city_object["geometry"] if g["type"] == "Solid"]
    keys = {key for g in solids for surface in g["semantics"]["surfaces"] for key in surface}
    assert keys - {"type"} == set(names("roof_surface"))
    record, changed = building_record(house), building_record(change_building(house))
    usual = [name for name in names("building") if name not in FURTHER]
    assert list(record) == [name for name in usual if name != "change"]
    assert list(changed) == usual
    assert list(changed["change"]) == names("change")
    assert list(changed["change"]["places"][0]) == names("change_place")
    assert list(record["parts"][0]) == names("part")
    assert list(head_record(FileHead())) == [name for name in names("head") if name != "update"]
    row = BuildingFigures("a", "gable", "modelled", comparison=Comparison("b")).row()
    assert sorted(row) == sorted(names("evaluation"))


def test_the_table_of_parts_has_a_column_for_every_parameter():
    for kind in CATALOGUE:
        side_by_side = () if kind in COMPONENTS else list_side_parameters(kind)
        assert {*list_parameters(kind), *side_by_side} <= set(names("parts"))


# The values that OpenStreetMap's page of roof:shape documents for roofs of planes.
DOCUMENTED = """flat skillion gabled gabled_height_moved hipped half-hipped side_hipped
side_half-hipped pyramidal mansard gambrel sawtooth cone dome onion round saltbox double_saltbox
quadruple_saltbox"""
NO_TAGS = dict.fromkeys(TABLES["osm"].names)


def make_tags(building):
    return osm_tags(building, roof_figures(building.solid))


def make_turned_house(degrees, type="gable"):
    """A house of 12 by 8 m whose length lies `degrees` from east."""
    house = parametric_house.gable_house(degrees)
    return house if type == "gable" else house.with_part(0, type=type)


def measure_angle(first, second):
    """The angle between two compass directions."""
    return abs((first - second + 180) % 360 - 180)


def test_every_roof_type_has_a_documented_shape():
    assert {shape.osm_shape for shape in CATALOGUE.values()} == set(DOCUMENTED.split())


@pytest.mark.parametrize("degrees", [0, 35, 90, 200])
def test_a_gable_is_told_in_degrees_and_metres(degrees):
    tags = make_tags(make_turned_house(degrees))
    assert tags["roof:shape"] == "gabled"
    assert tags["roof:angle"] == pytest.approx(math.degrees(math.atan(0.75)), abs=0.01)
    assert tags["roof:height"] == pytest.approx(3, abs=0.01)
    assert tags["height"] == pytest.approx(8, abs=0.01)
    # the compass direction across a ridge that lies `degrees` from east
    ways = (-degrees, 180 - degrees)
    assert min(measure_angle(tags["roof:direction"], way) for way in ways) < 0.01


@pytest.mark.parametrize("name", ONE_ENDED)
@pytest.mark.parametrize("degrees", [0, 35, 200])
def test_a_roof_with_one_hipped_end_looks_that_way(name, degrees):
    house = make_turned_house(degrees, name)
    figures = roof_figures(house.solid)
    roofs = [i for i, face in enumerate(house.solid.faces) if face.kind == ROOF]
    end = min(roofs, key=lambda i: figures.face_area_m2[i])
    assert measure_angle(make_tags(house)["roof:direction"], figures.face_azimuth_deg[end]) < 0.01


def test_a_flat_roof_looks_nowhere():
    tags = make_tags(make_building(box(), kinds=("flat",)))
    nowhere = {"roof:shape": "flat", "roof:height": 0.0, "roof:direction": None}
    assert tags == nowhere | {"roof:angle": 0.0, "height": 3.0}


def test_of_several_parts_the_largest_counts():
    lean_to = {"width": 3, "length": 3, "height": 1}
    house = make_turned_house(0).with_part(1, type="monopitch", position=[-4.5, 2.5, 2], **lean_to)
    assert make_tags(house)["roof:shape"] == "gabled"


def test_without_a_model_there_are_no_tags():
    assert osm_tags(make_lost_building(), None) == NO_TAGS
    assert make_tags(make_building(box(), kinds=("free",)))["roof:shape"] is None


def test_tags_stand_among_the_attributes_only_where_asked_for():
    house = make_building(box(), kinds=("flat",), attributes={"height": "tall", "name": "x"})
    figures = roof_figures(house.solid)
    assert building_attributes(house, figures)["height"] == "tall"
    tagged = building_attributes(house, figures, osm=True)
    assert tagged["height"] == 3.0 and tagged["roof:shape"] == "flat" and tagged["name"] == "x"
