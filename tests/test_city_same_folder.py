"""An output folder belongs to one request and to one run at a time, and holds what the run says it
holds.
"""

import dataclasses
import os
import pickle
import shutil
import signal
import sqlite3
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
import shapely
from click.testing import CliRunner

import hiproof
from handmade import courtyard, gable_house, make_building, make_lost_building
from hiproof.city.folder.marks import (
    RESULT,
    SELECTION,
    compute_mark,
    describe,
    file_stamps,
    hold_folder,
)
from hiproof.city.merge.join import broken_claims, claims
from hiproof.city.plan.work_plan import Job, WorkPlan
from hiproof.city.request import Request
from hiproof.city.run import reconstruct_area
from hiproof.cli.app import app
from hiproof.errors import InputError, OutputError
from hiproof.evaluate.models import run_models
from hiproof.model import Footprint
from hiproof.parametric.run import build_file
from hiproof.settings import Settings
from hiproof.write.fragments import load_fragments, save_fragments
from hiproof.write.head import FileHead
from hiproof.write.run_files import fragments
from run_records import records

REQUEST = Request(("a.laz",), Path("out"))
NO_MATTER = {"out", "overrides", "processes", "scheduler", "restart", "use_attribute"}
WHICH = {"footprints", "layer", "id_attribute", "where", "bbox", "underpasses"}


def other(value):
    """A value of the same kind that is another."""
    if dataclasses.is_dataclass(value):
        first = dataclasses.fields(value)[0].name
        return dataclasses.replace(value, **{first: other(getattr(value, first))})
    if isinstance(value, bool):
        return not value
    if isinstance(value, (int, float)):
        return value + 1
    return (
        (*value, 99)
        if isinstance(value, tuple)
        else Path("else")
        if isinstance(value, Path)
        else f"{value} else"
    )


def mark(request):
    return compute_mark(describe(request, RESULT), "salt"), compute_mark(
        describe(request, SELECTION), "salt"
    )


@pytest.mark.parametrize("name", [f.name for f in dataclasses.fields(Request)])
def test_every_field_of_a_request_is_in_its_mark_unless_declared_otherwise(name):
    changed = dataclasses.replace(REQUEST, **{name: other(getattr(REQUEST, name))})
    is_same = [old == new for old, new in zip(mark(REQUEST), mark(changed), strict=True)]
    assert is_same == [name in NO_MATTER | WHICH, name not in WHICH]


def test_a_field_added_later_is_in_the_mark():
    later = dataclasses.make_dataclass("Later", [("later", int, 0)], bases=(Request,), frozen=True)
    assert mark(later(("a.laz",), Path("out"))) != mark(later(("a.laz",), Path("out"), later=1))


@pytest.mark.parametrize("section", [f.name for f in dataclasses.fields(Settings)])
def test_every_setting_is_in_the_mark(section):
    values = getattr(Settings(), section)
    for declared in dataclasses.fields(values):
        changed = dataclasses.replace(
            values, **{declared.name: other(getattr(values, declared.name))}
        )
        settings = dataclasses.replace(Settings(), **{section: changed})
        request = dataclasses.replace(REQUEST, settings=settings)
        assert describe(request, RESULT) != describe(REQUEST, RESULT), declared.name


def leaves(value, name=""):
    """(name, declaration, value) of all that is declared in a dataclass and those in it."""
    for declared in dataclasses.fields(value):
        inner, member = f"{name}{declared.name}", getattr(value, declared.name)
        if dataclasses.is_dataclass(member):
            yield from leaves(member, f"{inner}.")
        else:
            yield inner, declared, member


def test_every_text_is_known_to_name_files_or_not():
    texts = {
        name: d
        for name, d, _ in leaves(REQUEST)
        if "str" in str(d.type) and not d.metadata.get("choices")
    }
    files = {name for name, declared in texts.items() if declared.metadata.get("names") == "files"}
    shading = {f"settings.enrich.{name}" for name in ("weather", "horizon", "shading_terrain")}
    assert files == {
        "clouds",
        "footprints",
        "terrain",
        "underpasses",
        "settings.segment.weights",
        *shading,
    }
    names = {
        "settings.read.crs",
        "settings.read.override_columns",
        "settings.read.fallback_roof_height",
        "settings.read.fallback_ground_height",
        "settings.read.clearance_column",
        "settings.read.raised_column",
        "settings.read.year_column",
        "settings.read.shift",
        "epochs",
        "settings.enrich.use_attribute",
        "settings.read.overture_catalogue",
        "settings.fit.types",
        "settings.write.out_crs",
    }
    assert set(texts) - files - NO_MATTER - WHICH == names


def test_a_folder_called_like_a_setting_is_none_of_the_inputs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    settings = Settings.from_dict({"fit": {"types": ["gable"]}})
    request = dataclasses.replace(REQUEST, layer="pand", id_attribute="id", settings=settings)
    old_mark = mark(request)
    for name in ("full", "auto", "one", "merged", "2.2", "gable", "pand", "id"):
        Path(name).mkdir()
        (Path(name) / "file").write_text("anything")
    assert mark(request) == old_mark


@pytest.mark.parametrize("companion", ["a.shp", "a.dbf", "a.prj"])
def test_the_mark_sees_the_files_that_make_up_an_input(tmp_path, companion):
    for name in ("a.shp", "a.dbf", "a.prj", "b.dbf"):
        (tmp_path / name).write_text("before")
    request = dataclasses.replace(REQUEST, footprints=str(tmp_path / "a.shp"))
    old_mark = mark(request)
    (tmp_path / "b.dbf").write_text("someone else's")
    assert mark(request) == old_mark
    (tmp_path / companion).write_text("after, and longer")
    assert mark(request) != old_mark


def test_a_folder_is_stamped_by_its_files_and_no_text_by_accident(tmp_path):
    (tmp_path / "towns.gdb").mkdir()
    (tmp_path / "towns.gdb" / "a00000001.gdbtable").write_text("rows")
    assert len(file_stamps(tmp_path / "towns.gdb")) == 1
    assert file_stamps(Path("x" * 5000)) == file_stamps(Path("a\0b")) == []


def test_another_setting_is_refused_by_name_and_the_same_request_is_not(
    town_files, tmp_path, quick_tiles
):
    request = Request((town_files[0],), tmp_path, town_files[1])
    reconstruct_area(request)
    assert reconstruct_area(request).buildings == 4
    settings = Settings.from_dict({"fit": {"parts": "one"}})
    with pytest.raises(OutputError, match=r"differs in settings\.fit\.parts; .*--restart"):
        reconstruct_area(dataclasses.replace(request, settings=settings))


def test_a_replaced_tile_is_named(town_files, tmp_path, quick_tiles):
    tiles = tmp_path / "tiles"
    tiles.mkdir()
    for name in ("a.laz", "b.laz"):
        shutil.copy(town_files[0], tiles / name)
    request = Request((str(tiles / "a.laz"), str(tiles / "b.laz")), tmp_path / "out", town_files[1])
    reconstruct_area(request)
    os.utime(tiles / "b.laz", (0, 0))
    with pytest.raises(OutputError, match=r"differs in clouds \(b\.laz\); .*--restart"):
        reconstruct_area(request)


def test_a_second_run_in_the_folder_is_refused_while_status_reads(
    town_files, tmp_path, quick_tiles
):
    request, errors = Request((town_files[0],), tmp_path, town_files[1]), []

    def second(step, finished, total):
        if step == "solve" and not errors:
            with pytest.raises(OutputError, match="another run works in"):
                reconstruct_area(dataclasses.replace(request, restart=True))
            errors.append(CliRunner().invoke(app, ["status", str(tmp_path)]).output)

    assert reconstruct_area(request, second).buildings == 4
    assert "buildings done: 0 of 4" in errors[0] and "not finished" in errors[0]


def test_a_lock_holds_across_processes_and_ends_with_kill_9(tmp_path):
    code = "import sys, time\nfrom pathlib import Path\n"
    code += "from hiproof.city.folder.marks import hold_folder\n"
    code += "with hold_folder(Path(sys.argv[1])):\n    print('held', flush=True)\n"
    code += "    time.sleep(60)"
    path = {**os.environ, "PYTHONPATH": str(Path(hiproof.__file__).parents[1])}
    with subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE, env=path
    ) as other:
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(OutputError, match="wait for its end"), hold_folder(tmp_path):
            pass
        other.send_signal(signal.SIGKILL)
        other.wait(timeout=30)
        with hold_folder(tmp_path):
            pass


def test_a_folder_that_cannot_be_locked_says_so(tmp_path):
    (tmp_path / "lock.sqlite").mkdir()
    with pytest.raises(OutputError, match="to lock"), hold_folder(tmp_path):
        pass


@pytest.mark.parametrize(
    ("name", "harm"),
    [
        ("buildings.gml", "removed"),
        ("buildings.gml", "one byte"),
        ("parameters.jsonl", "cut"),
        ("buildings.gpkg", "one byte"),
    ],
)
def test_a_file_that_was_lost_or_damaged_is_made_again(
    harm, name, town_files, reference_run, tmp_path, quick_tiles
):
    request = Request((town_files[0],), tmp_path, town_files[1])
    reconstruct_area(request)
    file = tmp_path / name
    content = bytearray(file.read_bytes())
    if harm == "removed":
        file.unlink()
    else:
        content[len(content) // 2] ^= 1
        changed = bytes(content if harm == "one byte" else content[:-1])
        file.write_bytes(changed)
    with pytest.warns(UserWarning, match=f"{name} is gone or not as the run left it"):
        reconstruct_area(request)
    assert records(tmp_path) == records(reference_run)
    assert file.read_bytes() == (reference_run / name).read_bytes()
    kept = [path.read_bytes() for path in tmp_path.glob("parameters.edited-*")]
    is_kept = name == "parameters.jsonl" and harm != "removed"
    assert kept == ([changed] if is_kept else [])  # a person may have edited it
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        reconstruct_area(request)


@pytest.mark.parametrize(
    "settings",
    [{}, {"city": {"models": "tiles"}}, {"city": {"models": "both"}, "write": {"citygml": "3.0"}}],
    ids=["merged", "tiles", "both, CityGML 3.0"],
)
def test_models_stand_where_the_summary_says(town_files, tmp_path, quick_tiles, settings):
    request = Request(
        (town_files[0],), tmp_path, town_files[1], settings=Settings.from_dict(settings)
    )
    summary = reconstruct_area(request)
    assert summary.models and all(place.exists() for place in summary.models)
    built = build_file(tmp_path / "parameters.jsonl", tmp_path / "built")
    assert len(built.models) == 2 and all(place.exists() for place in built.models)
    if (tmp_path / "models") in summary.models and not (tmp_path / "buildings.city.jsonl").exists():
        with pytest.raises(InputError, match=r"those of work tiles alone, .*; `hiproof build"):
            run_models(tmp_path)


def test_models_of_work_tiles_are_claimed_too(town_files, tmp_path, quick_tiles):
    settings = Settings.from_dict({"city": {"models": "tiles"}})
    request = Request((town_files[0],), tmp_path, town_files[1], settings=settings)
    reconstruct_area(request)
    lost = next((tmp_path / "models").glob("*.gml"))
    content = lost.read_bytes()
    lost.unlink()
    with pytest.warns(UserWarning, match=lost.name):
        reconstruct_area(request)
    assert lost.read_bytes() == content


def test_a_table_that_was_only_looked_at_stands(town_files, tmp_path, quick_tiles):
    request = Request((town_files[0],), tmp_path, town_files[1])
    reconstruct_area(request)
    table = tmp_path / "buildings.gpkg"
    claimed, content = claims([table], tmp_path), table.read_bytes()
    viewer = sqlite3.connect(table)
    viewer.execute("pragma journal_mode=wal")
    assert viewer.execute("select count(*) from buildings").fetchone() == (4,)
    viewer.execute("pragma journal_mode=delete")
    viewer.close()
    assert table.read_bytes() != content and broken_claims(claimed, tmp_path) == []
    with sqlite3.connect(table) as editor:
        editor.execute("update gpkg_contents set description = 'other'")
    editor.close()
    assert broken_claims(claimed, tmp_path) == ["buildings.gpkg"]


class Bomb:
    """Unpickling it would make a file."""

    def __init__(self, mark):
        self.mark = mark

    def __reduce__(self):
        return (open, (str(self.mark), "w"))


def test_what_a_run_finds_in_its_folder_is_never_executed(town_files, tmp_path, quick_tiles):
    request, exploded = (
        Request((town_files[0],), tmp_path / "out", town_files[1]),
        tmp_path / "exploded",
    )

    def stop(step, finished, total):
        if step == "merge":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reconstruct_area(request, stop)
    state = tmp_path / "out" / ".hiproof"
    for file in [state / "plan.jsonl", *(state / "tiles").iterdir()]:
        whole = file.read_bytes()
        np.save(
            bomb := tmp_path / "bomb.npy", np.array([Bomb(exploded)], object), allow_pickle=True
        )
        for planted_bytes in (pickle.dumps(Bomb(exploded)), bomb.read_bytes(), b""):
            file.write_bytes(planted_bytes)
            with pytest.raises(OutputError, match="--restart"):
                reconstruct_area(request)
        file.write_bytes(whole)
    assert not exploded.exists()
    assert reconstruct_area(request).buildings == 4


def test_no_module_that_runs_cities_knows_pickle():
    home = Path(hiproof.__file__).parent
    for room in ("city", "write", "read"):
        assert [
            file.name for file in (home / room).rglob("*.py") if "import pickle" in file.read_text()
        ] == []


def test_a_plan_comes_back_as_it_was(tmp_path):
    square, hole = shapely.box(0.1, 0.2, 30, 40), shapely.box(3, 3, 5, 5)
    attributes = {
        "a": "é\ud800",
        "b": 1 / 3,
        "c": 2**70,
        "d": None,
        "e": [1, {"f": True}],
        "": -0.0,
    }
    jobs = (
        Job(
            0, "one", square.difference(hole), Footprint("one", square.difference(hole), attributes)
        ),
        Job(1, "empty", shapely.Polygon(), Footprint("empty", shapely.Polygon(), {})),
        Job(2, "of the cloud", square, None),
    )
    settings = Settings.from_dict(
        {"fit": {"types": ["gable"], "side_softness_m": [0.1]}, "read": {"split_gap_m": 0.3}}
    )
    plan = WorkPlan(
        jobs,
        {"0_0_0": (0, 2), "-1_0_0": (1,)},
        "EPSG:7415",
        settings,
        {1: ("x", "y")},
        np.array([1e5, 0.1, 0]),
    )
    plan.save(tmp_path / "plan.jsonl")
    loaded = WorkPlan.load(tmp_path / "plan.jsonl")
    assert np.array_equal(loaded.translate, plan.translate)
    assert list(loaded.tiles) == list(plan.tiles)
    assert dataclasses.replace(loaded, translate=plan.translate) == plan


def test_texts_of_buildings_come_back_as_they_were(tmp_path):
    odd = {"n": 2**70, "x": 0.1 + 0.2, "no": None, "yes": True, "t": "ä\n\x7f'"}
    buildings = [
        make_building(gable_house(), "a", attributes=odd),
        make_lost_building(),
        make_building(courtyard(), "b"),
    ]
    parts = [fragments(b, (b.id, b.id), FileHead(offset=np.zeros(3)))[1] for b in buildings]
    with open(tmp_path / "tile.npz", "wb") as file:
        save_fragments(file, parts)
    assert list(load_fragments(tmp_path / "tile.npz")) == parts
    with open(tmp_path / "none.npz", "wb") as file:
        save_fragments(file, [])
    assert list(load_fragments(tmp_path / "none.npz")) == []
