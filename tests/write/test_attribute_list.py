"""Every attribute that is written is declared, with unit and meaning, and the documents
list them.
"""

import json
from dataclasses import replace
from pathlib import Path

from handmade import gable_house, make_building, make_lost_building
from hiproof.cli.attributes import attributes as print_attributes
from hiproof.evaluate.evaluation import BuildingFigures, Comparison
from hiproof.frames import METRES, Units
from hiproof.primitives import CATALOGUE
from hiproof.primitives.family import COMPONENTS
from hiproof.primitives.parameters import list_parameters, list_side_parameters
from hiproof.write.attribute_list import OWN, PREFIX, TABLES
from hiproof.write.building_attributes import building_attributes, measure_figures
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


PLACE = {
    "kind": "roof_raised",
    "difference": 1.0,
    "sigma": 0.1,
    "area": 9.0,
    "parts": [0],
    "outlines": [],
}
CHANGED = {
    "class": "changed",
    "survey": "2024-05-01",
    "chance": 1e-9,
    "places": [PLACE],
    "lineage": [],
    "predecessors": [],
    "valid_from": "2024-05-01",
    "valid_to": None,
    "history": [],
}
FURTHER = {
    *("installations", "passages", "walls", "overhangs", "roof_thickness", "footprint_kind"),
    *("volume_lod23", "survey_date", "epochs_used"),
}  # keys that only some buildings have
OF_A_CHANGE = {"change", "change_kind", "change_m", "change_sigma_m", "valid_from", "valid_to"}


def change_building(building):
    return replace(building, change=CHANGED)


def test_buildings_have_the_attributes_declared():
    feet = Units(0.3048, 0.3048, "foot", "foot")
    sound = make_building(gable_house())
    further = {OWN + name for name in FURTHER}
    declared = {*names("roofer", PREFIX), *names("hiproof", OWN)} - further
    of_a_change = {OWN + name for name in OF_A_CHANGE}
    for building in (sound, make_lost_building(), change_building(sound)):
        result = building_attributes(building, measure_figures(building), units=feet)
        added = set(result) - set(building.attributes)
        assert added == (declared - of_a_change if building.change is None else declared)
        for attribute, prefix in (
            (a, p)
            for name, p in (("roofer", PREFIX), ("hiproof", OWN))
            for a in TABLES[name].attributes
        ):
            value = result.get(prefix + attribute.name)
            assert value is None or isinstance(value, KINDS[attribute.kind]), attribute.name
    assert OWN + "units" not in building_attributes(make_lost_building(), None, units=METRES)


def test_validity_stands_under_our_own_name_only():
    attributes = building_attributes(
        make_building(gable_house()), measure_figures(make_building(gable_house()))
    )
    assert attributes["hiproof_iso19107_lod22"] == "[]"
    assert building_attributes(make_lost_building())["hiproof_iso19107_lod22"] is None
    assert not any("val3dity" in name for name in attributes)


def test_roof_surfaces_parameters_and_tables_are_as_declared(tmp_path):
    write_all(tmp_path, [make_building(gable_house())])
    feature = json.loads((tmp_path / "buildings.city.jsonl").read_text().splitlines()[1])
    (city_object,) = feature["CityObjects"].values()
    surfaces = [
        s
        for g in city_object["geometry"]
        if g["type"] == "Solid"
        for s in g["semantics"]["surfaces"]
    ]
    assert {key for s in surfaces for key in s} - {"type"} == set(names("roof_surface"))
    record = building_record(make_building(gable_house()))
    usual = [name for name in names("building") if name not in FURTHER]
    assert list(record) == [name for name in usual if name != "change"]
    changed = building_record(change_building(make_building(gable_house())))
    assert list(changed) == usual
    assert list(changed["change"]) == names("change")
    assert list(changed["change"]["places"][0]) == names("change_place")
    assert list(record["parts"][0]) == names("part")
    assert list(head_record(FileHead())) == [name for name in names("head") if name != "update"]
    row = BuildingFigures("a", "gable", "modelled", comparison=Comparison("b")).row()
    assert sorted(row) == sorted(names("evaluation"))


def test_the_table_of_parts_has_a_column_for_every_parameter():
    parameters = {
        parameter
        for kind in CATALOGUE
        for parameter in (*list_parameters(kind), *side_by_side_or_none(kind))
    }
    assert parameters <= set(names("parts"))


def side_by_side_or_none(kind):
    return () if kind in COMPONENTS else list_side_parameters(kind)
