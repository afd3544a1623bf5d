"""A whole run measured against points, footprints and a reference whose figures are
known by hand.
"""

import csv
import json
import math

import numpy as np
import pytest
import shapely

from hiproof.cli.app import import_command
from hiproof.cli.evaluate import evaluate
from hiproof.errors import HiproofError, InputWarning
from hiproof.evaluate.evaluation import (
    compare,
    evaluate_building,
    match_by_id_or_overlap,
    points_by_outline,
    summarise,
    to_csv,
    to_json,
)
from hiproof.evaluate.metrics import plan_outline
from hiproof.evaluate.models import BuildingModel
from hiproof.evaluate.run import evaluate_run, outline_of_solid
from layers import write_layer
from sample_models import ORIGIN, courtyard_solid, gable_solid, write_sample_run


@pytest.fixture(scope="module")
def run(sample_run):
    return evaluate_run(
        sample_run,
        [str(sample_run / "points.xyz")],
        reference=str(sample_run / "buildings.city.jsonl"),
    )


def test_figures_are_those_the_points_were_made_with(run):
    gable, block, bare = run.figures
    assert gable.quality.points == 384 and block.quality.points > 1200
    assert gable.quality.rmse == pytest.approx(0.02 * math.cos(math.atan(0.75)), rel=0.2)
    assert block.quality.rmse == pytest.approx(0.02, rel=0.1)
    assert gable.quality.share_within_20cm == 1
    assert gable.volume_m3 == pytest.approx(8 * 12 * 5.5) and block.volume_m3 == pytest.approx(
        336 * 9
    )
    assert bare.status == "no_points" and bare.quality.points == 0


def test_a_model_equals_itself(run):
    self_comparison = run.figures[0].comparison
    assert self_comparison.reference_id == "house-1" and self_comparison.plan_iou == pytest.approx(
        1
    )
    assert (
        self_comparison.ridge_height_m,
        self_comparison.slope_deg,
        self_comparison.azimuth_deg,
        self_comparison.volume_m3,
    ) == (0, 0, 0, 0)


def test_a_reference_from_elsewhere_is_told_of(sample_run, tmp_path):
    text = (
        (sample_run / "buildings.city.jsonl")
        .read_text()
        .replace('"house-1"', '"a"')
        .replace('"block 2"', '"b"')
    )
    (tmp_path / "other.city.jsonl").write_text(
        text.replace(str(ORIGIN[0]), str(ORIGIN[0] + 5000)).replace('"bare"', '"c"')
    )
    with pytest.warns(InputWarning, match="no building of it stands where one of the run does"):
        evaluate_run(sample_run, reference=str(tmp_path / "other.city.jsonl"))


def test_differences_have_the_sign_of_ours_minus_theirs():
    first, theirs = gable_solid(ridge=7.5), gable_solid(ridge=7.0)
    result = compare(first, "x", theirs)
    assert result.ridge_height_m == pytest.approx(0.5)
    assert result.slope_deg == pytest.approx(math.degrees(math.atan(3.5 / 4) - math.atan(3 / 4)))
    assert result.volume_m3 == pytest.approx(8 * 12 * 0.25)


def test_a_reference_without_roof_surfaces_gives_no_figures():
    solid = gable_solid()
    walls = type(solid)(solid.vertices, tuple(type(f)(f.rings, "WallSurface") for f in solid.faces))
    assert math.isnan(compare(solid, "x", walls).ridge_height_m)


def test_footprints_bring_points_beyond_the_roof(tmp_path, sample_run):
    path = tmp_path / "areas.geojson"
    west, south = ORIGIN[:2]
    ring = [
        [west - 4, south],
        [west + 8, south],
        [west + 8, south + 12],
        [west - 4, south + 12],
        [west - 4, south],
    ]
    geometry = {"type": "Polygon", "coordinates": [ring]}
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::28992"}}
    feature = {"type": "Feature", "properties": {}, "geometry": geometry}
    path.write_text(json.dumps({"type": "FeatureCollection", "crs": crs, "features": [feature]}))
    run = evaluate_run(sample_run, [str(sample_run / "points.xyz")], footprints=str(path))
    assert run.figures[0].quality.outline_iou == pytest.approx(8 / 12)


def block(id, x):
    return BuildingModel(id, solid=courtyard_solid().move(np.array([x, 0.0, 0.0])))


@pytest.mark.parametrize(
    ("ids", "expected"), [("ab", [0, 1]), ("ba", [0, 1]), ("cd", [0, 1]), ("ac", [0, 1])]
)
def test_a_number_that_is_anothers_id_elsewhere_is_not_taken_for_it(ids, expected):
    models = [block("a", 0.0), block("b", 18.0)]  # which share a strip
    areas = [plan_outline(model.solid) for model in models]
    assert match_by_id_or_overlap(models, list(zip(ids, areas, strict=True))) == expected


def test_where_nothing_lies_nearby_the_id_tells():
    distant_area = shapely.box(900, 900, 910, 910)
    assert match_by_id_or_overlap(
        [block("a", 0.0), BuildingModel("b")], [("b", distant_area), ("a", distant_area)]
    ) == [1, 0]
    assert match_by_id_or_overlap([block("a", 0.0)], []) == [None]


@pytest.mark.parametrize(
    "is_told", [True, False], ids=["the run tells the column of ids", "ids of another column"]
)
def test_footprints_are_found_by_the_column_that_named_the_buildings(tmp_path, is_told):
    solids = write_sample_run(tmp_path)
    areas = [outline_of_solid(BuildingModel(id, {}, solid)) for id, solid in solids.items()]
    areas.append(shapely.transform(areas[0], lambda xy: xy + 200.0))
    names = np.array([*solids, "bare"], dtype=object)
    columns = {"id": np.roll(names, 1), "nr": names}  # the usual one holds the names of others
    write_layer(tmp_path / "a.gpkg", areas, columns)
    inputs = {"footprints": str(tmp_path / "a.gpkg"), "id_attribute": "nr" if is_told else None}
    (tmp_path / "run.json").write_text(json.dumps({"inputs": inputs, "crs": "EPSG:7415"}))
    result = evaluate_run(tmp_path).footprints
    assert all(shapely.equals(item, area) for item, area in zip(result[:2], areas, strict=False))
    assert not is_told or shapely.equals(result[2], areas[2])


def test_points_go_to_every_outline_that_holds_them():
    points = np.array([[0.5, 0.5, 0], [1.5, 0.5, 0], [9, 9, 0]])
    outlines = [shapely.box(0, 0, 1, 1), None, shapely.box(0, 0, 2, 1)]
    assert [len(part) for part in points_by_outline(points, outlines)] == [1, 0, 2]
    assert points_by_outline(points, []) == []


def test_rows_survive_csv_and_json(run):
    rows = list(csv.DictReader(to_csv(run.figures).splitlines()))
    assert [row["id"] for row in rows] == ["house-1", "block 2", "bare"]
    assert float(rows[0]["rmse"]) == pytest.approx(run.figures[0].quality.rmse, abs=1e-6)
    assert rows[2]["rmse"] == "" and rows[0]["ref_id"] == "house-1"
    document = json.loads(to_json(run.figures))
    assert document["buildings"][2]["rmse"] is None
    assert document["summary"]["gable"]["buildings"] == 1
    assert document["summary"]["all"]["rmse"]["mean"] == pytest.approx(
        (run.figures[0].quality.rmse + run.figures[1].quality.rmse) / 2, abs=1e-6
    )


def test_nothing_to_summarise():
    assert summarise([]) == {"all": {"buildings": 0}}
    assert to_csv([]).startswith("id,type,status,quality,points")


def test_a_building_without_a_model_misses_all_its_points():
    points = np.random.default_rng(0).uniform((1, 1, 0), (9, 5, 6), (20, 3))
    figures = evaluate_building(BuildingModel("a"), points, shapely.box(0, 0, 10, 6))
    assert (
        figures.quality.share_within_20cm == 0
        and figures.quality.points == 20
        and figures.status == "no_model"
    )


def test_the_command_writes_both_tables(sample_run, tmp_path):
    import_command("evaluate")(
        [str(sample_run), str(sample_run / "points.xyz"), "--out", str(tmp_path)],
        standalone_mode=False,
    )
    assert len((tmp_path / "evaluation.csv").read_text().splitlines()) == 4
    assert (
        json.loads((tmp_path / "evaluation.json").read_text())["summary"]["all"]["buildings"] == 3
    )


def test_the_tables_fit_a_narrow_terminal(sample_run, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    points, reference = str(sample_run / "points.xyz"), str(sample_run / "buildings.city.jsonl")
    evaluate(sample_run, [points], reference=reference, out=tmp_path)
    output = capsys.readouterr().out
    assert (
        "…" not in output
        and output.count("buildings") >= 2
        and "volume" in output
        and "0.000" in output
    )


def test_buildings_that_no_mean_holds_are_counted(sample_run, tmp_path, capsys):
    cloud = str(sample_run / "points.xyz")
    evaluate(sample_run, [cloud], out=tmp_path)
    output = capsys.readouterr().out
    rows = json.loads((tmp_path / "evaluation.json").read_text())["buildings"]
    n_without = sum(row["psd_mean"] is None for row in rows)
    assert 0 < n_without < len(rows) and f"{n_without} building" in output


def test_the_clouds_are_the_runs_own_where_none_are_named(sample_run, tmp_path):
    write_sample_run(tmp_path)
    record = json.loads((tmp_path / "run.json").read_text())
    cloud = str(sample_run / "points.xyz")
    (tmp_path / "run.json").write_text(json.dumps({**record, "inputs": {"clouds": [cloud]}}))
    evaluate(tmp_path, out=tmp_path / "own")
    evaluate(tmp_path, [cloud], out=tmp_path / "named")
    assert (tmp_path / "own" / "evaluation.csv").read_text() == (
        tmp_path / "named" / "evaluation.csv"
    ).read_text()


def test_buildings_of_which_no_place_is_known_have_no_points(sample_run, tmp_path):
    lines = (sample_run / "buildings.city.jsonl").read_text().splitlines(keepends=True)
    for name, kept_lines in (("none", []), ("bare", lines[-1:])):
        (tmp_path / name).mkdir()
        (tmp_path / name / "buildings.city.jsonl").write_text("".join([lines[0], *kept_lines]))
        evaluate(tmp_path / name, [str(sample_run / "points.xyz")])
        rows = json.loads((tmp_path / name / "evaluation.json").read_text())["buildings"]
        assert [row["points"] for row in rows] == [0] * len(kept_lines)


@pytest.mark.parametrize(
    ("clouds", "record", "message"),
    [
        ([], None, "expected point files to measure"),
        (["nowhere.laz"], None, "expected a point cloud"),
        ([], "{", "record of a run"),
    ],
)
def test_what_cannot_be_measured_is_refused(clouds, record, message, tmp_path):
    write_sample_run(tmp_path)
    if record is not None:
        (tmp_path / "run.json").write_text(record)
    with pytest.raises(HiproofError, match=message):
        evaluate(tmp_path, clouds)
