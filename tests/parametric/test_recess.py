"""Recesses: level parts that take the place of what they cover, and give it back where they go."""

import numpy as np
import pytest

from hiproof.compose import check_solid
from hiproof.errors import InputError
from hiproof.parametric.arrange import replace_part, with_recess
from hiproof.parametric.building import build
from hiproof.write.parameters import building_record
from parametric_house import gable_house

DEPTH_M, SIDE_M = 2.5, 3.0


def rebuild(house, parts):
    return build({**building_record(house), "parts": parts})


@pytest.fixture(scope="module")
def house():
    return gable_house()


@pytest.fixture(scope="module")
def sunk(house):
    """The house with a recess in the middle of its ridge."""
    return rebuild(house, with_recess(building_record(house)["parts"], house.roof, 0))


def test_a_recess_is_as_deep_as_it_says_and_changes_nothing_beside_it(house, sunk):
    x, y = np.meshgrid(np.linspace(-5.9, 5.9, 40), np.linspace(-3.9, 3.9, 40))
    xy = np.column_stack([x.ravel(), y.ravel()])
    inside = (np.abs(xy) < 0.5 * SIDE_M).all(axis=1)
    old, new = house.roof.height_at(xy), sunk.roof.height_at(xy)
    ridge = house.roof.height_at(np.zeros((1, 2)))[0]
    assert new[inside] == pytest.approx(np.full(inside.sum(), ridge - DEPTH_M), abs=1e-6)
    assert new[~inside] == pytest.approx(old[~inside], abs=1e-6)
    assert not check_solid(sunk.solid)


@pytest.mark.parametrize(
    "change", [{"width": 4.0, "length": 1.5}, {"position": [2.0, 1.0, 5.0]}, {"rotation": 30.0}]
)
def test_where_a_recess_goes_the_roof_comes_back(house, sunk, change):
    position = [float(v) for v in sunk.parts[1].translation]
    moved = sunk.with_part(1, **change)
    back = moved.with_part(1, position=position, rotation=0.0, width=SIDE_M, length=SIDE_M)
    assert not check_solid(moved.solid)
    assert back.solid.volume == pytest.approx(sunk.solid.volume, abs=0.01)
    direct = rebuild(house, with_recess(building_record(house)["parts"], house.roof, 0)).with_part(
        1, **change
    )
    assert moved.solid.volume == pytest.approx(direct.solid.volume, abs=0.01)


def test_a_recess_of_the_same_area_takes_the_same_volume_anywhere_on_a_level_roof(house):
    flat = house.with_part(0, type="flat")
    sunk = rebuild(flat, with_recess(building_record(flat)["parts"], flat.roof, 0))
    volume = flat.solid.volume - sunk.solid.volume
    moved = sunk.with_part(1, position=[2.5, -1.5, float(sunk.parts[1].translation[2])])
    assert volume == pytest.approx(SIDE_M**2 * DEPTH_M, abs=0.01)
    assert flat.solid.volume - moved.solid.volume == pytest.approx(volume, abs=0.01)


def test_a_part_that_leaves_nothing_out_stays_as_it_is(house):
    parts = building_record(
        house.with_part(1, type="flat", width=2.0, length=2.0, position=[0.0, 0.0, 12.0])
    )["parts"]
    moved = {**parts[1], "position": [2.0, 0.0, 12.0], "outlines": None}
    assert replace_part(parts, 1, moved)[0] == parts[0]


def test_a_recess_beside_the_roof_or_over_all_of_a_part_is_one_sentence(house):
    parts = building_record(house)["parts"]
    with pytest.raises(InputError, match="outside it"):
        rebuild(house, with_recess(parts, house.roof, 0, (99.0, 0.0)))
    small = house.with_part(1, type="flat", width=1.0, length=1.0, position=[0.0, 0.0, 12.0])
    with pytest.raises(InputError, match="delete the part"):
        with_recess(building_record(small)["parts"], small.roof, 0, (0.0, 0.0))
