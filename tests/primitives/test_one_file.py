"""A primitive is one declaration: every stage knows what `examples/new_primitive.py`
registers, the network's labels left aside.
"""

import runpy
from pathlib import Path

import numpy as np
import pytest
import test_laws as laws

import hiproof
from hiproof.compose import check_solid
from hiproof.draw.primitives import primitive_svg
from hiproof.errors import InputError
from hiproof.learn.data import as_sample
from hiproof.parametric.schema import schema
from hiproof.primitives import CATALOGUE
from hiproof.segment import NOT_ROOF, combine
from hiproof.simulate import ScanSettings, random_building, scan
from hiproof.write.building_attributes import osm_shape
from hiproof.write.citygml.version2 import roof_type_code
from hiproof.write.colours import ROOF_COLOURS, type_colour
from hiproof.write.parameters import building_record

EXAMPLE = Path(__file__).parents[2] / "examples" / "new_primitive.py"
NAME = "curb_lean_to"


@pytest.fixture(scope="module", autouse=True)
def curb():
    """The example's shape, which asserts that `fit_roof` finds it, in the catalogue while these
    tests run.
    """
    runpy.run_path(str(EXAMPLE))
    yield CATALOGUE[NAME]
    del CATALOGUE[NAME]


@pytest.fixture(scope="module")
def house_and_points():
    """A made-up building of that type and the points on its roof."""
    rng = np.random.default_rng(3)
    building = random_building(rng, NAME)
    cloud = scan(building, rng, ScanSettings(density=8.0))
    return building, cloud.points[cloud.label == list(CATALOGUE).index(NAME)]


@pytest.fixture(scope="module")
def house(house_and_points):
    building, points = house_and_points
    return hiproof.reconstruct(points, building.footprint)


def test_it_obeys_the_laws_of_all_shapes(curb):
    inherited = [
        law
        for law in vars(laws).values()
        if laws.each_variant.mark in getattr(law, "pytestmark", [])
    ]
    assert len(inherited) >= 6
    for law in inherited:
        law(curb)


def test_it_is_simulated(house_and_points, curb):
    building, points = house_and_points
    assert building.type == NAME and set(building.parameters) == set(curb.parameters)
    assert len(points) > 4 * building.outline.area
    rng = np.random.default_rng(0)
    sample = as_sample(scan(building, rng, ScanSettings(density=5.0)), ("flat", NAME), 1, rng)
    assert set(np.unique(sample.labels)) == {NOT_ROOF, 1}


@pytest.mark.parametrize("parts", ["one", "compound"])
@pytest.mark.parametrize("types", [(), (NAME,)])
def test_it_is_found_as_a_whole_and_as_a_union_of_volumes(house_and_points, parts, types):
    building, points = house_and_points
    settings = hiproof.Settings.from_dict({"fit": {"parts": parts, "types": list(types)}})
    model = hiproof.reconstruct(points, building.footprint, settings=settings)
    assert [part.type for part in model.parts] == [NAME]
    assert not check_solid(model.solid)
    for name, value in building.parameters.items():
        assert model.parts[0].parameters[name] == pytest.approx(value, abs=0.3), name


def test_it_is_built_from_what_is_written(house):
    record = building_record(house)
    rebuilt = hiproof.build(record)
    assert np.array_equal(rebuilt.solid.vertices, house.solid.vertices)
    defs = schema()["$defs"]["part"]
    assert NAME in defs["properties"]["type"]["enum"]
    assert NAME in [rule["if"]["properties"]["type"]["const"] for rule in defs["allOf"]]
    del record["parts"][0]["parameters"]["break_height"]
    sentence = r"expected the parameters .*break_height of the type curb_lean_to"
    with pytest.raises(InputError, match=sentence):
        hiproof.build(record)


def test_it_is_edited_and_refitted(house, house_and_points):
    _, points = house_and_points
    gable = house.with_part(0, type="gable")
    back = gable.with_part(
        0, type=NAME, ridge_height=house.parts[0].translation[2] + house.roof.frame.origin[2] + 3.0
    )
    assert back.parts[0].type == NAME
    assert back.parts[0].parameters["height"] == pytest.approx(3.0, abs=1e-6)
    fitted = house.with_part(0, height=house.parts[0].parameters["height"] + 0.4).refit(points)
    for name, value in house.parts[0].parameters.items():
        assert fitted.parts[0].parameters[name] == pytest.approx(value, abs=0.1), name


def test_it_is_drawn_written_and_weighed(curb):
    assert all(f">{name}" in primitive_svg(NAME) for name in curb.parameters)
    assert type_colour(NAME) == ROOF_COLOURS[curb.legend] and osm_shape(NAME) == curb.osm_shape
    assert roof_type_code([NAME]) == curb.citygml_code
    assert roof_type_code([NAME], "adv") == curb.adv_code
    assert (
        next(iter(combine({"monopitch": 0.9, "gable": 0.1}, {NAME: 100.0, "gable": 400.0}))) == NAME
    )
