"""A whole run measured against points, footprints and a reference of known figures."""

import csv
import json
import math

import numpy as np
import pytest
import shapely

from hiproof.cli.app import import_command
from hiproof.cli.evaluate import evaluate
from hiproof.errors import HiproofError, InputError, InputWarning
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
from hiproof.evaluate.models import BuildingModel, read_models, run_models
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
    assert gable.volume_m3 == pytest.approx(8 * 12 * 5.5)
    assert block.volume_m3 == pytest.approx(336 * 9)
    assert bare.status == "no_points" and bare.quality.points == 0


def test_a_model_equals_itself(run):
    comparison = run.figures[0].comparison
    assert comparison.reference_id == "house-1"
    assert comparison.plan_iou == pytest.approx(1)
    assert comparison.ridge_height_m == comparison.slope_deg == 0
    assert comparison.azimuth_deg == comparison.volume_m3 == 0


def test_a_reference_from_elsewhere_is_told_of(sample_run, tmp_path):
    text = (sample_run / "buildings.city.jsonl").read_text()
    for old, new in (("house-1", "a"), ("block 2", "b"), ("bare", "c")):
        text = text.replace(f'"{old}"', f'"{new}"')
    other = tmp_path / "other.city.jsonl"
    other.write_text(text.replace(str(ORIGIN[0]), str(ORIGIN[0] + 5000)))
    with pytest.warns(InputWarning, match="no building of it stands where one of the run does"):
        evaluate_run(sample_run, reference=str(other))


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
    west, south = ORIGIN[:2]
    area = shapely.box(west - 4, south, west + 8, south + 12)
    path = str(write_layer(tmp_path / "areas.geojson", [area]))
    run = evaluate_run(sample_run, [str(sample_run / "points.xyz")], footprints=path)
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
    far = shapely.box(900, 900, 910, 910)
    models = [block("a", 0.0), BuildingModel("b")]
    assert match_by_id_or_overlap(models, [("b", far), ("a", far)]) == [1, 0]
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
    errors = [figures.quality.rmse for figures in run.figures[:2]]
    assert float(rows[0]["rmse"]) == pytest.approx(errors[0], abs=1e-6)
    assert rows[2]["rmse"] == "" and rows[0]["ref_id"] == "house-1"
    document = json.loads(to_json(run.figures))
    assert document["buildings"][2]["rmse"] is None
    assert document["summary"]["gable"]["buildings"] == 1
    mean = document["summary"]["all"]["rmse"]["mean"]
    assert mean == pytest.approx(sum(errors) / 2, abs=1e-6)


def test_nothing_to_summarise():
    assert summarise([]) == {"all": {"buildings": 0}}
    assert to_csv([]).startswith("id,type,status,quality,points")


def test_a_building_without_a_model_misses_all_its_points():
    points = np.random.default_rng(0).uniform((1, 1, 0), (9, 5, 6), (20, 3))
    figures = evaluate_building(BuildingModel("a"), points, shapely.box(0, 0, 10, 6))
    assert figures.quality.share_within_20cm == 0
    assert figures.quality.points == 20
    assert figures.status == "no_model"


def test_the_command_writes_both_tables(sample_run, tmp_path):
    words = [str(sample_run), str(sample_run / "points.xyz"), "--out", str(tmp_path)]
    import_command("evaluate")(words, standalone_mode=False)
    assert len((tmp_path / "evaluation.csv").read_text().splitlines()) == 4
    summary = json.loads((tmp_path / "evaluation.json").read_text())["summary"]
    assert summary["all"]["buildings"] == 3


def test_the_tables_fit_a_narrow_terminal(sample_run, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    points, reference = str(sample_run / "points.xyz"), str(sample_run / "buildings.city.jsonl")
    evaluate(sample_run, [points], reference=reference, out=tmp_path)
    output = capsys.readouterr().out
    assert "…" not in output
    assert output.count("buildings") >= 2
    assert "volume" in output
    assert "0.000" in output


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
    own, named = ((tmp_path / name / "evaluation.csv").read_text() for name in ("own", "named"))
    assert own == named


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


def test_a_run_comes_back_as_written(tmp_path):
    solids = write_sample_run(tmp_path)
    models = {model.id: model for model in read_models(run_models(tmp_path))}
    assert list(models) == ["house-1", "block 2", "bare"]
    assert [model.roof_type for model in models.values()] == ["gable", "flat", "unknown"]
    assert [model.status for model in models.values()] == ["modelled", "modelled", "no_points"]
    assert models["bare"].solid is None
    for id, solid in solids.items():
        np.testing.assert_allclose(models[id].solid.vertices, solid.vertices, atol=1e-4)
        assert models[id].solid.faces == solid.faces


def test_a_document_with_parts_joins_their_solids(tmp_path):
    cube = {"type": "Solid", "lod": "2.2", "boundaries": [[[[0, 1, 2]], [[0, 2, 3]]]]}
    objects = {
        "a": {"type": "Building", "children": ["a-0", "a-1"], "attributes": {"name": "x"}},
        "a-0": {
            "type": "BuildingPart",
            "parents": ["a"],
            "geometry": [{**cube, "lod": "1.2"}, cube],
        },
        "a-1": {"type": "BuildingPart", "parents": ["a"], "geometry": [cube]},
    }
    document = {"type": "CityJSON", "version": "2.0", "CityObjects": objects}
    document |= {"vertices": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [9, 9, 9]]}
    path = tmp_path / "part.city.json"
    path.write_text(json.dumps(document))
    (model,) = read_models(path)
    assert len(model.solid.faces) == 4
    assert len(model.solid.vertices) == 4
    assert model.status == "modelled"


@pytest.mark.parametrize(
    "text",
    ["", "not json", "[]", '{"type": "CityJSON"}', '{"CityObjects": {"a": {}}, "vertices": []}'],
)
def test_what_is_no_cityjson_is_refused_in_a_sentence(tmp_path, text):
    path = tmp_path / "bad.json"
    path.write_text(text)
    with pytest.raises(InputError, match="expected"):
        list(read_models(path))


@pytest.mark.parametrize("part", ["x", None, [], 10**20])
def test_a_part_that_is_no_number_is_refused_in_a_sentence(tmp_path, part):
    write_sample_run(tmp_path)
    path = run_models(tmp_path)
    semantics = json.dumps(
        {"type": "RoofSurface", "hiproof_part": part, "hiproof_part_type": "gable"}
    )
    path.write_text(path.read_text().replace('{"type": "RoofSurface"}', semantics))
    sentence = r"expected building house-1 in line 2 of .* as the number of a part"
    with pytest.raises(InputError, match=sentence):
        list(read_models(path))


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="expected a readable text file"):
        list(read_models(tmp_path / "none.json"))
