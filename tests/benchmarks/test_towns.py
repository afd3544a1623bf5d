"""Laws of the towns' benchmark: a true model is right in everything, a draw is always the same,
grounds apart are buildings.
"""

from pathlib import Path

import numpy as np
import pytest
import shapely
from benchmarks.delft import select_footprints
from benchmarks.judging import SHARED
from benchmarks.towns import (
    TOWNS,
    choose_buildings,
    find_ground,
    group_touching,
    model_all,
    read_town,
    write_truth,
)
from benchmarks.wireframes import (
    COLUMNS,
    Score,
    WireframeCounts,
    count_wireframes,
    make_cells,
    make_size_rows,
    sum_counts,
)

from handmade import box
from hiproof.compose import compose
from hiproof.model import Building, Model, Roof
from hiproof.simulate import random_compound
from hiproof.status import Status
from hiproof.write import write_cityjson

needs_judge = pytest.mark.skipif(not (SHARED / "tools").is_dir(), reason="needs ../shared/tools")
needs_towns = pytest.mark.skipif(not TOWNS["essen"].is_file(), reason="needs ../shared/data/towns")
needs_delft = pytest.mark.skipif(
    not (SHARED / "data/delft").is_dir(), reason="needs ../shared/data/delft"
)


def simulate_building(kind, seed):
    """A simulated compound with its solid, as a reconstruction would return it."""
    simulation = random_compound(
        np.random.default_rng(seed), kind, origin=(85000.0 + 50.0 * seed, 446000.0, 2.0)
    )
    solid = compose(simulation.roof, 0.0).move(simulation.roof.frame.origin)
    return Building(f"{kind}-{seed}", Status.MODELLED, built=Model(simulation.roof, solid))


@pytest.fixture
def small_town(tmp_path) -> Path:
    """Three simulated compounds as a CityJSON file."""
    path = tmp_path / "town.city.json"
    write_cityjson(
        path,
        [simulate_building(kind, seed) for seed, kind in enumerate(("L", "dormered", "two_level"))],
    )
    return path


def test_a_town_is_read_with_its_outlines(small_town):
    buildings = {building.id: building for building in read_town(small_town)}
    for seed, kind in enumerate(("L", "dormered", "two_level")):
        truth = simulate_building(kind, seed).roof
        outline = shapely.transform(truth.outline, truth.frame.to_world)
        assert buildings[f"{kind}-{seed}"].footprint.symmetric_difference(outline).area < 0.05
    assert read_town(small_town, smallest_m2=1e4) == []


def test_a_scan_lies_on_the_building_and_is_always_the_same(small_town):
    building = next(b for b in read_town(small_town) if b.id == "L-0")
    points = building.scan_points(4.0)
    assert np.array_equal(points, building.scan_points(4.0))
    product = simulate_building("L", 0)
    local = product.roof.frame.to_local(points)
    inside = shapely.contains_xy(product.roof.outline.buffer(-0.4), *local[:, :2].T)
    gap = product.roof.height_at(local[inside, :2]) - local[inside, 2]
    assert (
        inside.sum() > 3.0 * product.roof.outline.buffer(-0.4).area
        and np.median(np.abs(gap)) < 0.08
    )


@needs_judge
def test_true_models_are_right_in_everything(small_town, tmp_path):
    buildings = read_town(small_town)
    truth, models = tmp_path / "truth.city.json", tmp_path / "models.city.jsonl"
    write_truth(truth, small_town, buildings)
    write_cityjson(
        models,
        [simulate_building(kind, seed) for seed, kind in enumerate(("L", "dormered", "two_level"))],
    )
    counts = count_wireframes(models, truth)
    assert counts.keys() == {building.id for building in buildings} and len(counts) == 3
    for item in (*counts.values(), sum_counts(counts.values())):
        assert item.edge_f1 == item.corner_f1 == 100.0
        assert (item.edges, item.corners, item.faces) == (
            item.true_edges,
            item.true_corners,
            item.true_faces,
        )
        assert item.height_rmse_m < 0.01


@needs_judge
@needs_towns
def test_a_missing_model_counts_as_missed(tmp_path):
    buildings = choose_buildings(read_town(TOWNS["essen"]), step=30)
    write_truth(tmp_path / "truth.city.json", TOWNS["essen"], buildings)
    solids = [next(iter(building.solids.values())) for building in buildings]
    models = [
        Building(b.id, Status.MODELLED, built=Model(flat_roof(b), s))
        for b, s in zip(buildings, solids, strict=True)
    ]
    write_cityjson(tmp_path / "models.city.jsonl", models[1:])
    counts = count_wireframes(tmp_path / "models.city.jsonl", tmp_path / "truth.city.json")
    assert [counts[b.id].edge_f1 for b in buildings] == [0.0, *[100.0] * (len(buildings) - 1)]
    total = sum_counts(counts.values())
    assert total.right_edges == total.edges == total.true_edges - counts[buildings[0].id].true_edges


def flat_roof(building) -> Roof:
    """Any roof: what is judged is the solid."""
    return simulate_building("L", 0).roof


def test_solids_whose_grounds_lie_apart_are_buildings_of_their_own():
    first = box()
    neighbour = box().move(np.array([4.0, 0.0, 0.0]))
    distant = box(2.0, 2.0).move(np.array([20.0, 0.0, 0.0]))
    result = group_touching("house", {"a": first, "b": neighbour, "c": distant})
    assert [building.id for building in result] == ["house", "house~2"]
    assert [sorted(building.solids) for building in result] == [["a", "b"], ["c"]]
    assert result[0].footprint.equals_exact(
        shapely.box(0, 0, 8, 5).normalize(), 1e-6, normalize=True
    )
    assert find_ground(distant).area == pytest.approx(4.0)


def test_draws_are_parts_of_the_whole_and_always_the_same():
    total = list(range(101))
    even, odd = (choose_buildings(total, parity=parity) for parity in ("even", "odd"))
    assert sorted(even + odd) == total and even[:2] == [0, 2]
    assert choose_buildings(total, step=10) == total[::10]
    draw = choose_buildings(total, limit=12)
    assert (
        len(draw) == 12 and draw == sorted(set(draw)) and draw == choose_buildings(total, limit=12)
    )
    assert choose_buildings(total, limit=500) == total


def test_a_table_has_a_row_for_every_size_there_is_pooled_and_by_building():
    small = Score("small", WireframeCounts(8, 8, 8, 6, 6, 6, 6), 100.0, 0.01, 1, 1.0)
    large = Score("large", WireframeCounts(10, 30, 30, 12, 24, 24, 12), 900.0, 0.18, 4, 0.5)
    assert [row.split(":")[0] for row in make_size_rows([small, large])] == [
        "  0 to 200 m2",
        "  800 to inf m2",
    ]
    total = dict(zip(COLUMNS, make_cells([small, large]), strict=True))
    assert total["edge F1, %: pooled; mean"] == "47.4; 66.7"  # 18 of 38 edges; (100 + 33.3) / 2
    assert total["ms per 100 m2"] == "19.0"  # 190 ms on 1,000 m2
    assert total["share in 0.2 m"] == "0.7500" and total["parts"] == "2.50"


@needs_judge
@needs_towns
@pytest.mark.parametrize(("town", "n"), [("vienna", 143), ("rotterdam", 715), ("delft_5907", 303)])
def test_towns_have_the_buildings_that_are_known(town, n):
    assert len(read_town(TOWNS[town])) == n


@needs_delft
def test_even_and_odd_footprints_are_all_footprints():
    path = SHARED / "data/delft/footprints.gpkg"
    even, odd, total = (
        {f.id for f in select_footprints(path, parity)} for parity in ("even", "odd", None)
    )
    assert even | odd == total and not even & odd and min(len(even), len(odd)) > 0.4 * len(total)


@needs_towns
@pytest.mark.parametrize("ending", ["j64", "j7G"])
def test_two_or_three_points_of_its_walls_are_no_part_of_a_gable(ending):
    building = next(b for b in read_town(TOWNS["nrw_5657"]) if b.id.endswith(ending))
    (model,), _ = model_all([building], [building.scan_points(2.0)], True)
    assert [part.type for part in model.parts] == ["gable"]
