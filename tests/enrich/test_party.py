"""Party walls of constructed streets: areas, symmetry, and solids that stay closed."""

import math

import numpy as np
import pytest

from hiproof.compose import check_solid
from hiproof.enrich.walls import OF_3DBAG
from streets import answer_street, list_party, lose_house, place_house

GABLE = {"eave": 5.0, "rise": 3.0}
CASES = {
    "equal blocks": ([{}, {"x": 6.0}], 60.0),
    "a lower neighbour": ([{}, {"x": 6.0, "eave": 4.0}], 40.0),
    "set back by 3 m": ([{}, {"x": 6.0, "y": 3.0}], 42.0),
    "gables side by side": ([GABLE, {**GABLE, "x": 6.0}], 65.0),
    "a gable beside a block": ([GABLE, {"x": 6.0, "eave": 8.0}], 65.0),
    "a gable beside a block as high as its middle": ([GABLE, {"x": 6.0, "eave": 6.5}], 61.25),
    "a gable set back by half its depth": ([GABLE, {**GABLE, "x": 6.0, "y": 5.0}], 28.75),
    "a gap of 0.2 m": ([{}, {"x": 6.2}], 60.0),
    "an overlap of 0.2 m": ([{}, {"x": 5.8}], 60.0),
    "a gap of 0.4 m": ([{}, {"x": 6.4}], 0.0),
    "corner to corner": ([{}, {"x": 6.0, "y": 10.0}], 0.0),
    "back to back": ([{}, {"y": 10.0}], 36.0),
}
every_turn = pytest.mark.parametrize("turn", [0.0, 33.0])


def make_houses(places, turn=0.0):
    return [
        place_house(
            f"h{k}",
            place.get("x", 0.0),
            place.get("y", 0.0),
            turn=turn,
            **{name: value for name, value in place.items() if name not in ("x", "y")},
        )
        for k, place in enumerate(places)
    ]


def scatter_houses(count, seed):
    """Return houses in rows that touch, overlap and stand apart by chance."""
    rng = np.random.default_rng(seed)
    return [
        place_house(
            f"h{k}",
            6.0 * (k % 8) + round(rng.uniform(-0.3, 0.3), 3),
            10.0 * (k // 8) + round(rng.uniform(-1.5, 1.5), 3),
            eave=round(rng.uniform(3, 8), 3),
            rise=round(rng.uniform(1, 4), 3) if rng.random() < 0.6 else 0.0,
            turn=round(rng.uniform(-1.0, 1.0), 3),
        )
        for k in range(count)
    ]


@every_turn
@pytest.mark.parametrize("case", CASES)
def test_areas_are_those_of_the_construction(case, turn, tmp_path):
    places, area = CASES[case]
    answers = answer_street(tmp_path, make_houses(places, turn))
    for result in answers.values():
        assert result.attributes["hiproof_party_wall_area_m2"] == pytest.approx(area, rel=1e-3)
    assert sum(list_party(answers).values()) == pytest.approx(2 * area, rel=1e-3)


def test_a_wall_that_turns_away_touches_as_far_as_it_is_near(tmp_path):
    slope = math.tan(math.radians(2.0))
    houses = [place_house("a", 0, 0), place_house("b", 6, 0, turn=-2.0)]
    corner_x, corner_y = houses[1]["outline"][0][0]
    areas = list_party(answer_street(tmp_path, houses))
    length = (6.3 - corner_x) / slope + corner_y
    assert areas["a", "b"] == areas["b", "a"] == pytest.approx(6 * length, rel=2e-3)


@pytest.mark.parametrize("seed", range(3))
def test_either_neighbour_has_the_same_area(seed, tmp_path):
    areas = list_party(answer_street(tmp_path, scatter_houses(32, seed)))
    assert len(areas) > 60
    assert {(b, a): area for (a, b), area in areas.items()} == areas


def test_answers_depend_on_no_order(tmp_path):
    houses = scatter_houses(16, 1)
    first = answer_street(tmp_path / "a", houses)
    second = answer_street(tmp_path / "b", houses[::-1])
    assert list_party(first) == pytest.approx(list_party(second), abs=1e-4)
    for id in first:
        assert first[id].attributes["hiproof_outer_wall_area_m2"] == pytest.approx(
            second[id].attributes["hiproof_outer_wall_area_m2"], abs=1e-3
        )


def test_cut_solids_are_closed_and_as_large(tmp_path):
    houses = scatter_houses(24, 2)
    for k, result in enumerate(answer_street(tmp_path, houses).values()):
        assert check_solid(result.building.solid) == ()
        house = houses[k]
        width, length = (house["parts"][0]["parameters"][name] for name in ("width", "length"))
        z = house["parts"][0]["position"][2]
        rise = house["parts"][0]["parameters"].get("height", 0.0)
        assert result.building.volume == pytest.approx(width * length * (z + rise / 2), rel=1e-3)


def test_party_walls_carry_their_neighbour(tmp_path):
    houses = make_houses([GABLE, {**GABLE, "x": 6.0, "y": 3.0}, {"x": 12.0, "eave": 4.0}])
    answers = answer_street(tmp_path, houses)
    areas = list_party(answers)
    for id, result in answers.items():
        size = np.linalg.norm(result.building.solid.shell.face_areas, axis=1)
        carried = {}
        for face, values in result.surfaces.items():
            name = values["hiproof_party_with"]
            carried[id, name] = carried.get((id, name), 0.0) + size[face]
        expected = {pair: area for pair, area in areas.items() if pair[0] == id}
        assert carried == pytest.approx(expected, rel=1e-3)


def test_areas_of_all_kinds(tmp_path):
    answers = answer_street(tmp_path, make_houses([GABLE, {"x": 6.0, "eave": 4.0}]))
    gable, block = (answers[id].attributes for id in ("h0", "h1"))
    slope = 2 * 6 * math.hypot(5, 3)
    expected = {"ground": 60, "flat_roof": 0, "sloped_roof": slope, "party_wall": 40}
    expected["outer_wall"] = 2 * 65 + 2 * 30 - 40
    for name, area in expected.items():
        own = f"{name}_area_m2"
        assert gable[f"hiproof_{own}"] == gable[OF_3DBAG[own]] == pytest.approx(area, abs=2e-3)
    assert block["b3_opp_dak_plat"] == pytest.approx(60)
    assert block["b3_opp_buitenmuur"] == pytest.approx(32 * 4 - 40)


def test_a_building_says_that_neighbours_may_be_missing(tmp_path):
    grid = [place_house(f"h{i}-{k}", 6.0 * i, 10.0 * k) for i in range(9) for k in range(5)]
    unknown = {
        id: result.attributes["hiproof_neighbours_unknown"]
        for id, result in answer_street(tmp_path / "a", grid).items()
    }
    inner = {f"h{i}-{k}" for i in range(2, 7) for k in range(1, 4)}
    assert {id for id, value in unknown.items() if not value} == inner
    grid[22] = lose_house("h4-2", 24.0, 20.0)
    unknown = answer_street(tmp_path / "b", grid)
    assert unknown["h4-1"].attributes["hiproof_neighbours_unknown"]
    assert not unknown["h2-2"].attributes["hiproof_neighbours_unknown"]
