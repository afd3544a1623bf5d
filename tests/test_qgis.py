"""The QGIS plugin: the commands it makes are ones that hiproof takes, it hands on what they say,
and QGIS itself runs it.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hiproof.cli.app import app, import_command
from hiproof.formats import FORMATS, choose_format
from hiproof.simulate import demo_files

PLUGINS = Path(__file__).parents[1] / "qgis"
# imported now, before the plugin
COMMANDS = {name: import_command(name) for name in app.commands}
# Debian's script around the program adds an option that the program of QGIS 3.22 does not know
QGIS = shutil.which("qgis_process.bin") or shutil.which("qgis_process")


@pytest.fixture
def plugin(monkeypatch):
    """The modules of the plugin that need no QGIS."""

    def list_own():
        return {name for name in sys.modules if name.split(".")[0] == "hiproof"}

    monkeypatch.syspath_prepend(str(PLUGINS))
    modules = {name: sys.modules.pop(name) for name in list_own()}
    # the plugin's folder has the package's name, as QGIS shows it
    from hiproof import commands, process

    yield commands, process
    for name in list_own():
        del sys.modules[name]
    sys.modules.update(modules)


def is_taken(command):
    """Whether hiproof's own parser takes a command line, without running it."""
    _, name, *arguments = command
    return COMMANDS[name].make_context(name, list(arguments), resilient_parsing=False).params


def test_the_commands_are_ones_that_hiproof_takes(plugin, tmp_path):
    commands, _ = plugin
    outlines = ("f.gpkg", "pand", "year < 1950", (-1.5, 2, 3, 4))
    options = ("t.tif", "EPSG:7415", 4, "--types 'gable,hip'")
    all_of_it = commands.reconstruct("hiproof", ["a.laz", "b.laz"], "out", *outlines, *options)
    taken = is_taken(all_of_it)
    expected = {
        "clouds": ["a.laz", "b.laz"],
        "jobs": 4,
        "types": "gable,hip",
        "bbox": "-1.5,2,3,4",
        "where": "year < 1950",
        "layer": "pand",
    }
    assert {name: taken[name] for name in expected} == expected
    assert is_taken(commands.reconstruct("hiproof", ["a.laz"], "out"))["footprints"] is None
    evaluated = is_taken(commands.evaluate("hiproof", "out", ["a.laz"], "f.gpkg"))
    assert evaluated["footprints"] == "f.gpkg"
    for name, file in commands.FORMATS.items():
        assert is_taken(commands.convert("hiproof", "out", name, file))["format"] == name
        assert choose_format(file) == name and FORMATS[name].file == file
    assert is_taken(commands.status("hiproof", str(tmp_path)))["folder"] == tmp_path


def test_what_a_command_says_is_handed_on_and_its_end_told(plugin):
    _, process = plugin
    lines = []
    code = "import sys; print('first'); print('second', file=sys.stderr); sys.exit(int("
    command = [sys.executable, "-c", f"{code}sys.argv[1]))"]
    assert process.run([*command, "1"], lines.append, lambda: False) == 1
    assert sorted(lines) == ["first", "second"]
    with pytest.raises(process.Failed, match="second"):
        process.run([*command, "2"], lines.append, lambda: False)
    with pytest.raises(process.Failed, match=r"expected the program hiproof.*pip install"):
        process.run(["no-such-program"], lines.append, lambda: False)


def test_a_cancelled_command_ends(plugin):
    _, process = plugin
    lines = []
    slow = [sys.executable, "-c", "import time; print('begun', flush=True); time.sleep(600)"]
    with pytest.raises(process.Failed, match=r"stopped; .*goes on from there"):
        process.run(slow, lines.append, lambda: bool(lines))


def test_the_share_done_is_that_of_the_run(plugin, reference_run, tmp_path):
    _, process = plugin
    program = Path(sys.executable).with_name("hiproof")
    if not program.exists():
        pytest.skip("the command is not beside this Python")
    assert process.measure_progress(str(program), str(reference_run)) == 100.0
    assert process.measure_progress(str(program), str(tmp_path)) is None


@pytest.mark.skipif(QGIS is None, reason="no qgis_process here: QGIS is not installed")
def test_qgis_runs_it(tmp_path):
    """Headless, as a person would from the toolbox: two houses of the demo, chosen by a box."""
    profile = tmp_path / ".local/share/QGIS/QGIS3/profiles/default/QGIS"
    profile.mkdir(parents=True)
    (profile / "QGIS3.ini").write_text("[PythonPlugins]\nhiproof=true\n", encoding="utf-8")
    out, files = tmp_path / "out", demo_files()
    # QGIS leaves statistics beside what it opens
    names = {"CLOUDS": "cloud", "FOOTPRINTS": "footprints", "TERRAIN": "terrain"}
    parameters = {name: shutil.copy(files[kind], tmp_path) for name, kind in names.items()}
    parameters |= {"EXTENT": "91990,92034,451000,451018", "OUTPUT": out}
    parameters |= {"PROGRAM": Path(sys.executable).with_name("hiproof")}
    given = [f"{name}={value}" for name, value in parameters.items()]
    surroundings = {"HOME": tmp_path, "XDG_RUNTIME_DIR": tmp_path, "QGIS_PLUGINPATH": PLUGINS}
    surroundings = {name: str(path) for name, path in surroundings.items()}
    process = subprocess.run(
        [QGIS, "run", "hiproof:reconstruct", "--", *given],
        capture_output=True,
        text=True,
        env={**os.environ, **surroundings, "QT_QPA_PLATFORM": "offscreen"},
        check=False,
    )
    assert process.returncode == 0, process.stdout + process.stderr
    results = process.stdout.partition("Results")[2]
    assert (out / "buildings.gml").exists() and "buildings" in results
