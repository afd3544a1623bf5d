"""Laws of a whole run: files in, files out, every building with an outcome, whatever happens on the
way.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
import warnings

import numpy as np
import pyogrio
import pytest
import shapely
from click.testing import CliRunner

import planted
from hiproof import read_parameters
from hiproof.city import run as city_run
from hiproof.city.run import Request, reconstruct_area
from hiproof.city.work.warm import make_ready
from hiproof.cli.app import app
from hiproof.compose import check_solid
from hiproof.errors import InputError
from hiproof.evaluate.run import evaluate_run
from hiproof.read.models.solids import read_solids
from hiproof.settings import Settings
from layers import write_layer
from programs import run_hiproof
from run_records import RECORDS, records
from tiny_town import make_town, write_cloud, write_footprints


def parameters(out):
    return read_parameters(out / "parameters.jsonl")


def test_every_building_is_modelled_validly(town_run):
    out = town_run
    assert {row["status"] for row in parameters(out)} == {"modelled"}
    solids = list(read_solids(out / "buildings.city.jsonl"))
    assert [id for id, _ in solids] == [f"house-{i}" for i in range(4)]
    assert all(check_solid(solid, planarity_m=0.01) == () for _, solid in solids)
    assert len(list(read_solids(out / "buildings.gml"))) == 4
    assert {p.name for p in out.iterdir()} == {*RECORDS, "buildings.gpkg", "run.json", ".hiproof"}


def test_the_run_record_names_settings_version_inputs_and_counts(town_run):
    record = json.loads((town_run / "run.json").read_text())
    assert Settings.from_dict(record["settings"]) == Settings()
    assert record["summary"]["buildings"] == 4
    assert record["inputs"]["footprints"].endswith("footprints.geojson")
    assert set(record["seconds"]) == {"plan", "prepare", "sort", "solve", "merge"}


def test_a_run_is_measured_against_the_footprints_that_it_read(town_files, tmp_path):
    cloud, footprints = town_files
    _, _, geometry, _ = pyogrio.raw.read(footprints)
    # whose features are numbered 1 to 4, and called 4 to 1
    names, path = {"number": np.arange(4, 0, -1)}, tmp_path / "numbered.gpkg"
    numbered = str(write_layer(path, shapely.from_wkb(geometry), names))
    options = {"id_attribute": "number", "where": "number <> 2"}
    reconstruct_area(Request((str(cloud),), tmp_path / "out", numbered, **options))
    run = evaluate_run(tmp_path / "out")
    assert [model.id for model in run.models] == ["4", "3", "1"]
    assert [f.quality.outline_iou > 0.95 for f in run.figures] == [True] * 3
    of_id = dict(zip("4321", shapely.from_wkb(geometry), strict=True))
    assert all(area.equals(of_id[m.id]) for m, area in zip(run.models, run.footprints, strict=True))


def test_what_a_run_begun_anew_does_not_write_is_not_left_from_before(
    town_files, tmp_path, quick_tiles
):
    def run(**settings):
        types_found = Settings.from_dict(settings)
        reconstruct_area(
            Request((town_files[0],), tmp_path, town_files[1], settings=types_found, restart=True)
        )

    run(write={"citygml": "both"})
    (tmp_path / "buildings.parquet").write_text("not a file of this run")
    run(city={"models": "tiles"})
    assert {path.name for path in tmp_path.glob("*.*")} == {
        *(".hiproof", "buildings.gpkg", "buildings.parquet", "parameters.jsonl", "run.json")
    }
    with pytest.raises(InputError, match="got those of work tiles alone"):
        evaluate_run(tmp_path)


def test_the_demo_replaces_itself_and_nobody_elses_run(town_files, tmp_path, quick_tiles):
    reconstruct_area(Request((town_files[0],), tmp_path / "own", town_files[1]))
    old_records = records(tmp_path / "own")
    refused = CliRunner().invoke(app, ["demo", "--out", str(tmp_path / "own")])
    assert (
        "expected a folder for the demo" in str(refused.exception)
        and records(tmp_path / "own") == old_records
    )
    for _ in range(2):
        assert CliRunner().invoke(app, ["demo", "--out", str(tmp_path / "demo")]).exit_code == 0


def test_what_is_written_is_asked_for_in_the_same_words_of_a_run_and_of_its_parameters(
    town_files, tmp_path
):
    cloud, footprints = town_files
    request = ["--citygml", "both", "--osm-tags", "--lods", "0,2.2"]
    run = CliRunner().invoke(
        app,
        ["reconstruct", cloud, "--footprints", footprints, "--out", f"{tmp_path}/run", *request],
    )
    assert run.exit_code == 0, run.output
    for name, options in (("as told", []), ("asked", ["--citygml", "3.0", "--no-osm-tags"])):
        result = CliRunner().invoke(
            app,
            ["build", f"{tmp_path}/run/parameters.jsonl", "--out", f"{tmp_path}/{name}", *options],
        )
        assert result.exit_code == 0, result.output
    built_files = {
        path.name
        for path in (tmp_path / "run").iterdir()
        if path.is_file() and path.name != "run.json"
    }
    assert built_files == {*RECORDS, "buildings.citygml3.gml", "buildings.gpkg"}
    for name in built_files:
        text = (tmp_path / "run" / name).read_bytes()
        assert (tmp_path / "as told" / name).read_bytes() == text, name
        assert (b"roof:shape" in text) == (name != "parameters.jsonl"), name
    run_files = {
        path.name: path.read_bytes() for path in (tmp_path / "asked").iterdir() if path.is_file()
    }
    assert built_files - run_files.keys() == {"buildings.gml"} and not any(
        b"roof:shape" in text for text in run_files.values()
    )


def test_heights_are_the_towns(town_run):
    heights = {
        id: solid.vertices[:, 2] for id, solid in read_solids(town_run / "buildings.city.jsonl")
    }
    for i in range(3):
        assert heights[f"house-{i}"].max() == pytest.approx(2 + 8 + 0.3 * i + 0.14, abs=0.35)
        assert heights[f"house-{i}"].min() == pytest.approx(2 + 0.3 * i + 0.08, abs=0.15)


def test_running_again_redoes_nothing_and_changes_nothing(town_run, town_files, tmp_path):
    out = shutil.copytree(town_run, tmp_path / "run")
    times = {name: (out / name).stat().st_mtime_ns for name in RECORDS}
    repeat = reconstruct_area(Request((town_files[0],), out, town_files[1]))
    assert repeat.by_status == {"modelled": 4} and repeat.exit_code == 0
    assert {name: (out / name).stat().st_mtime_ns for name in RECORDS} == times


def test_how_the_area_is_cut_changes_no_byte(town_run, tmp_path):
    town = make_town()
    rng = np.random.default_rng(3)
    names = rng.permutation(9)
    part = (town.xyz[:, 0] // 13).astype(int) % 3 * 3 + (town.xyz[:, 1] // 9).astype(int) % 3
    clouds = []
    for number, name in enumerate(names):
        members = rng.permutation(
            np.flatnonzero(
                (part == number) | ((part == (number + 1) % 9) & (rng.random(len(part)) < 0.2))
            )
        )
        xyz, classes = town.xyz[members], town.classification[members]
        clouds.append(str(write_cloud(tmp_path / f"{name}.laz", xyz, classes)))
    footprints = write_footprints(tmp_path / "footprints.geojson", town.footprints)
    reconstruct_area(Request(tuple(sorted(clouds)), tmp_path / "out", str(footprints)))
    assert records(tmp_path / "out") == records(town_run)


@pytest.mark.parametrize("processes", [1, 2])
def test_progress_is_by_building(town_files, tmp_path, quick_tiles, processes):
    """In this process every building is told of; workers are asked from time to time."""
    steps = []
    request = Request((town_files[0],), tmp_path, town_files[1], processes=processes)
    reconstruct_area(request, lambda *progress: steps.append(progress))
    counts = [finished for step, finished, total in steps if step == "solve" and total == 4]
    assert counts == sorted(counts) and counts[0] == 0 and counts[-1] == 4
    assert processes > 1 or set(counts) == {0, 1, 2, 3, 4}


def test_two_workers_change_no_byte_and_compile_nothing(
    town_run, town_files, tmp_path, monkeypatch, spawned_workers
):
    monkeypatch.setattr("hiproof.city.plan.prepare.MOST_BUILDINGS_A_TILE", 1)
    make_ready()
    monkeypatch.setattr(city_run, "solve_tile", planted.solve_without_compiling)
    reconstruct_area(Request((town_files[0],), tmp_path, town_files[1], processes=2))
    assert records(tmp_path) == records(town_run)


def test_an_interrupted_run_goes_on_and_ends_the_same(town_run, town_files, tmp_path, monkeypatch):
    monkeypatch.setattr("hiproof.city.plan.prepare.MOST_BUILDINGS_A_TILE", 1)
    request = Request((town_files[0],), tmp_path, town_files[1])

    def interrupt(step, finished, total):
        if step == "solve" and finished == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reconstruct_area(request, interrupt)
    assert not (tmp_path / "buildings.gml").exists()
    solved = []
    original = city_run.solve_tile
    monkeypatch.setattr(
        city_run, "solve_tile", lambda *task: solved.append(task[1]) or original(*task)
    )
    reconstruct_area(request)
    assert len(solved) == 3  # the interrupt came before the second tile was written
    assert records(tmp_path) == records(town_run)


def test_a_killed_run_goes_on_and_ends_the_same(town_run, town_files, tmp_path):
    cloud, footprints = town_files
    command = [sys.executable, "-m", "hiproof", "reconstruct", cloud, "--footprints", footprints]
    command, environment = [*command, "--out", tmp_path], {**os.environ, "PYTHONPATH": "src"}
    process = subprocess.Popen(command, env=environment)
    while not (tmp_path / ".hiproof" / "plan.jsonl").exists() and process.poll() is None:
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert subprocess.run(command, env=environment, check=False).returncode == 0
    assert records(tmp_path) == records(town_run)


def test_strange_footprints_each_get_an_outcome(tmp_path):
    town = make_town()
    x, y = town.xyz[:, :2].min(axis=0)
    footprints = {
        **town.footprints,
        "bow-tie": shapely.Polygon(
            [(x + 8, y + 12), (x + 20, y + 20), (x + 20, y + 12), (x + 8, y + 20)]
        ),
        "empty": shapely.Polygon(),
        "line": shapely.Polygon([(x, y), (x + 5, y), (x + 10, y), (x, y)]),
        "away from points": shapely.box(x + 500, y, x + 510, y + 10),
        "again": town.footprints["house-0"],
    }
    cloud = write_cloud(tmp_path / "cloud.laz", town.xyz, town.classification)
    with pytest.warns(UserWarning):
        path = write_footprints(tmp_path / "footprints.geojson", footprints)
        summary = reconstruct_area(Request((str(cloud),), tmp_path / "out", str(path)))
    by_id = {row["id"]: row["status"] for row in parameters(tmp_path / "out")}
    assert summary.exit_code == 0
    assert by_id["house-0"] == by_id["again"] == "modelled"
    assert by_id["empty"] == by_id["line"] == "bad_footprint"
    assert by_id["away from points"] == "no_points"
    assert any(id.startswith("bow-tie") for id in by_id)


def test_without_footprints_the_cloud_is_split(town_files, tmp_path):
    summary = reconstruct_area(Request((town_files[0],), tmp_path))
    assert summary.by_status == {"modelled": 4} and summary.exit_code == 0


def test_a_building_class_that_was_asked_for_and_is_not_there_is_refused(town_files, tmp_path):
    settings = Settings.from_dict({"read": {"building_classes": [67]}})
    for footprints in (town_files[1], None):
        with pytest.raises(InputError, match=r"class 67.*--building-class"):
            reconstruct_area(
                Request((town_files[0],), tmp_path, footprints, settings=settings, restart=True)
            )


def test_without_a_ground_class_the_ground_is_found(tmp_path):
    town = make_town()
    cloud = write_cloud(tmp_path / "cloud.laz", town.xyz, np.where(town.classification == 2, 1, 6))
    path = write_footprints(tmp_path / "footprints.geojson", town.footprints)
    reconstruct_area(Request((str(cloud),), tmp_path / "out", str(path)))
    assert b"ground found by its shape" in (tmp_path / "out" / "buildings.city.jsonl").read_bytes()


@pytest.mark.parametrize(
    ("of_cloud", "of_footprints"), [("EPSG:7415", None), (None, "EPSG:28992"), (None, None)]
)
def test_the_output_carries_the_reference_system_that_any_input_names(
    of_cloud, of_footprints, tmp_path, quick_tiles
):
    town = make_town(houses=1)
    cloud = write_cloud(tmp_path / "cloud.laz", town.xyz, town.classification, of_cloud)
    path = write_footprints(tmp_path / "footprints.gpkg", town.footprints, of_footprints)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reconstruct_area(Request((str(cloud),), tmp_path / "out", str(path)))
    header = json.loads((tmp_path / "out" / "buildings.city.jsonl").read_text().splitlines()[0])
    expected = next((code.split(":")[1] for code in (of_cloud, of_footprints) if code), None)
    assert header.get("metadata", {}).get("referenceSystem", "/None").rsplit("/", 1)[1] == str(
        expected
    )


def invoke(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def test_the_command_line_says_what_it_did(town_files, tmp_path):
    got = invoke("reconstruct", town_files[0], "--footprints", town_files[1], "--out", tmp_path)
    assert got.exit_code == 0, got.output
    assert "4 buildings" in got.output
    assert (
        invoke("check", tmp_path / "buildings.city.jsonl", tmp_path / "buildings.gml").exit_code
        == 0
    )
    assert "buildings done: 4 of 4" in invoke("status", tmp_path).output


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["reconstruct", "missing.laz", "--out", "{out}"], "missing.laz"),
        (["reconstruct", "{cloud}", "--out", "{cloud}/x"], "--out"),
        (
            ["reconstruct", "{cloud}", "--out", "{out}", "--footprints", "missing.gpkg"],
            "missing.gpkg",
        ),
        (
            ["reconstruct", "{cloud}", "--out", "{out}", "--objective", "pretty"],
            "likelihood, paper",
        ),
        (["check", "missing.city.jsonl"], "missing.city.jsonl"),
        (["status", "{out}"], "ledger"),
    ],
)
def test_wrong_usage_gets_one_sentence_and_exit_code_2(
    arguments, expected, town_files, tmp_path, capsys
):
    assert run_hiproof(*(a.format(cloud=town_files[0], out=tmp_path) for a in arguments)) == 2
    assert expected in capsys.readouterr().err
