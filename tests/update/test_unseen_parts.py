"""Parts of roofs that a new survey does not show: an update never calls these unchanged."""

import dataclasses

import numpy as np
import pytest
import shapely

from hiproof.simulate import random_building
from hiproof.update.cells import SurveyNoise, compare_points
from hiproof.update.judge import is_not_covered
from hiproof.update.unseen import draw_unseen
from points_of_roofs import scan_roof as scan
from run_records import by_id
from tiny_town import ORIGIN, make_town
from tiny_updates import lose_clouds, run_over, take_class, update

WING = (6.0, 5.0)  # m: its length and width, east of every house but the last


def make_winged(density, seed):
    """The tiny town with a flat wing at the eastern wall of each house but the last."""
    town, wings = make_town(density=density, seed=seed), {}
    rng = np.random.default_rng([seed, 5])
    outlines, xyz, codes = dict(town.footprints), town.xyz.copy(), town.classification.copy()
    for id in list(outlines)[:-1]:
        _, y0, x1, _ = outlines[id].bounds
        wing = shapely.box(x1, y0 + 1.0, x1 + WING[0], y0 + 1.0 + WING[1])
        inside = shapely.intersects_xy(wing, *xyz[:, :2].T)
        xyz[inside, 2] = ORIGIN[2] + 3.2 + rng.normal(0, 0.03, inside.sum())
        codes[inside] = 6
        outlines[id], wings[id] = outlines[id].union(wing), wing
    return dataclasses.replace(town, xyz=xyz, classification=codes, footprints=outlines), wings


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The folder of a run over the town with wings."""
    return run_over(tmp_path_factory.mktemp("run"), make_winged(8.0, 0)[0])


def hide(town, inside):
    return town.select(~inside)


def raise_unclassified(town, inside):
    up = town.xyz + inside[:, None] * [0.0, 0.0, 3.0]
    codes = np.where(inside, 1, town.classification)
    return dataclasses.replace(town, xyz=up, classification=codes.astype(np.uint8))


@pytest.mark.parametrize(
    ("change", "answer"),
    [(hide, ("not_covered", "unseen")), (raise_unclassified, ("uncertain", "unclear"))],
)
@pytest.mark.parametrize(("density", "seed"), [(2.0, 1), (8.0, 3)])
def test_a_wing_without_points_of_the_roof_is_not_called_unchanged(
    run, change, answer, density, seed, tmp_path
):
    town, wings = make_winged(density, seed)
    wing = wings["house-1"]
    town = change(town, town.lie_in(wing))
    before, after = by_id(run), update(run, tmp_path / "out", town)
    classes = {id: take_class(row) for id, row in after.items()}
    assert classes == dict.fromkeys(classes, "unchanged") | {"house-1": answer[0]}
    (place,) = after["house-1"]["change"]["places"]
    assert place["kind"] == answer[1]
    assert place["area"] == pytest.approx(wing.area, rel=0.35)
    assert after["house-1"]["parts"] == before["house-1"]["parts"]


def test_without_the_earlier_clouds_the_model_says_what_could_be_seen(run, tmp_path):
    models = lose_clouds(run, tmp_path)
    town, wings = make_winged(6.0, 6)
    town = hide(town, town.lie_in(wings["house-2"]))
    with pytest.warns(UserWarning, match="compared with its models alone"):
        after = update(models, tmp_path / "out", town)
    classes = {id: take_class(row) for id, row in after.items()}
    assert classes == dict.fromkeys(classes, "unchanged") | {"house-2": "not_covered"}


@pytest.mark.parametrize("kept", [0.0, 0.2])
def test_a_house_that_the_survey_hardly_covers_has_a_place(run, kept, tmp_path):
    town, _ = make_winged(6.0, 6)
    x0, _, x1, _ = town.footprints["house-2"].bounds
    town = hide(town, town.xyz[:, 0] > x0 + kept * (x1 - x0))
    change = update(run, tmp_path / "out", town)["house-2"]["change"]
    assert change["class"] == "not_covered"
    (place,) = change["places"]
    assert place["kind"] == "unseen"
    area_m2 = (1 - kept) * town.footprints["house-2"].area
    assert place["area"] == pytest.approx(area_m2, rel=0.25)


@pytest.mark.parametrize(("through", "density"), [(0.0, 1.0), (0.15, 12.0), (0.4, 4.0)])
def test_a_survey_covers_the_rubble_of_a_house(run, through, density, tmp_path):
    """Whatever share of the pulses reaches the ground."""
    town, _ = make_winged(density, 4)
    rng, outline = np.random.default_rng(5), town.footprints["house-2"]
    inside = town.lie_in(outline.buffer(0.5))
    town.xyz[inside, 2] = ORIGIN[2] + rng.uniform(0.0, 7.0, inside.sum())
    on_ground = inside & (rng.random(len(inside)) < through)
    town.xyz[on_ground, 2] = ORIGIN[2]
    town.classification[inside] = np.where(on_ground, 2, 1)[inside]
    after = update(run, tmp_path / "out", town)
    classes = {id: take_class(row) for id, row in after.items()}
    assert classes.pop("house-2") == ("gone" if through else "uncertain")
    assert set(classes.values()) == {"unchanged"}


def test_a_survey_that_covers_no_building_is_told(run, tmp_path):
    town, _ = make_winged(4.0, 4)
    boxes = shapely.buffer(list(town.footprints.values()), 2.0)
    town = hide(town, town.lie_in(shapely.union_all(boxes)))
    town.classification[:50] = 6
    with pytest.warns(UserWarning, match="got clouds that cover none;"):
        after = update(run, tmp_path / "out", town)
    assert {take_class(row) for row in after.values()} == {"not_covered"}


def test_a_changed_house_also_names_its_unseen_wing(run, tmp_path):
    town, wings = make_winged(6.0, 7)
    main = town.footprints["house-1"].difference(wings["house-1"])
    up = town.lie_in(main) & (town.classification == 6)
    town.xyz[up, 2] += 2.5
    town = hide(town, town.lie_in(wings["house-1"]))
    change = update(run, tmp_path / "out", town)["house-1"]["change"]
    assert change["class"] == "changed"
    kinds = [place["kind"] for place in change["places"]]
    assert kinds[-1] == "unseen" and "raised" in kinds[0]


def find(roof, old, new):
    comparison = compare_points(roof, old, new, SurveyNoise())
    if is_not_covered(comparison, roof):
        return None
    place = draw_unseen(roof, comparison)
    return 0.0 if place is None else place.area


@pytest.mark.parametrize(("density", "has_old"), [(0.5, True), (3.0, False)])
def test_chance_hides_no_part_of_a_hundred_roofs(density, has_old):
    rng, areas = np.random.default_rng([int(2 * density), has_old]), []
    for _ in range(100):
        roof = random_building(rng).roof
        old = scan(rng, roof, 6.0) if has_old else None
        areas.append(find(roof, old, scan(rng, roof, density)) or 0.0)
    assert sum(area > 0 for area in areas) <= 1, sorted(areas)[-3:]


@pytest.mark.parametrize(("density", "has_old"), [(1.0, False), (10.0, True)])
def test_a_hidden_end_of_a_roof_is_measured(density, has_old):
    rng, ratios = np.random.default_rng([int(density), 3]), []
    while len(ratios) < 20:
        roof = random_building(rng).roof
        x0, y0, x1, y1 = roof.outline.bounds
        cut = x1 - rng.uniform(0.2, 0.45) * (x1 - x0)
        hidden = roof.outline.intersection(shapely.box(cut, y0, x1, y1))
        if hidden.buffer(-1.2 * max(1.0, np.sqrt(9.0 / density))).area < 4.0:
            continue  # hardly wider than the holes that chance makes
        old, new = scan(rng, roof, 6.0), scan(rng, roof, density)
        area = find(roof, old if has_old else None, new[new[:, 0] < cut])
        if area is not None:  # else little of it is covered at all
            ratios.append(area / hidden.area)
    assert sum(ratio > 0.5 for ratio in ratios) >= 19, sorted(ratios)[:6]
    assert max(ratios) < 1.4


@pytest.mark.parametrize("density", [3.0, 16.0])
def test_water_on_a_flat_roof_is_a_hole(density):
    """Points are left along its edges alone, so hardly any cell is full."""
    rng, ratios = np.random.default_rng([int(density), 4]), []
    while len(ratios) < 20:
        roof = random_building(rng, "flat").roof
        pond = shapely.buffer(roof.outline, -rng.uniform(1.2, 2.2))
        old, new = scan(rng, roof, density), scan(rng, roof, density)
        area = find(roof, old, new[~shapely.intersects_xy(pond, *new[:, :2].T)])
        if area is not None and pond.buffer(-2.0).area > 4.0:
            ratios.append(area / pond.area)
    assert sum(0.6 < ratio < 1.4 for ratio in ratios) >= 18, sorted(ratios)
