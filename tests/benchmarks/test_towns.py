"""Laws of the towns' benchmark: a true model is right in everything, a draw is always the same,
grounds apart are buildings.
"""

import dataclasses
import importlib
from pathlib import Path
from pkgutil import resolve_name

import numpy as np
import pytest
import shapely
from benchmarks.budget import STAGES, Clock, refuse_incomplete
from benchmarks.compounds import compare_parts
from benchmarks.delft import select_footprints
from benchmarks.judging import (
    SHARED,
    make_raster,
    measure_named_share,
    measure_visible_areas,
    sum_area_by_type,
)
from benchmarks.matching import (
    compute_sigma_errors,
    has_hidden_end,
    list_right_types,
    match_parts,
    merge_alike,
)
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

from benchmarks import results, tables
from handmade import box
from hiproof.compose import compose
from hiproof.model import Building, Model, Roof
from hiproof.simulate import COMPOUND_KINDS, random_building, random_compound
from hiproof.simulate.roofs import make_part
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
    assert inside.sum() > 3.0 * product.roof.outline.buffer(-0.4).area
    assert np.median(np.abs(gap)) < 0.08


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
    assert len(draw) == 12
    assert draw == sorted(set(draw))
    assert draw == choose_buildings(total, limit=12)
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


def part(type="gable", x=0.0, y=0.0, z=3.0, kappa=0.0, **parameters):
    parameters = parameters or {"length": 6.0, "width": 8.0, "height": 3.0}
    return make_part(type, parameters, kappa, np.array([x, y, z]))


@pytest.mark.parametrize("kind", COMPOUND_KINDS)
def test_the_truth_is_right_in_any_order(kind):
    for seed in range(4):
        roof = random_compound(np.random.default_rng(seed), kind).roof
        parts = merge_alike(roof.parts)
        order = np.random.default_rng(seed).permutation(len(parts))
        shuffled = [parts[k] for k in order]
        n_expected, right, _ = compare_parts(roof, tuple(shuffled))
        assert n_expected == len(parts) and right
        assert [order[j] for j in match_parts(parts, shuffled, make_raster(roof.outline))] == list(
            range(len(parts))
        )


def test_a_missing_a_needless_and_a_wrongly_named_part_are_wrong():
    roof = random_compound(np.random.default_rng(3), "extension").roof
    house, annex = roof.parts
    hidden = part("flat", *annex.translation[:2], 0.5, annex.kappa, length=2.0, width=2.0)
    misnamed = dataclasses.replace(annex, type="pyramid")
    for parts in ((house,), (house, annex, hidden), (house, misnamed)):
        assert not compare_parts(roof, parts)[1]


def test_a_hidden_volume_does_not_change_what_stands_for_what():
    roof = random_compound(np.random.default_rng(5), "T").roof
    hidden = part("flat", *(roof.parts[0].translation - (0.0, 0.0, 0.5)), length=2.0, width=2.0)
    xy = make_raster(roof.outline)
    assert match_parts(roof.parts, (hidden, *roof.parts), xy) == [1, 2]
    assert measure_visible_areas(dataclasses.replace(roof, parts=(hidden, *roof.parts)))[0] == 0.0


def test_equal_neighbours_are_one_and_a_step_of_a_decimetre_keeps_them_apart():
    alike = [part(x=6.0 * k) for k in range(4)]
    merged = merge_alike(alike)
    assert len(merged) == 1 and merged[0].area == pytest.approx(4 * 48.0)
    assert merged[0].parameters == pytest.approx({"width": 8.0, "height": 3.0})
    assert len(merge_alike([*alike[:2], part(x=12.0, z=3.1), part(x=18.0, z=3.1)])) == 2
    assert len(merge_alike([alike[0], part(x=6.5)])) == 2  # half a metre of nothing between them
    assert len(merge_alike([alike[0], part("flat", x=6.0, length=6.0, width=8.0)])) == 2


def test_only_ends_under_another_part_are_hidden():
    house = part(length=12.0, width=8.0, height=4.0)
    wing = part(y=4.0, kappa=np.pi / 2, length=8.0, width=5.0, height=2.5)
    assert has_hidden_end(wing, [house])
    assert not has_hidden_end(house, [wing])
    assert not has_hidden_end(house, [])
    assert list_right_types(
        part("hip", length=9.0, width=6.0, height=3.0, ridge_length=3.0), True
    ) == {"hip", "side_hip"}
    assert list_right_types(wing, True) == {"gable"}


def test_an_asymmetric_gable_of_equal_slopes_may_be_called_a_gable():
    size = {"length": 9.0, "width": 8.0, "height": 3.0, "ridge_offset": 1.0}
    even = part("asymmetric_gable", **size, eave_step=3.0 * (1 - 3.0 / 5.0))
    assert list_right_types(even, False) == {"asymmetric_gable", "gable"}
    assert list_right_types(part("asymmetric_gable", **size, eave_step=0.0), False) == {
        "asymmetric_gable"
    }


def test_errors_are_counted_in_sigmas_and_not_along_what_is_hidden():
    truth = part()
    sigma = {"width": 0.1, "length": 0.2, "height": 0.05, "t_x": 0.1, "t_z": 0.02, "kappa": 0.01}
    fit = part(x=0.3, z=3.04, kappa=np.pi + 0.02, length=6.2, width=8.1, height=2.9)
    fit = dataclasses.replace(fit, sigma=sigma)
    expected = {"width": 1.0, "length": 1.0, "height": -2.0, "t_x": 3.0, "t_z": 2.0, "kappa": 2.0}
    assert compute_sigma_errors(truth, fit, hidden=False) == pytest.approx(expected)
    assert set(compute_sigma_errors(truth, fit, hidden=True)) == {"width", "height", "t_z", "kappa"}
    assert compute_sigma_errors(dataclasses.replace(truth, type="hip"), fit, hidden=False) == {}
    assert compute_sigma_errors(part(kappa=np.pi / 2), fit, hidden=False) == {}


def test_normal_errors_of_their_sigma_have_a_root_mean_square_of_one():
    rng, truth = np.random.default_rng(0), part()
    heights = [
        part(length=6.0, width=8.0, height=3.0 + 0.05 * error)
        for error in rng.standard_normal(2000)
    ]
    ratios = [
        compute_sigma_errors(truth, dataclasses.replace(p, sigma={"height": 0.05}), False)
        for p in heights
    ]
    rms = np.sqrt(np.mean([ratio["height"] ** 2 for ratio in ratios]))
    assert rms == pytest.approx(1.0, abs=0.05)


def standing(roof, id="house"):
    return Building(
        id, Status.MODELLED, built=Model(roof, compose(roof, 0.0).move(roof.frame.origin))
    )


def test_areas_that_show_make_up_the_outline():
    for kind in COMPOUND_KINDS:
        roof = random_compound(np.random.default_rng(1), kind).roof
        assert measure_visible_areas(roof).sum() == pytest.approx(roof.outline.area)
    roof = random_building(np.random.default_rng(0), "hip").roof
    model = standing(roof)
    assert measure_named_share([model]) == 1.0
    assert sum_area_by_type([model])["hip"] == pytest.approx(roof.outline.area)
    free = standing(
        dataclasses.replace(roof, parts=(dataclasses.replace(roof.parts[0], type="free"),))
    )
    assert measure_named_share([free]) == 0.0
    assert measure_named_share([model, free]) == pytest.approx(0.5)


PAGE = Path(results.__file__).with_name("RESULTS.md")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "FIGURES", tmp_path)
    monkeypatch.setattr("sys.argv", ["benchmarks/delft.py", "--record", "--shares", "1"])
    return tmp_path


def measure(share: float, is_kept: bool = True) -> None:
    with tables.FigureTable(is_kept, "share of points", "within 0.2 m") as table:
        table.add("1", share)


def test_the_page_is_that_of_the_kept_figures():
    assert PAGE.read_text(encoding="utf-8") == results.make_page(results.read_figures())


def test_a_table_is_kept_in_place_of_the_one_by_the_same_arguments(folder, monkeypatch):
    measure(0.93)
    measure(0.94)
    monkeypatch.setattr("sys.argv", ["benchmarks/delft.py"])
    measure(0.95)
    kept = results.read_figures(folder)["delft"]["tables"]
    assert [(table["arguments"], table["rows"]) for table in kept] == [
        ("--shares 1", [["1", "0.94"]]),
        ("", [["1", "0.95"]]),
    ]
    page = results.make_page(results.read_figures(folder))
    assert "| `--shares 1` | 1 | 0.94 |" in page and "|  | 1 | 0.95 |" in page


def test_a_table_that_failed_or_is_not_to_be_kept_is_not(folder):
    measure(0.93, is_kept=False)
    with pytest.raises(ZeroDivisionError):
        measure(1 / 0)
    with pytest.raises(ValueError, match="no figure"), tables.FigureTable(True, "share"):
        raise ValueError("no figure")
    assert not list(folder.iterdir())


def test_only_named_columns_are_shown_and_another_day_is_named():
    table = {"arguments": "", "date": "2026-01-01", "commit": "a", "machine": "b"}
    old = {**table, "columns": ["x", "y"], "rows": [["1", "2"]]}
    new = {**old, "date": "2026-01-02", "arguments": "--fast"}
    page = results.make_page({"delft": {"tables": [old, new], "show": ["y"], "notes": ["So."]}})
    assert "| 2026-01-01 | 2 |" in page and "| `--fast` | 2 |" in page and "So." in page


FOLDER = Path(__file__).parents[2] / "benchmarks"
NAMES = sorted(path.stem for path in FOLDER.glob("*.py") if not path.stem.startswith("__"))


@pytest.mark.parametrize("name", NAMES)
def test_all_that_a_benchmark_imports_is_there(name):
    assert importlib.import_module(f"benchmarks.{name}").__doc__


def test_a_stage_does_not_count_the_stages_inside_it():
    new = 0.0

    def work(seconds):
        nonlocal new
        new += seconds

    clock = Clock(lambda: new)
    inner = clock.time_stage("inner", lambda: work(2.0))

    def outer():
        work(1.0)
        inner()
        inner()

    clock.time_stage("outer", outer)()
    assert clock.seconds == {"inner": 4.0, "outer": 1.0}
    assert sum(clock.seconds.values()) == new


@pytest.mark.parametrize("place", STAGES.values(), ids=STAGES)
def test_every_stage_is_a_function_of_a_run(place):
    assert callable(resolve_name(place))


def test_a_budget_that_misses_a_twentieth_of_the_time_is_refused():
    clock = Clock()
    clock.seconds["fit"] = 9.6
    refuse_incomplete(clock, 10.0)
    with pytest.raises(SystemExit, match="within 5%"):
        refuse_incomplete(clock, 11.0)
