"""Run every `hiproof` command of the documentation, page by page, on three houses of the demo."""

import re
import shlex
import shutil
from pathlib import Path

import laspy
import pytest
import shapely
from typer.testing import CliRunner

from hiproof import read_footprints
from hiproof.cli.app import app
from hiproof.simulate import demo_files

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
HOUSES = 3  # of the demo; more would only take longer
BESIDE_M = 6.0  # Points so far around a house belong to the tile.
NOT_RUN = {
    "hiproof view": "serves until Ctrl-C",
    "hiproof edit": "serves until Ctrl-C",
    "hiproof demo": "models all 26 houses; tests/test_run.py does",
    "hiproof warm": "compiles for minutes",
    "hiproof repro": "needs a building that failed; tests/test_city_bundles.py has one",
    "--footprints overture": "needs a network; tests/test_overture.py serves a release",
    "hiproof footprints": "needs a network; tests/test_overture.py serves a release",
    "--scheduler": "needs a Dask cluster; tests/test_city_dask.py starts one",
}
OVERRIDES = '{"id": "house-00", "ridge_height": 12.0}\n'


def list_commands(page):
    """Return the indented `hiproof` commands of a page, without comments and line breaks."""
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    lines = re.findall(r"^    (hiproof .+)$", text, re.MULTILINE)
    return [" ".join(line.split(" # ")[0].split()) for line in lines]


def is_run(command):
    return not any(part in command for part in NOT_RUN)


COMMANDS = {page: [c for c in list_commands(page) if is_run(c)] for page in PAGES}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """A folder with the files that the pages name: a tile, footprints, terrain, overrides."""
    folder, files = tmp_path_factory.mktemp("inputs"), demo_files()
    footprints = read_footprints(files["footprints"])[:HOUSES]
    area = shapely.union_all([f.polygon for f in footprints]).buffer(BESIDE_M)
    las = laspy.read(files["cloud"])
    las.points = las.points[shapely.intersects_xy(area, las.x, las.y)]
    las.write(folder / "tile.laz")
    (folder / "tiles").mkdir()
    shutil.copy(folder / "tile.laz", folder / "tiles/tile.laz")
    shutil.copy(files["footprints"], folder / "footprints.gpkg")
    shutil.copy(files["terrain"], folder / "dtm.tif")
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


def test_what_is_not_run_still_stands_on_a_page():
    text = "\n".join(command for page in PAGES for command in list_commands(page))
    assert [part for part in NOT_RUN if part not in text] == []
