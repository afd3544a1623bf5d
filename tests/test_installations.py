"""`--installations`: chimneys and other objects on roofs, in every file, built again."""

import json

import numpy as np
import pytest
from lxml import etree

import hiproof
from gable_at_corner import CORNER, FOOTPRINT, gable_height
from hiproof.errors import InputError
from hiproof.evaluate.models import read_models
from hiproof.parametric.override import overridden, read_override
from hiproof.settings import Settings
from hiproof.write import building_attributes
from hiproof.write.parameters import building_record
from written_run import list_faults

CHIMNEY = (3.0, 2.5, 1.2, 0.8, 8.0)  # middle, sides and top


def scan(*boxes, leaves=0, density=8.0):
    """Points of a gable of 12 by 8 m with boxes on it, and leaves above."""
    rng = np.random.default_rng(100)
    xy = rng.uniform((0, 0), (12, 8), (round(96 * density), 2))
    z = gable_height(xy)
    for x, y, length, width, top in boxes:
        z[(np.abs(xy - [x, y]) <= [length / 2, width / 2]).all(axis=1)] = top
    crown = rng.uniform((6, 3, 8.5), (11, 7, 13), (leaves, 3))
    points = np.vstack([np.column_stack([xy, z + rng.normal(0, 0.03, len(xy))]), crown])
    points[:, :2] += CORNER
    return points


def make_settings(installations):
    return Settings.from_dict(
        {"segment": {"network": "never"}, "reconstruct": {"installations": installations}}
    )


def reconstruct(*boxes, installations=True, id="house", **scanned):
    points = scan(*boxes, **scanned)
    return hiproof.reconstruct(points, FOOTPRINT, None, make_settings(installations), id)


def test_a_chimney_is_a_box_of_its_size():
    house = reconstruct(CHIMNEY, density=20.0)
    (chimney,) = house.model.installations
    assert chimney.type == "chimney"
    place = house.roof.frame.to_world(chimney.position)[:2] - CORNER
    assert place == pytest.approx([3.0, 2.5], abs=0.15)
    assert (chimney.length, chimney.width) == pytest.approx((1.2, 0.8), abs=0.25)
    top = house.roof.frame.origin[2] + chimney.position[2] + chimney.height
    assert top == pytest.approx(8.0, abs=0.1)
    # its base is the lowest roof below it
    assert house.roof.frame.origin[2] + chimney.position[2] == pytest.approx(6.58, abs=0.15)


def test_a_house_has_none_without_the_option_or_without_objects():
    assert reconstruct(CHIMNEY, installations=False).model.installations == ()
    plain = reconstruct()
    assert plain.model.installations == () and "installations" not in building_record(plain)
    assert "hiproof_installations" not in building_attributes(plain)
    with_leaves = reconstruct(leaves=150)
    assert with_leaves.model.installations == ()


def test_a_strip_of_wall_is_no_object():
    wall = (6.0, 2.5, 4.0, 0.3, 8.5)
    assert reconstruct(wall, density=20.0).model.installations == ()


def test_the_roof_is_the_same_with_the_option():
    plain, found = (reconstruct(CHIMNEY, installations=value) for value in (False, True))
    record = building_record(found)
    assert len(record.pop("installations")) == 1
    assert record == building_record(plain)


@pytest.mark.parametrize("parts_as", ["one", "buildingparts"])
def test_every_file_is_valid_and_built_again(tmp_path, parts_as):
    houses = [reconstruct(CHIMNEY, id="a"), reconstruct(id="b")]
    assert [len(house.model.installations) for house in houses] == [1, 0]
    assert list_faults(tmp_path, houses, {"citygml": "both", "parts_as": parts_as}) == []
    lines = (tmp_path / "buildings.city.jsonl").read_text().splitlines()[1:]
    objects = json.loads(lines[0])["CityObjects"]
    assert objects["a"]["children"] == ["a-installation1"]
    installation = objects["a-installation1"]
    assert (installation["type"], installation["parents"]) == ("BuildingInstallation", ["a"])
    assert installation["attributes"]["function"] == "1030"
    assert objects["a"]["attributes"]["hiproof_installations"] == 1
    for name in ("buildings.gml", "buildings.citygml3.gml"):
        installations = etree.parse(tmp_path / name).iter("{*}BuildingInstallation")
        assert [item.findtext("{*}function") for item in installations] == ["1030"]
    assert len(json.loads(lines[1])["CityObjects"]) == 1
    # a model's own solid has no chimney, whatever file it is read from
    for name in ("buildings.gml", "buildings.city.jsonl"):
        assert [b.id.removeprefix("bldg-") for b in hiproof.open_run(tmp_path / name)] == ["a", "b"]
    model = next(read_models(tmp_path / "buildings.city.jsonl"))
    assert model.solid.volume == pytest.approx(houses[0].volume, rel=1e-4)


def test_an_edited_house_keeps_its_chimney():
    house = reconstruct(CHIMNEY)
    assert len(house.with_part(0, eave_height=4.9).model.installations) == 1


def test_a_house_of_given_parts_has_its_chimney():
    house = reconstruct(CHIMNEY)
    override = read_override(building_record(house))
    again = overridden(override, scan(CHIMNEY), FOOTPRINT, None, make_settings(True))
    assert again.model.installations[0].type == "chimney"


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"type": "flag"}, r"\(chimney, roof_object\) as the type of installation 0"),
        ({"parameters": {"width": 1.0}}, "expected length, width, height over 0 as the parameters"),
        ({"colour": "red"}, "got also colour"),
        ({"position": [0, 0]}, "position of installation 0"),
    ],
)
def test_what_makes_no_box_is_one_sentence(change, reason):
    record = building_record(reconstruct(CHIMNEY))
    record["installations"][0] |= change
    with pytest.raises(InputError, match=reason):
        hiproof.build(record)
