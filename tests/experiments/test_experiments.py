"""Every experiment in its quick form, and the parts they share."""

import csv
import importlib
import math
from functools import partial

import numpy as np
import pytest
from experiments.__main__ import NAMES, main
from experiments.data import collect_samples
from experiments.fig8 import remove_corner
from experiments.methods import fit_model, run_in_parallel
from experiments.output import Options, Table
from experiments.ransac import detect_planes, is_available, match_faces
from experiments.robust import add_outliers, remove_strip
from experiments.table3 import orient_truth, record_errors
from scipy import optimize

from hiproof.errors import InputError
from hiproof.primitives import CATALOGUE
from hiproof.simulate import random_building, uniform_points

pytest.importorskip(
    "matplotlib", reason="the experiments draw with matplotlib (extra `experiments`)"
)
needs_ransac = pytest.mark.skipif(
    not is_available(), reason="pyransac3d is not installed (extra `experiments`)"
)


@pytest.fixture
def few_steps(monkeypatch):
    """The paper's objective is followed for two steps alone: where it leads to is what
    tests/fit/test_single.py asks.
    """
    monkeypatch.setattr(optimize, "minimize", partial(optimize.minimize, options={"maxiter": 2}))


@pytest.mark.parametrize("name", NAMES)
def test_quick_form_writes_its_files(name, few_steps, tmp_path, capsys):
    main([name, "--quick", "--out", str(tmp_path)])
    text = (tmp_path / f"{name}.md").read_text()
    assert text in capsys.readouterr().out
    assert "Data:" in text and "Seed 2020" in text and " s with 1 processes" in text
    for table in tmp_path.glob("*.csv"):
        rows = list(csv.reader(table.open()))
        assert len(rows) > 1 and {len(row) for row in rows} == {len(rows[0])}
    for picture in [line for line in text.splitlines() if line.startswith("![")]:
        assert (tmp_path / picture[picture.index("(") + 1 : -1]).stat().st_size > 1000


def test_the_likelihood_columns_can_be_had_alone(tmp_path):
    main(["fig7", "--quick", "--paper-share", "0", "--out", str(tmp_path)])
    table = next(tmp_path.glob("fig7_1.csv")).read_text()
    assert "likelihood" in table
    assert "paper" not in table


def test_every_name_is_a_module_that_runs():
    assert all(callable(importlib.import_module(f"experiments.{name}").run) for name in NAMES)


def test_a_table_shows_gaps_and_keeps_full_precision_in_csv():
    table = Table("t", ("a", "b"), [(1 / 3, None), (math.nan, "x")], note="n")
    assert "| 0.333 | – |" in table.to_markdown() and table.to_markdown().endswith("n\n")
    assert "0.3333333333333333," in table.to_csv()


def test_a_roof_found_exactly_has_no_errors():
    primitive = CATALOGUE["hip"]
    theta = primitive.to_theta(
        {"width": 8, "length": 14, "height": 3, "ridge_length": 6}, 0.3, np.array([1.0, 2, 5])
    )
    record = record_errors(primitive, theta, theta, {"q0": 0.01})
    assert record["bound:q0"] == 0.01
    assert all(abs(value) < 1e-12 for name, value in record.items() if not name.startswith("bound"))


def test_half_a_turn_is_no_error_where_the_roof_does_not_change():
    gable = CATALOGUE["gable"]
    theta = gable.to_theta({"width": 8, "length": 12, "height": 3}, 1.5, np.zeros(3))
    turned = theta.copy()
    turned[2] -= math.pi
    assert record_errors(gable, theta, turned, {})["kappa"] == pytest.approx(0)
    saltbox = CATALOGUE["asymmetric_gable"]
    theta = saltbox.to_theta(
        {"width": 8, "length": 12, "height": 3, "ridge_offset": 1, "eave_step": 0.0},
        0.2,
        np.zeros(3),
    )
    turned = theta.copy()
    turned[2] += math.pi
    twin = orient_truth(saltbox, theta, turned)
    xy = np.random.default_rng(0).uniform(-4, 4, (30, 2))
    np.testing.assert_allclose(saltbox.height_at(twin, xy), saltbox.height_at(theta, xy))


def test_work_shared_out_comes_back_in_order():
    work = [(2, i) for i in range(6)]
    assert (
        run_in_parallel(pow, work, 2) == run_in_parallel(pow, work, 1) == [2**i for i in range(6)]
    )


@needs_ransac
def test_ransac_finds_the_planes_of_a_clean_hip_and_repeats_itself():
    building = random_building(np.random.default_rng(1), "hip")
    points = uniform_points(building, np.random.default_rng(2), 8.0, 0.02)
    from experiments.fig8 import list_true_faces

    planes = detect_planes(points)
    assert match_faces(planes, list_true_faces(building)) == (4, 0)
    assert match_faces([*planes, planes[0]], list_true_faces(building)) == (4, 1)
    repeat = detect_planes(points)
    assert [p.inliers.tolist() for p in planes] == [p.inliers.tolist() for p in repeat]


@needs_ransac
@pytest.mark.parametrize("points", [np.empty((0, 3)), np.zeros((2, 3)), np.zeros((9, 3))])
def test_ransac_of_next_to_nothing_is_nothing(points):
    assert detect_planes(points) == []


@pytest.mark.parametrize("method", ["paper", "likelihood"])
def test_a_method_that_cannot_fit_gives_an_empty_model(method):
    model = fit_model(method, np.zeros((10, 3)), ("gable",))
    assert model.fit is None and model.polygons == [] and model.outline_iou(None) == 0


def test_troubles_do_what_they_say():
    building = random_building(np.random.default_rng(3), "gable", kappa=0.7)
    points = uniform_points(building, np.random.default_rng(4))
    rng = np.random.default_rng(5)
    assert len(remove_corner(points, building, 0.4)) == len(points) - int(0.4 * len(points))
    assert len(remove_strip(points, building, 0.3, rng)) == pytest.approx(
        0.7 * len(points), rel=0.15
    )
    moved = np.any(add_outliers(points, 0.2, rng) != points, axis=1).mean()
    assert moved == pytest.approx(0.2, abs=0.07)


def test_roofn3d_csv_is_data_too(tmp_path):
    points = ",".join(f"{x} {y} {10 - abs(y - 4)}" for x in range(12) for y in range(9))
    header = (
        "id,class,points,outline,unassignedsurfacegrowingpoints,"
        "unassignedsubsurfacegrowingpoints,brep"
    )
    row = (
        f'1,Saddleback roof,"MULTIPOINT Z ({points})","MULTIPOLYGON(((0 0,11 0,11 8,0 8,0 0)))",,,'
    )
    path = tmp_path / "roofn3d_buildings.csv"
    path.write_text(header + "\n" + row + "\n")
    samples = collect_samples(Options(quick=True, data=path))
    (sample,) = samples["RoofN3D csv"]
    assert sample.type == "gable" and len(sample.points) == 108 and sample.outline.area == 88
    assert len(samples["simulated"]) == 3


def test_data_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match="--data"):
        collect_samples(Options(data=tmp_path))


def test_an_unknown_experiment_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(["table9"])
    assert "invalid choice" in capsys.readouterr().err
