"""Files appear whole or not at all, and every refusal of the file system is one full sentence."""

import errno
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import hiproof.write as write
from handmade import gable_house, make_building, make_lost_building
from hiproof import read_parameters
from hiproof.city.request import Request
from hiproof.city.run import reconstruct_area
from hiproof.cli.app import app
from hiproof.errors import InputError, OutputError
from hiproof.model import ROOF
from hiproof.write.files import atomic, atomic_file, hidden_name, scratch
from tiny_town import make_town, write_footprints, write_town
from written_run import write_all

WRITERS = {
    "buildings.gml": write.write_citygml,
    "buildings.city.jsonl": write.write_cityjson,
    "buildings.city.json": write.write_cityjson,
    "parameters.jsonl": write.write_parameters,
    "buildings.gpkg": write.write_attributes,
}
each_format = pytest.mark.parametrize("name", WRITERS)


def street(count=3):
    return [make_building(gable_house(), f"house {n}") for n in range(count)] + [
        make_lost_building()
    ]


def no_roof(solid):
    return replace(solid, faces=tuple(face for face in solid.faces if face.kind != ROOF))


def no_number(solid):
    return solid.move(np.array([0.0, 0.0, np.nan]))


def no_vertex(solid):
    return replace(solid, vertices=solid.vertices[:5])


def names_in(folder):
    return sorted(os.listdir(folder))


@each_format
def test_only_the_finished_file_is_left(tmp_path, name):
    WRITERS[name](tmp_path / "deep" / "down" / name, street())
    assert names_in(tmp_path / "deep" / "down") == [name]


@each_format
@pytest.mark.parametrize("problem", [ValueError, KeyboardInterrupt])
def test_an_interrupted_run_keeps_the_old_file(tmp_path, name, problem):
    def interrupt():
        yield from street()
        raise problem

    (tmp_path / name).write_text("old")
    with pytest.raises(problem):
        WRITERS[name](tmp_path / name, interrupt())
    assert names_in(tmp_path) == [name]
    assert (tmp_path / name).read_text() == "old"


@each_format
def test_the_same_buildings_give_the_same_bytes(tmp_path, name):
    for folder in ("one", "two"):
        WRITERS[name](tmp_path / folder / name, street())
    assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


@each_format
def test_no_buildings_still_make_a_file(tmp_path, name):
    WRITERS[name](tmp_path / name, [])
    assert names_in(tmp_path) == [name]


@each_format
def test_a_file_where_a_folder_should_be(tmp_path, name):
    (tmp_path / "out").write_text("a file")
    with pytest.raises(OutputError, match="is a file, not a folder"):
        WRITERS[name](tmp_path / "out" / name, street())


@each_format
def test_a_folder_where_the_file_should_be(tmp_path, name):
    (tmp_path / name).mkdir()
    with pytest.raises(OutputError, match="a folder of this name is in the way"):
        WRITERS[name](tmp_path / name, street())


@each_format
def test_a_full_disk_leaves_nothing(tmp_path, name, file_size_limit):
    (tmp_path / name).write_text("old")
    file_size_limit(40_000)
    with pytest.raises(OutputError, match=f"expected to write .*{name}"):
        WRITERS[name](tmp_path / name, street(400))
    file_size_limit(None)
    assert names_in(tmp_path) == [name]
    assert (tmp_path / name).read_text() == "old"


@pytest.fixture
def file_size_limit():
    """A function that limits how long any file of this process may become: the nearest to a full
    disk without one.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)

    def limit(size):
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft if size is None else size, hard))

    yield limit
    limit(None)
    signal.signal(signal.SIGXFSZ, handler)


def test_no_space_left_says_so(tmp_path):
    with (
        pytest.raises(OutputError, match="the disk is full; free some space"),
        atomic(tmp_path / "a") as neighbour,
    ):
        neighbour.write_text("half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert names_in(tmp_path) == []


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no /dev/full")
def test_a_full_device_says_so(tmp_path):
    with pytest.raises(OutputError, match="the disk is full"), atomic(tmp_path / "a") as neighbour:
        neighbour.symlink_to("/dev/full")
        neighbour.write_text("x" * 100_000)
    assert names_in(tmp_path) == []


def test_a_run_writes_its_files_together_or_not_at_all(tmp_path):
    write_all(tmp_path / "good", iter(street()), "EPSG:7415")
    expected = ["buildings.city.jsonl", "buildings.gml", "buildings.gpkg", "parameters.jsonl"]
    assert names_in(tmp_path / "good") == expected
    with pytest.raises(AttributeError):
        write_all(tmp_path / "bad", iter([*street(), "no building"]))
    assert names_in(tmp_path / "bad") == []


@pytest.mark.parametrize("break_it", [no_roof, no_number, no_vertex])
def test_a_broken_solid_does_not_stop_the_others(tmp_path, break_it):
    buildings = [*street(), make_building(break_it(gable_house()), "broken"), *street()]
    assert write_all(tmp_path, buildings) == ["broken"]
    records = read_parameters(tmp_path / "parameters.jsonl")
    assert [r["status"] for r in records if r["id"] == "broken"] == ["internal_error"]
    assert len(records) == 9


@each_format
def test_strange_ids_and_attributes_go_through(tmp_path, name):
    strange = {
        "": 1,
        "\0": "\0",
        "\ud800": "a\ud800",
        "x" * 300: 2,
        5: [1],
        '"; drop table': object,
        "geom": 1,
        "a:b": 1,
    }
    buildings = [
        make_building(gable_house(), id, attributes=strange)
        for id in ("\0", "", "\ud800", "<&>", "x" * 300, "é")
    ]
    WRITERS[name](tmp_path / name, buildings)
    assert names_in(tmp_path) == [name]


def test_errors_of_the_caller_pass_unchanged(tmp_path):
    with pytest.raises(FileNotFoundError), atomic_file(tmp_path / "a"):
        open(tmp_path / "missing" / "input.laz", encoding="utf-8").close()
    assert names_in(tmp_path) == []


def test_a_link_is_followed(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link.txt").symlink_to(tmp_path / "real" / "target.txt")
    with atomic_file(tmp_path / "link.txt") as file:
        file.write(b"new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real" / "target.txt").read_bytes() == b"new"


def test_a_scratch_file_is_gone_afterwards(tmp_path):
    with scratch(tmp_path / "a") as file:
        file.write(b"abc")
        file.seek(0)
        assert file.read() == b"abc"
    assert names_in(tmp_path) == []


@pytest.mark.parametrize("name", [name for name in WRITERS if name != "parameters.jsonl"])
def test_a_crs_that_is_none(tmp_path, name):
    with pytest.raises(InputError, match="expected a coordinate reference system"):
        WRITERS[name](tmp_path / name, street(), "EPSG:nonsense")
    assert names_in(tmp_path) == []


@pytest.fixture(scope="module")
def folder(run_of_each_kind, tmp_path_factory):
    """A folder with a run's files, and the clouds and footprints of another."""
    folder = tmp_path_factory.mktemp("overwriting")
    shutil.copytree(run_of_each_kind.parent, folder, dirs_exist_ok=True)
    write_town(folder, make_town(houses=1))
    return folder


@pytest.fixture
def town(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "town")
    return tmp_path / "town"


def read_all(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


RUN_COMMANDS = {
    "convert RUN RUN/parameters.jsonl": "a file of a run",
    "convert RUN/parameters.jsonl RUN/parameters.jsonl": "got .* for both",
    "convert RUN RUN/buildings.gml": "a file of a run",
    "convert RUN RUN/buildings.city.jsonl": "a file of a run",
    "convert RUN/buildings.gml RUN/buildings.gpkg": "a file of a run",
    "convert RUN/buildings.gml RUN/buildings.gml": "got .* for both",
    "convert RUN LINK --format glb": "a file of a run",
    "convert RUN GIVEN/parameters.jsonl": "a file of a run",
    "convert GIVEN/parameters.jsonl HARD": "got .* for both",
    "build GIVEN/parameters.jsonl --out GIVEN": "got .* for both",
    "build RUN/parameters.jsonl --out RUN": "got .* for both",
    "report RUN --out RUN/run.json": "a file of a run",
    "report RUN CLOUD --out CLOUD": "got .* for both",
    "classify CLOUD --out CLOUD": "got .* for both",
    "segment CLOUD --out CLOUD": "got .* for both",
    "evaluate RUN RUN/evaluation.csv": "got .* for both",
    "settings --config TOML --write TOML": "got .* for both",
    "settings --write CLOUD": "a new file or one of settings",
    "settings --write RUN/parameters.jsonl": "a new file or one of settings",
    "settings --write FIFO": "a device or a pipe",
    "segment CLOUD --out RUN/changes.laz": "a file of a run",
    "build RUN/parameters.jsonl --out RUN/.hiproof": "where a run keeps its state",
    "enrich RUN --out RUN/.hiproof/a": "where a run keeps its state",
    "report RUN --out RUN/.hiproof/a.html": "where a run keeps its state",
    "reconstruct CLOUD --out RUN/.hiproof": "where a run keeps its state",
    "update RUN CLOUD --date 2024-05-01 --out RUN/new": "outside that of the run",
    "reconstruct CLOUD --footprints IN/buildings.gpkg --out IN": "got .* for both",
    "reconstruct CLOUD --overrides IN/parameters.jsonl --out IN": "got .* for both",
    "reconstruct CLOUD --out IN --log-file CLOUD": "got .* for both",
    "reconstruct CLOUD --out IN --log-file RUN/parameters.jsonl": "a file of a run",
    "convert RUN FIFO --format glb": "a device or a pipe",
    "convert RUN FIFO --format 3dtiles": "choose another name",
    "convert RUN FIFO --format obj": "a device or a pipe",
    "convert RUN MINE --format 3dtiles": "a tileset alone",
    "report RUN CLOUD --out FIFO": "a device or a pipe",
}


@pytest.mark.parametrize("command", RUN_COMMANDS)
def test_outputs_never_stand_for_inputs_or_files_of_a_run(command, town):
    (town / "in").mkdir()
    shutil.copy(town / "run" / "buildings.gpkg", town / "in")
    shutil.copy(town / "run" / "parameters.jsonl", town / "in")
    (town / "settings.toml").write_text("")
    (town / "run" / "evaluation.csv").write_text("0 0 0\n")
    (town / "run" / "changes.csv").write_text("id\n")
    (town / "link.glb").symlink_to(town / "run" / "parameters.jsonl")
    os.link(town / "given" / "parameters.jsonl", town / "given.stl")
    os.mkfifo(town / "pipe")
    (town / "mine").mkdir()
    (town / "mine" / "tileset.json").write_text("{}")
    (town / "mine" / "notes.txt").write_text("of years")
    (cloud,) = town.glob("*.la[sz]")
    places = {
        "RUN": town / "run",
        "GIVEN": town / "given",
        "IN": town / "in",
        "CLOUD": cloud,
        "LINK": town / "link.glb",
        "HARD": town / "given.stl",
        "TOML": town / "settings.toml",
        "FIFO": town / "pipe",
        "MINE": town / "mine",
    }
    words = [
        str(places[first] / rest) if (first := word.partition("/")[0]) in places else word
        for word in command.split()
        for rest in [word.partition("/")[2]]
    ]
    before = read_all(town)
    result = CliRunner().invoke(app, words)
    assert isinstance(result.exception, OutputError), result.output
    assert re.search(RUN_COMMANDS[command], str(result.exception)), str(result.exception)
    assert read_all(town) == before and (town / "pipe").is_fifo()


INPUT_COMMANDS = (
    "convert RUN IN/buildings.gpkg",
    "convert RUN/parameters.jsonl IN/buildings.gpkg",
    "convert RUN CLOUD --format glb",
    "report RUN --out IN/buildings.gpkg",
    "build RUN/parameters.jsonl --out IN",
    "enrich RUN --out IN",
    "update RUN LATER --date 2024-05-01 --out IN",
)


@pytest.fixture(scope="module")
def run_with_inputs(tmp_path_factory):
    """A run and its cloud and footprints, which have the name of an output."""
    folder = tmp_path_factory.mktemp("inputs")
    (folder / "in").mkdir()
    cloud, _ = write_town(folder, make_town(houses=1))
    outlines = write_footprints(folder / "in" / "buildings.gpkg", make_town(houses=1).footprints)
    reconstruct_area(Request((str(cloud),), folder / "run", str(outlines)))
    return {
        "RUN": folder / "run",
        "IN": folder / "in",
        "CLOUD": Path(cloud),
        "LATER": Path(shutil.copy(cloud, folder / "later.laz")),
    }


@pytest.mark.parametrize("command", INPUT_COMMANDS)
def test_outputs_never_stand_for_what_a_run_was_made_of(command, run_with_inputs):
    words = [
        str(run_with_inputs[first] / rest) if first in run_with_inputs else word
        for word in command.split()
        for first, _, rest in [word.partition("/")]
    ]
    before = read_all(run_with_inputs["RUN"].parent)
    result = CliRunner().invoke(app, words)
    assert isinstance(result.exception, OutputError), result.output
    assert re.search("got .* for both", str(result.exception))
    assert read_all(run_with_inputs["RUN"].parent) == before


def test_a_second_conversion_replaces_the_first(town):
    for _ in range(2):
        assert CliRunner().invoke(app, ["convert", str(town / "run")]).exit_code == 0
        named = ["convert", str(town / "run"), str(town / "a.gml")]
        assert CliRunner().invoke(app, named).exit_code == 0


KILLED = """
import os, sys
from hiproof.write.files import {writer}
with {writer}(sys.argv[1]) as beside:
    beside.write_bytes(b"half") if hasattr(beside, "write_bytes") else beside.write(b"half")
    os.kill(os.getpid(), 9)
"""


@pytest.mark.parametrize("writer", ["atomic", "atomic_file", "scratch"])
def test_what_a_killed_process_left_goes_with_the_next_write(writer, tmp_path):
    subprocess.run([sys.executable, "-c", KILLED.format(writer=writer), tmp_path / "a.glb"])
    assert len(os.listdir(tmp_path)) == 1
    with atomic(tmp_path / "a.glb") as beside:
        beside.write_bytes(b"whole")
    assert os.listdir(tmp_path) == ["a.glb"]


def test_what_others_still_write_stays(tmp_path):
    with scratch(tmp_path / "a.glb"), atomic(tmp_path / "a.glb") as mine:
        mine.write_bytes(b"1")
        names = set(os.listdir(tmp_path))
        others = [".a.glb-00000000-1-01234567.glb", ".b.glb-x-1-01234567.glb", ".a.glb", "a.glb-1"]
        for name in others:
            (tmp_path / name).write_bytes(b"2")
        hidden_name(tmp_path / "a.glb")
        assert set(os.listdir(tmp_path)) == names | set(others)


def test_a_killed_folder_of_tiles_goes_with_the_next(town):
    tiles = town / "a.3dtiles"
    gone = max(int(name) for name in os.listdir("/proc") if name.isdigit()) + 100_000
    left = hidden_name(tiles)
    left = left.with_name(left.name.replace(f"-{os.getpid()}-", f"-{gone}-"))
    left.mkdir()
    (left / "tile.glb").write_bytes(np.zeros(3).tobytes())
    result = CliRunner().invoke(app, ["convert", str(town / "run"), str(tiles)])
    assert result.exit_code == 0 and not left.exists()
