"""No command writes over what it reads, over a run's own files, or over a device."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from hiproof.city.request import Request
from hiproof.city.run import reconstruct_area
from hiproof.cli.app import app
from hiproof.errors import OutputError
from hiproof.write.files import atomic, hidden_name, scratch
from tiny_town import make_town, write_footprints, write_town


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
