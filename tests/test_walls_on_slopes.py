"""`--walls terrain`: houses on slopes have their visible walls, in every file, built again."""

import json
import re

import numpy as np
import pytest

import hiproof
from gable_at_corner import CORNER, FOOTPRINT, scan_gable
from hiproof.compose import check_solid
from hiproof.errors import InputError
from hiproof.model import GROUND, WALL
from hiproof.settings import Settings
from hiproof.write import building_attributes
from hiproof.write.parameters import building_record
from written_run import list_faults, write_run

ALL = ["0", "1.2", "1.3", "2.2"]
FILES = {"citygml": "both", "lods": ALL}


class Hill:
    """Terrain that rises to the east by `slope`, known up to x = `end` about CORNER."""

    source = "a hill"

    def __init__(self, slope=0.2, end=np.inf):
        self.slope, self.end = slope, end

    def height_at(self, xy):
        x = xy[:, 0] - CORNER[0]
        return np.where(x < self.end, self.slope * x - 1.0, np.nan)


def reconstruct(walls="terrain", terrain=None, annex=False, id="house"):
    """A gable of 12 by 8 m, with a lower flat half where it has an annex."""
    settings = Settings.from_dict(
        {"segment": {"network": "never"}, "reconstruct": {"walls": walls}}
    )
    return hiproof.reconstruct(scan_gable(annex), FOOTPRINT, terrain, settings, id)


def test_a_house_on_a_slope_has_its_visible_walls():
    level, sloping = (reconstruct(walls, Hill()) for walls in ("level", "terrain"))
    assert check_solid(sloping.solid) == ()
    assert sloping.z_ground == level.z_ground == pytest.approx(-1.0)
    # the terrain rises to 1.4 m, 1.2 m on average over the lowest
    assert sloping.volume == pytest.approx(level.volume - 12 * 8 * 1.2, abs=0.01)
    foot = min(
        sloping.solid.vertices[list(face.rings[0]), 2].min()
        for face in sloping.solid.select_faces(WALL)
        if (sloping.solid.vertices[list(face.rings[0]), 0] > CORNER[0] + 11.99).all()
    )
    assert foot == pytest.approx(1.4, abs=0.01)
    assert sloping.detail == level.detail and sloping.quality == level.quality


def test_the_level_default_is_as_it_was():
    house = reconstruct("level", Hill())
    assert len(house.solid.select_faces(GROUND)) == 1
    assert "walls" not in building_record(house)


def test_attributes_tell_the_terrain_along_the_outline():
    for walls in ("level", "terrain"):
        attributes = building_attributes(reconstruct(walls, Hill()))
        assert attributes["hiproof_ground_low"] == pytest.approx(-1.0)
        assert attributes["hiproof_ground_high"] == pytest.approx(1.4)
        assert attributes["hiproof_ground_mean"] == pytest.approx(0.2)
    unknown = building_attributes(reconstruct("terrain", None))
    assert unknown["hiproof_ground_low"] is unknown["hiproof_ground_mean"] is None


def test_walls_end_at_the_level_where_no_terrain_is_known():
    house = reconstruct("terrain", Hill(end=6.0))
    assert check_solid(house.solid) == ()
    assert re.search(r"along 5\d % of its outline, for no terrain is known there", house.detail)
    z = house.solid.vertices[:, 2]
    far = house.solid.vertices[:, 0] > CORNER[0] + 8
    assert z[far].min() == pytest.approx(-1.0)
    house = reconstruct("terrain", None)
    assert "its walls end at one level, for no terrain is known" in house.detail
    assert "walls" not in building_record(house)


@pytest.mark.parametrize("parts_as", ["one", "buildingparts"])
def test_every_file_is_valid_and_built_again(tmp_path, parts_as):
    houses = [
        reconstruct("terrain", Hill(), annex=True, id="a"),
        reconstruct("terrain", Hill(-0.1), id="b"),
        reconstruct("level", Hill(), id="c"),
    ]
    assert list_faults(tmp_path, houses, {**FILES, "parts_as": parts_as}) == []
    lines = (tmp_path / "parameters.jsonl").read_text().splitlines()[1:]
    assert [json.loads(line).get("walls") for line in lines] == ["terrain", "terrain", None]


def test_building_parts_stand_on_the_terrain_of_the_whole(tmp_path):
    house = reconstruct("terrain", Hill(), annex=True)
    write = {"parts_as": "buildingparts"}
    write_run(tmp_path, [house], write)
    text = (tmp_path / "buildings.city.jsonl").read_text().splitlines()[1]
    parts = [o for o in json.loads(text)["CityObjects"].values() if o["type"] == "BuildingPart"]
    volumes = [part["attributes"]["rf_volume_lod22"] for part in parts]
    assert len(volumes) == 2 and sum(volumes) == pytest.approx(house.volume, abs=0.1)


def test_an_edited_house_keeps_its_walls_on_the_terrain():
    house = reconstruct("terrain", Hill())
    higher = house.with_part(0, eave_height=6.0)
    assert check_solid(higher.solid) == () and higher.model.underside.terrain
    assert higher.volume > house.volume + 12 * 8 * 0.9


def test_other_walls_are_refused():
    record = building_record(reconstruct("terrain", Hill()))
    with pytest.raises(InputError, match=r"\(level, terrain\) as walls, got"):
        hiproof.build({**record, "walls": "steep"})
    level = hiproof.build({**record, "walls": "level"})
    assert len(level.solid.select_faces(GROUND)) == 1
    assert level.model.underside.is_level
