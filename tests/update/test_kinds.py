"""What an update calls a change: what a person would who looks at both surveys."""

import numpy as np
import pytest
import shapely

from tiny_town import ORIGIN, gable, make_town
from tiny_updates import lay_bare, take_kind, update


def raise_gable(town, outline, eave, rise, turn=0.0):
    """Put a gable over a rectangle, its ridge along x, both turned by degrees."""
    (x0, y0, x1, y1), (x, y) = outline.bounds, outline.centroid.coords[0]
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    local = (town.xyz[:, :2] - [x, y]) @ np.array([[c, -s], [s, c]])
    half = np.array([x1 - x0, y1 - y0]) / 2
    inside = (np.abs(local) <= half).all(axis=1)
    u, v = (local[inside] + half).T
    heights = gable(u, v, 2 * half[1], 2 * half[0], eave, rise)
    noise = np.random.default_rng(4).normal(0, 0.03, inside.sum())
    town.xyz[inside, 2] = ORIGIN[2] + 0.01 * (x - ORIGIN[0]) + heights + noise
    town.classification[inside] = 6


@pytest.mark.parametrize(("density", "turn"), [(2.0, 15.0), (8.0, -25.0), (20.0, 15.0)])
def test_a_house_that_was_turned_was_rebuilt(dense_run, density, turn, tmp_path):
    town = make_town(seed=11, density=density)
    lay_bare(town, "house-0", 0.0)
    raise_gable(town, town.footprints["house-0"], 5.0, 3.0, turn)
    assert take_kind(update(dense_run, tmp_path / "out", town)["house-0"]) == "rebuilt"


@pytest.mark.parametrize("density", [2.0, 20.0])
def test_a_smaller_house_in_place_of_another_was_rebuilt(dense_run, density, tmp_path):
    town = make_town(seed=12, density=density)
    x0, y0, x1, y1 = town.footprints["house-2"].bounds
    lay_bare(town, "house-2", 0.0)
    raise_gable(town, shapely.box(x0 + 2, y0 + 2.5, x1 - 4, y1), 3.2, 0.0)
    after = update(dense_run, tmp_path / "out", town)
    assert take_kind(after["house-2"]) == "rebuilt"
    assert {take_kind(after[f"house-{n}"]) for n in (0, 1, 3)} == {"unchanged"}


def test_a_house_that_lost_one_half_and_got_a_storey_on_the_other(dense_run, tmp_path):
    """Both are said, whether the rest rises or sinks together with what was lost."""
    town = make_town(seed=13, density=8.0)
    areas = {}
    for id, rise in (("house-0", 2.5), ("house-2", -1.5)):
        areas[id] = lay_bare(town, id, 0.5)
        stands = town.lie_in(town.footprints[id])
        town.xyz[stands & (town.classification == 6), 2] += rise
    after = update(dense_run, tmp_path / "out", town)
    for id, kind in (("house-0", "part_raised"), ("house-2", "part_lowered")):
        places = {place["kind"]: place for place in after[id]["change"]["places"]}
        assert set(places) == {kind, "part_removed"}, id
        for place in places.values():
            assert place["area"] == pytest.approx(areas[id], rel=0.2), id


def test_a_steeper_roof_is_not_the_earlier_one_half_as_high(dense_run, tmp_path):
    """Where much differs between surveys, the earlier model moved up passed for a steeper one."""
    town = make_town(seed=14, density=8.0)
    for id, rise in (("house-0", 3.6), ("house-1", 3.6), ("house-2", 2.3)):
        raise_gable(town, town.footprints[id], 5.0, rise)
    after = update(dense_run, tmp_path / "out", town)
    for id in ("house-0", "house-1", "house-2"):
        assert take_kind(after[id]) == "slope_changed", id
        assert after[id]["residuals"]["rmse"] < 0.06, id


def test_an_uncertain_building_has_a_place(dense_run, tmp_path):
    """Points of a building site lie at all heights."""
    town = make_town(seed=15, density=8.0)
    inside = town.lie_in(town.footprints["house-0"])
    town.xyz[inside, 2] = ORIGIN[2] + np.random.default_rng(5).uniform(0, 7, inside.sum())
    change = update(dense_run, tmp_path / "out", town)["house-0"]["change"]
    assert change["class"] == "uncertain"
    assert [place["kind"] for place in change["places"]] == ["unclear"]
