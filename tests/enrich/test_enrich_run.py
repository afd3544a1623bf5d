"""`hiproof enrich`: files with answers, beside a run that stays as it was."""

import json
import sqlite3

import pytest
from click.testing import CliRunner
from lxml import etree

from hiproof.cli.app import app
from hiproof.enrich import run as enrich_module
from hiproof.enrich.run import enrich_run
from hiproof.errors import HiproofError, InputError, OutputError
from hiproof.parametric.finished import open_run
from hiproof.parametric.run import build_file
from hiproof.settings import EnrichSettings
from hiproof.simulate import demo_files
from streets import lose_house, place_house, write_street

FILES = ("buildings.gml", "buildings.city.jsonl", "buildings.gpkg")


def make_street():
    row = [
        place_house(f"h{k}", 6.0 * k, 0.0, eave=5.0 + k % 2, rise=3.0, year=1900 + k)
        for k in range(5)
    ]
    return [*row, lose_house("lost", 40.0, 0.0)]


def read_files(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def read_features(folder):
    lines = (folder / "buildings.city.jsonl").read_text().splitlines()[1:]
    return {
        feature["id"]: feature["CityObjects"][feature["id"]] for feature in map(json.loads, lines)
    }


@pytest.fixture
def run(tmp_path):
    return write_street(tmp_path / "run", make_street())


def test_every_file_has_the_answers(run):
    result = CliRunner().invoke(app, ["enrich", str(run), "--jobs", "1"])
    assert result.exit_code == 0 and "6 buildings enriched" in result.output
    out = run / "enriched"
    assert sorted(read_files(out)) == sorted([*FILES, "run.json"])
    middle = read_features(out)["h1"]
    assert middle["attributes"]["hiproof_party_wall_area_m2"] == pytest.approx(130, abs=0.01)
    surfaces = middle["geometry"][-1]["semantics"]["surfaces"]
    assert {s["hiproof_party_with"] for s in surfaces if "hiproof_party_with" in s} == {"h0", "h2"}
    gml = etree.parse(out / "buildings.gml")
    names = gml.xpath("//*[local-name()='WallSurface']/*[@name='hiproof_party_with']/*/text()")
    assert set(names) == {"h0", "h1", "h2", "h3", "h4"}
    with sqlite3.connect(out / "buildings.gpkg") as file:
        rows = dict(file.execute("SELECT id, b3_opp_scheidingsmuur FROM buildings"))
    assert rows["h1"] == middle["attributes"]["b3_opp_scheidingsmuur"] and rows["lost"] is None
    assert json.loads((out / "run.json").read_text())["enriched"]["touch_m"] == 0.3


def test_a_second_call_replaces_the_first(run):
    enrich_run(run, settings=EnrichSettings(touch_m=0.0))
    first = read_files(run / "enriched")
    enrich_run(run, settings=EnrichSettings(touch_m=0.3))
    enrich_run(run, settings=EnrichSettings(touch_m=0.0))
    assert read_files(run / "enriched") == first


def test_enriched_files_are_models_and_the_run_s_own_stay(run):
    before = read_files(run)
    enrich_run(run)
    assert read_files(run) == before
    models = {building.id: building for building in open_run(run / "enriched")}
    own = {building.id: building for building in open_run(run)}
    assert list(models) == list(own)
    for id in ("h0", "h1", "h4"):
        assert models[id].volume == pytest.approx(own[id].volume, rel=1e-5)


def test_files_depend_on_no_blocks_nor_processes(run, tmp_path, monkeypatch):
    enrich_run(run, tmp_path / "one")
    monkeypatch.setattr(enrich_module, "BLOCK_BUILDINGS", 2)
    enrich_run(run, tmp_path / "three", processes=2)
    one, three = read_files(tmp_path / "one"), read_files(tmp_path / "three")
    assert {name: one[name] for name in FILES[:2]} == {name: three[name] for name in FILES[:2]}


def test_an_interrupted_command_goes_on(run, tmp_path, monkeypatch):
    monkeypatch.setattr(enrich_module, "BLOCK_BUILDINGS", 2)
    enrich_run(run, tmp_path / "whole")
    made = []

    def fail_at_last(parameters, settings, block, first, last):
        if first == 4 and not made.count(4):
            made.append(first)
            raise KeyboardInterrupt
        made.append(first)
        enrich_block(parameters, settings, block, first, last)

    enrich_block = enrich_module.enrich_block
    monkeypatch.setattr(enrich_module, "enrich_block", fail_at_last)
    with pytest.raises(KeyboardInterrupt):
        enrich_run(run, processes=1)
    assert not any((run / "enriched" / name).exists() for name in FILES)
    enrich_run(run, processes=1)
    assert made == [0, 2, 4, 4]
    whole, resumed = read_files(tmp_path / "whole"), read_files(run / "enriched")
    assert {name: resumed[name] for name in FILES[:2]} == {name: whole[name] for name in FILES[:2]}
    assert not (run / "enriched" / ".enrich").exists()


def test_an_interrupted_second_call_leaves_the_files_of_the_first(run, monkeypatch):
    def fail(*arguments):
        raise KeyboardInterrupt

    enrich_run(run, settings=EnrichSettings(touch_m=0.0))
    first = read_files(run / "enriched")
    monkeypatch.setattr(enrich_module, "enrich_block", fail)
    with pytest.raises(KeyboardInterrupt):
        enrich_run(run, processes=1)
    assert read_files(run / "enriched") == first


def test_a_run_is_not_overwritten(run):
    with pytest.raises(OutputError, match="which holds a run; choose another --out"):
        enrich_run(run, run)


def test_two_buildings_of_one_id_are_refused(tmp_path):
    folder = write_street(tmp_path, [place_house("a", 0, 0), place_house("a", 9, 0)])
    with pytest.raises(InputError, match="'a' twice; give one another"):
        enrich_run(folder)


def test_a_building_that_cannot_be_built_does_not_end_the_run(tmp_path):
    bad = place_house("bad", 6.0, 0.0)
    bad["parts"][0]["position"] = [0, 0, -50]
    folder = write_street(tmp_path, [place_house("a", 0, 0), bad])
    result = CliRunner().invoke(app, ["enrich", str(folder)])
    assert result.exit_code == 2 and "1 of 2 buildings enriched" in result.output
    attributes = read_features(tmp_path / "enriched")["bad"]["attributes"]
    assert attributes["hiproof_status"] == "not_built"
    assert f"not enriched: building bad: {attributes['hiproof_not_enriched']}\n" in result.output
    assert read_features(tmp_path / "enriched")["a"]["attributes"]["hiproof_neighbours_unknown"]


def test_a_building_that_fails_is_named_and_the_others_have_answers(run, monkeypatch):
    def fail_at_h1(town, number, *rest):
        if number == 1:
            raise ArithmeticError("the wall is bent")
        return answer(town, number, *rest)

    answer = enrich_module.answer
    monkeypatch.setattr(enrich_module, "answer", fail_at_h1)
    result = CliRunner().invoke(app, ["enrich", str(run), "--jobs", "1"])
    assert result.exit_code == 1 and "5 of 6 buildings enriched" in result.output
    assert "not enriched: building h1: ArithmeticError: the wall is bent" in result.output
    features = read_features(run / "enriched")
    assert "the wall is bent" in features["h1"]["attributes"]["hiproof_not_enriched"]
    assert "hiproof_party_walls" not in features["h1"]["attributes"]
    assert features["h1"]["geometry"][-1]["type"] == "Solid"
    assert features["h2"]["attributes"]["hiproof_party_wall_area_m2"] > 0
    assert json.loads((run / "enriched" / "run.json").read_text())["enriched"]["not_enriched"] == 1


def test_failures_of_an_interrupted_command_are_kept(run, monkeypatch):
    def fail(town, number, *rest):
        if number == 1:
            raise ArithmeticError("the wall is bent")
        if number == 4 and not interrupted:
            interrupted.append(number)
            raise KeyboardInterrupt
        return answer(town, number, *rest)

    answer, interrupted = enrich_module.answer, []
    monkeypatch.setattr(enrich_module, "BLOCK_BUILDINGS", 2)
    monkeypatch.setattr(enrich_module, "answer", fail)
    with pytest.raises(KeyboardInterrupt):
        enrich_run(run, processes=1)
    monkeypatch.setattr(enrich_module, "answer", answer)
    resumed = enrich_run(run, processes=1)
    assert [failure.id for failure in resumed.failures] == ["h1"] and resumed.exit_code == 1


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """A run of two houses, enriched by the command that made it."""
    folder, files = tmp_path_factory.mktemp("demo") / "models", demo_files()
    command = ["reconstruct", str(files["cloud"]), "--footprints", str(files["footprints"])]
    command += ["--where", "id < 'house-02'", "--out", str(folder), "--jobs", "1", "--enrich"]
    return folder, command, CliRunner().invoke(app, [*command, "--touch", "0.1"])


def test_a_run_and_its_answers_are_one_command(demo):
    folder, _, result = demo
    assert result.exit_code == 0, result.output
    own, enriched = read_features(folder), read_features(folder / "enriched")
    assert list(own) == list(enriched)
    assert all("hiproof_party_walls" in values["attributes"] for values in enriched.values())
    assert json.loads((folder / "enriched" / "run.json").read_text())["enriched"]["touch_m"] == 0.1


def test_other_answers_fit_no_building_again(demo):
    folder, command, _ = demo
    before = (folder / "parameters.jsonl").stat().st_mtime_ns
    assert CliRunner().invoke(app, [*command, "--touch", "0.2"]).exit_code == 0
    assert (folder / "parameters.jsonl").stat().st_mtime_ns == before
    assert json.loads((folder / "enriched" / "run.json").read_text())["enriched"]["touch_m"] == 0.2


@pytest.mark.parametrize(
    "options, reason",
    [
        (["--touch", "0.1"], "expected --enrich with options of `hiproof enrich`, got none"),
        (["--enrich", "--weather", "a.epw"], "expected --weather with --sun, got it alone"),
        (["--enrich", "--energy-ade", "--citygml", "3.0"], "expected a run with CityGML 2.0"),
    ],
)
def test_options_that_lack_another_are_refused_before_the_run(options, reason, tmp_path):
    command = ["reconstruct", str(demo_files()["cloud"]), "--out", str(tmp_path / "out"), *options]
    result = CliRunner().invoke(app, command)
    assert isinstance(result.exception, HiproofError) and reason in str(result.exception)
    assert not (tmp_path / "out").exists()


def test_parameters_without_an_offset_are_enriched(tmp_path):
    folder = write_street(tmp_path / "run", make_street(), cityjson_offset=None)
    enrich_run(folder)
    build_file(folder / "parameters.jsonl", tmp_path / "built")
    heads = [
        json.loads((path / "buildings.city.jsonl").read_text().splitlines()[0])["transform"]
        for path in (folder / "enriched", tmp_path / "built")
    ]
    assert heads[0] == heads[1]
