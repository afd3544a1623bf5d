"""Runs of several surveys: the newest that covers a building, or all that show its roof."""

import json

import numpy as np
import pyogrio
import pytest
import shapely
from click.testing import CliRunner

from hiproof import InputError, SettingsError
from hiproof.cli.app import app
from hiproof.edit.points import RunPoints
from hiproof.errors import InputWarning
from hiproof.evaluate.run import evaluate_run
from hiproof.parametric.run import build_file
from hiproof.update.dates import choose_clouds
from hiproof.update.run import update_area
from run_records import by_id, records
from tiny_town import make_town, write_footprints
from tiny_updates import lay_bare, make_request, raise_house

RAISED_M = 2.0
YEARS = {"house-0": "1990", "house-1": "2019", "house-2": "1990", "house-3": "2019"}


@pytest.fixture(scope="module")
def surveys(tmp_path_factory):
    """Two surveys of the tiny town: house-1 was raised, and the later one misses house-2."""
    folder, first, second = tmp_path_factory.mktemp("surveys"), make_town(), make_town(seed=7)
    raise_house(second, "house-1", RAISED_M)
    second = second.select(~second.lie_in(second.footprints["house-2"]))
    second.xyz[:, 2] += 0.3  # the later survey lies higher on the whole
    for name, town in (("2014", first), ("2020-05-01", second)):
        (folder / name).mkdir()
        town.write(folder / name / "tile.laz")
    write_footprints(folder / "footprints.geojson", first.footprints)
    collection = json.loads((folder / "footprints.geojson").read_text())
    for feature in collection["features"]:
        feature["properties"]["year"] = YEARS[next(iter(feature["properties"].values()))]
    (folder / "footprints.geojson").write_text(json.dumps(collection))
    return folder


def run(surveys, out, *words):
    epochs = [f"--epoch={name}={surveys / name}" for name in ("2014", "2020-05-01")]
    paths = ["--footprints", str(surveys / "footprints.geojson"), "--out", str(out), "--jobs", "1"]
    result = CliRunner().invoke(app, ["reconstruct", *epochs, *paths, *words])
    assert result.exit_code == 0, result.output
    return by_id(out)


@pytest.fixture(scope="module")
def houses(surveys, tmp_path_factory):
    out = tmp_path_factory.mktemp("several")
    return run(surveys, out), out


def test_each_house_is_made_of_the_newest_survey_and_of_those_that_agree(houses):
    found, _ = houses
    both = ["2014", "2020-05-01"]
    used = {id: (row["survey_date"], row["epochs_used"]) for id, row in found.items()}
    assert used["house-0"] == used["house-3"] == ("2020-05-01", both)
    assert used["house-1"] == ("2020-05-01", both[1:])
    assert used["house-2"] == ("2014", both[:1])


def test_a_house_that_the_newest_survey_shows_pulled_down_has_no_older_model(tmp_path):
    """Of another one half lies bare: the older survey shows it whole."""
    first, second = make_town(), make_town(seed=7)
    x0, y0, x1, y1 = first.footprints["house-0"].bounds
    half = shapely.box((x0 + x1) / 2, y0, x1, y1)
    lay_bare(second, "house-0", 0.5), lay_bare(second, "house-2", 0.0)
    for name, town in (("2014", first), ("2020-05-01", second)):
        (tmp_path / name).mkdir()
        town.write(tmp_path / name / "tile.laz")
    write_footprints(tmp_path / "footprints.geojson", first.footprints)
    found = run(tmp_path, tmp_path / "out")
    assert [id for id, row in found.items() if not row.get("parts")] == ["house-2"]
    assert "its ground lies bare" in found["house-2"]["detail"]
    assert {found[id]["survey_date"] for id in ("house-0", "house-1", "house-3")} == {"2020-05-01"}
    outline = shapely.Polygon(found["house-0"]["parts"][0]["outlines"][0][0])
    assert outline.area == pytest.approx(half.area, rel=0.15)


def test_points_of_both_surveys_count_and_lie_in_the_frame_of_the_newest(houses, surveys, tmp_path):
    found, out = houses
    alone = run(surveys, tmp_path, "--year-column", "year")
    assert found["house-3"]["points"] > 1.8 * alone["house-3"]["points"]
    record = json.loads((out / "run.json").read_text())["epochs"]
    assert record["2014"]["shift"]["xyz"][2] == pytest.approx(-0.3, abs=0.03)
    assert record["2020-05-01"]["shift"] is None


@pytest.mark.parametrize(
    ("raised_m", "expected"), [(RAISED_M, {"unchanged": 4}), (0.0, {"unchanged": 3, "changed": 1})]
)
def test_an_update_compares_each_house_with_the_surveys_of_its_model(
    raised_m, expected, houses, tmp_path
):
    """The first survey shows house-1 as it was before its model, and lies 0.3 m lower."""
    town = make_town(seed=9)
    raise_house(town, "house-1", raised_m)
    cloud = town.write(tmp_path / "third.laz", [0.0, 0.0, 0.5])
    summary = update_area(make_request(houses[1], cloud, tmp_path / "out"))
    assert summary.by_change == expected
    assert summary.surveys.shift.clear_xyz[2] == pytest.approx(0.2, abs=0.03)
    if raised_m == 0.0:
        place = by_id(tmp_path / "out")["house-1"]["change"]["places"][0]
        assert place["kind"] == "roof_lowered"
        assert place["difference"] == pytest.approx(-RAISED_M, abs=0.05)


def test_evaluation_and_editor_take_the_surveys_of_a_model(houses):
    found, out = houses
    run, editor = evaluate_run(out), RunPoints(out)
    for model, points, figures in zip(run.models, run.points, run.figures, strict=True):
        assert len(points) == found[model.id]["points"], model.id
        assert figures.quality.share_within_20cm == pytest.approx(1.0, abs=0.02), model.id
        drawn = editor.of(found[model.id])
        np.testing.assert_allclose(sort_rows(drawn), sort_rows(points), atol=1e-6)


def sort_rows(points):
    return points[np.lexsort(points.T)]


def test_surveys_before_the_year_of_a_house_do_not_count(surveys, tmp_path):
    found = run(surveys, tmp_path, "--year-column", "year")
    assert found["house-3"]["epochs_used"] == ["2020-05-01"]
    assert found["house-0"]["epochs_used"] == ["2014", "2020-05-01"]


def test_the_files_say_which_surveys_were_used_and_build_makes_them_again(houses, tmp_path):
    _, out = houses
    feature = json.loads((out / "buildings.city.jsonl").read_text().splitlines()[1])
    attributes = next(iter(feature["CityObjects"].values()))["attributes"]
    assert attributes["hiproof_survey_date"] == "2020-05-01"
    assert attributes["hiproof_epochs_used"] == "2014 2020-05-01"
    fields = pyogrio.read_info(out / "buildings.gpkg", layer="buildings")["fields"]
    assert {"hiproof_survey_date", "hiproof_epochs_used"} <= set(fields)
    build_file(out / "parameters.jsonl", tmp_path)
    assert records(tmp_path) == records(out)


def test_the_same_call_again_keeps_what_is_done(houses, surveys):
    found, out = houses
    before = {name: data for name, data in records(out).items()}
    assert run(surveys, out) == found
    assert records(out) == before


def test_bad_surveys_are_refused_in_a_sentence(surveys, tmp_path):
    first = f"2014={surveys / '2014'}"
    cases = [
        ([first, first], "every --epoch once, got 2014 and 2014"),
        (["2014-05-01=a", first], "every --epoch once, got 2014 and 2014-05-01"),
        (["1014=a", first], "got '1014=a'; name each survey by its year or day, from 1990 on"),
        ([first, f"2020={surveys / '2014'}"], "other clouds in each --epoch"),
        ([first, f"later={surveys / '2014'}"], "name each survey by its year or day"),
        ([first, "2020="], "name each survey by its year or day"),
        ([first, f"2020={tmp_path / 'nowhere'}"], "nowhere"),
    ]
    for epochs, text in cases:
        with pytest.raises(InputError, match=text):
            choose_clouds((), epochs)
    with pytest.raises(InputError, match="expected clouds or --epoch"):
        choose_clouds(("tile.laz",), [first])
    with pytest.warns(InputWarning, match="of 2914-01-01 is dated in the future"):
        choose_clouds((), [first, f"2914={surveys / '2020-05-01'}"])


def test_a_shift_without_surveys_is_refused(surveys, tmp_path):
    cloud = next(path for path in (surveys / "2014").iterdir() if path.suffix == ".laz")
    words = [str(cloud), "--shift", "off", "--out", str(tmp_path / "o")]
    result = CliRunner().invoke(app, ["reconstruct", *words])
    assert isinstance(result.exception, SettingsError)
    assert "expected surveys (--epoch) with --shift" in str(result.exception)
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize("crs", ["EPSG:25832", "EPSG:2225"])  # another place; feet
def test_surveys_in_other_crs_or_units_are_refused(surveys, crs, tmp_path):
    make_town().write(tmp_path / "tile.laz", crs=crs)
    epochs = [f"--epoch=2014={surveys / '2014'}", f"--epoch=2020={tmp_path / 'tile.laz'}"]
    paths = ["--footprints", str(surveys / "footprints.geojson"), "--out", str(tmp_path / "o")]
    result = CliRunner().invoke(app, ["reconstruct", *epochs, *paths])
    assert isinstance(result.exception, InputError)
    assert f"expected all clouds in one CRS, got {crs}" in str(result.exception)
    assert not list((tmp_path / "o").glob("buildings*"))


def test_surveys_without_footprints_are_refused(surveys, tmp_path):
    words = ["--epoch", f"2014={surveys / '2014'}", "--out", str(tmp_path / "o")]
    result = CliRunner().invoke(app, ["reconstruct", *words])
    assert "expected --footprints with --epoch" in str(result.exception)
