"""Run every `hiproof` command of the documentation, page by page, on three houses of the demo."""

import json
import re
import shlex
import shutil
import tomllib
from pathlib import Path

import laspy
import pytest
import shapely
from click.testing import CliRunner

from hiproof import build, read_footprints
from hiproof.cli.app import app
from hiproof.parametric.override import read_override
from hiproof.settings import Settings
from hiproof.simulate import demo_files
from layers import write_layer
from weather import write_epw

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
HOUSES = 1  # of the demo; more would only take longer
BESIDE_M = 6.0  # Points so far around a house belong to the tile.
NOT_RUN = {
    "hiproof view": "serves until Ctrl-C",
    "hiproof edit": "serves until Ctrl-C",
    "hiproof demo": "models all 26 houses; tests/test_run.py does",
    "hiproof warm": "compiles for minutes",
    "hiproof repro": "needs a building that failed; tests/test_city_failures.py has one",
    "--footprints overture": "needs a network; tests/test_overture.py serves a release",
    "hiproof footprints": "needs a network; tests/test_overture.py serves a release",
    "--scheduler": "needs a Dask cluster; tests/test_city_dask.py starts one",
}
JSON_READERS = {"overrides.md": read_override, "parameters.md": build}
OVERRIDES = '{"id": "house-00", "ridge_height": 12.0}\n'


def list_commands(page):
    """Return the indented `hiproof` commands of a page, without comments and line breaks."""
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    lines = re.findall(r"^    (hiproof .+)$", text, re.MULTILINE)
    return [" ".join(line.split(" # ")[0].split()) for line in lines]


def parse_values(text):
    """Return the JSON values of a text, one after the other."""
    values, decoder = [], json.JSONDecoder()
    while text := text.strip():
        value, end = decoder.raw_decode(text)
        values.append(value)
        text = text[end:]
    return values


def is_run(command):
    return not any(part in command for part in NOT_RUN)


COMMANDS = {page: [c for c in list_commands(page) if is_run(c)] for page in PAGES}


def write_passages(path, outline):
    """Write a passage through a house, 2.5 m high."""
    xmin, ymin, xmax, ymax = outline.bounds
    passage = shapely.box(xmin - 1, (ymin + ymax) / 2 - 1, xmax + 1, (ymin + ymax) / 2 + 1)
    write_layer(path, [passage], {"height": [2.5]})


def write_register(path, footprints):
    """Write footprints with the heights that a register knows."""
    count = len(footprints)
    columns = {"id": [f.id for f in footprints], "hoogte": [6.0] * count, "maaiveld": [0.5] * count}
    write_layer(path, [f.polygon for f in footprints], columns)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """A folder with the files that the pages name: a tile, footprints, terrain, overrides."""
    folder, files = tmp_path_factory.mktemp("inputs"), demo_files()
    footprints = read_footprints(files["footprints"])[:HOUSES]
    area = shapely.union_all([f.polygon for f in footprints]).buffer(BESIDE_M)
    las = laspy.read(files["cloud"])
    las.points = las.points[shapely.intersects_xy(area, las.x, las.y)]
    las.write(folder / "tile.laz")
    write_epw(folder / "delft.epw")
    (folder / "horizon.txt").write_text("5\n20\n5\n0\n")
    for name in ("tiles", "old", "new"):
        (folder / name).mkdir()
        shutil.copy(folder / "tile.laz", folder / name / "tile.laz")
    shutil.copy(files["footprints"], folder / "footprints.gpkg")
    shutil.copy(files["terrain"], folder / "dtm.tif")
    write_register(folder / "register.gpkg", footprints)
    write_passages(folder / "passages.gpkg", footprints[0].polygon)
    for name in ("known.jsonl", "city/edits.jsonl"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(OVERRIDES, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def models(inputs, tmp_path_factory):
    """The folder `models` of a finished run, for pages that begin with one."""
    folder = tmp_path_factory.mktemp("finished") / "models"
    command = ["reconstruct", str(inputs / "tile.laz"), "--out", str(folder)]
    result = CliRunner().invoke(app, [*command, "--footprints", str(inputs / "footprints.gpkg")])
    assert result.exit_code == 0, result.output
    return folder


@pytest.mark.parametrize(
    "page", [p for p in PAGES if COMMANDS[p]], ids=lambda page: str(page.relative_to(ROOT))
)
def test_the_commands_of_a_page_run(page, inputs, models, tmp_path, monkeypatch):
    shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    if not COMMANDS[page][0].startswith("hiproof reconstruct"):
        shutil.copytree(models, tmp_path / "models")
    monkeypatch.chdir(tmp_path)
    for command in COMMANDS[page]:
        arguments = shlex.split(command)[1:]
        if arguments[0] == "reconstruct" and Path("models/run.json").exists():
            arguments.append("--restart")
        result = CliRunner().invoke(app, arguments)
        assert result.exit_code == 0, f"{command}\n{result.output}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_blocks_of_json_and_toml_are_read(page):
    text = page.read_text(encoding="utf-8")
    for language, block in re.findall(r"```(json|toml)\n(.*?)```", text, re.DOTALL):
        if language == "json":
            assert all(map(JSON_READERS[page.name], parse_values(block)))
        else:
            Settings.from_dict(tomllib.loads(block))
