"""Unchanged buildings estimated by both surveys, and false alarms controlled over a city."""

import json

import numpy as np
import pytest

from hiproof import InputError, SettingsError
from hiproof.parametric.run import build_file
from hiproof.update.before import find_largest_chance
from hiproof.update.refine import combine_sigmas
from hiproof.update.run import update_area
from run_records import by_id, records
from tiny_town import make_town
from tiny_updates import DATE, lose_clouds, make_request, raise_house


@pytest.fixture(scope="module")
def cloud(tmp_path_factory):
    """A cloud of the tiny town, of which house-1 was raised."""
    later = make_town(seed=7)
    raise_house(later, "house-1", 2.0)
    return later.write(tmp_path_factory.mktemp("refine") / "later.laz")


@pytest.fixture(scope="module")
def refinement(town_run, cloud, tmp_path_factory):
    request = make_request(town_run, cloud, tmp_path_factory.mktemp("refined"), refine=True)
    return update_area(request), by_id(request.run), by_id(request.out), request


def test_unchanged_houses_keep_id_and_parts_and_become_surer(refinement):
    summary, before, after, _ = refinement
    assert summary.by_change == {"unchanged": 3, "changed": 1}
    assert list(before) == list(after)
    for id in ("house-0", "house-2", "house-3"):
        assert after[id]["detail"].endswith(f"refined with the points of {DATE}")
        assert after[id].get("change") is None
        for old, new in zip(before[id]["parts"], after[id]["parts"], strict=True):
            assert old["type"] == new["type"] and old["outlines"] == new["outlines"]
            same = old["sigma"].keys() & new["sigma"].keys()
            ratios = [new["sigma"][n] / old["sigma"][n] for n in same if old["sigma"][n]]
            assert ratios and np.mean(np.log(ratios)) < 0
            assert new["position"][2] == pytest.approx(old["position"][2], abs=0.03)


def test_a_changed_house_is_made_of_the_new_points_alone(refinement):
    houses = [run["house-1"] for run in refinement[1:3]]
    tops = [house["parts"][0]["position"][2] + house["origin"][2] for house in houses]
    assert tops[1] - tops[0] == pytest.approx(2.0, abs=0.05)
    assert "refined" not in houses[1]["detail"]


def test_build_makes_the_same_files_of_a_refined_run(refinement, tmp_path):
    out = refinement[3].out
    build_file(out / "parameters.jsonl", tmp_path)
    assert records(tmp_path) == records(out)


def test_more_points_lessen_the_share_of_their_scatter_alone():
    before, alone, both = {"height": 0.05, "width": 0.06}, {"height": 0.03}, {"height": 0.02}
    result = combine_sigmas(before, alone, both)
    assert result["width"] == 0.06
    assert result["height"] == pytest.approx((0.02**2 + 0.05**2 - 0.03**2) ** 0.5)


def test_refining_without_the_earlier_points_is_refused(town_run, cloud, tmp_path):
    run = lose_clouds(town_run, tmp_path)
    with (
        pytest.warns(UserWarning, match="models alone"),
        pytest.raises(InputError, match="leave out --refine"),
    ):
        update_area(make_request(run, cloud, tmp_path / "out", refine=True))


def test_the_largest_chance_follows_from_the_chances_of_all_houses(town_run, cloud, tmp_path):
    summary = update_area(make_request(town_run, cloud, tmp_path, significance_over="city"))
    assert summary.by_change == {"unchanged": 3, "changed": 1}
    record = json.loads((tmp_path / "run.json").read_text())["update"]
    assert record["significance_over"] == "city"
    assert record["largest_chance"] == pytest.approx(0.001 / 4)
    with pytest.raises(SettingsError, match="buildings or city"):
        update_area(make_request(town_run, cloud, tmp_path, significance_over="country"))


def test_of_changes_called_by_benjamini_and_hochberg_few_are_false():
    rng, shares = np.random.default_rng(5), []
    for _ in range(200):
        chances = np.concatenate([rng.uniform(0, 1, 900), rng.uniform(0, 1e-4, 100)])
        called = chances < find_largest_chance(chances, 0.1)
        assert called[900:].all()
        shares.append(called[:900].sum() / called.sum())
    assert 0.07 < np.mean(shares) < 0.1
