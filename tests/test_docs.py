"""The documents say what the code does: commands, examples, doctests, public names."""

import doctest
import importlib
import json
import pkgutil
import re
import runpy
import sys
from itertools import chain
from pathlib import Path

import pytest
import shapely

import hiproof
from hiproof.cli.app import app, import_command
from hiproof.enrich.run import enrich_run
from hiproof.settings import EnrichSettings, Settings
from hiproof.simulate import demo_files
from programs import run_python

ROOT = Path(__file__).parents[1]
PAGES = {
    path.relative_to(ROOT).as_posix(): blocks
    for path in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md"))
    if (blocks := re.findall(r"```python\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL))
}
COMMANDS = {name: import_command(name) for name in app.commands}
MODULES = {
    m.name: Path(m.module_finder.find_spec(m.name).origin)
    for m in pkgutil.walk_packages(hiproof.__path__, "hiproof.")
    if not m.name.endswith("__main__")
}
WITH_EXAMPLES = sorted(
    name for name, path in MODULES.items() if ">>> " in path.read_text(encoding="utf-8")
)
EXTRAS = {"torch", "distributed", "dask", "matplotlib", "psycopg", "onnx"}


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_doctests(name):
    outcome = doctest.testmod(importlib.import_module(name), optionflags=doctest.ELLIPSIS)
    assert outcome.failed == 0 and outcome.attempted > 0


def test_every_module_is_imported_with_its_extra():
    for name in MODULES:
        try:
            importlib.import_module(name)
        except ImportError as error:
            assert error.name and error.name.split(".")[0] in EXTRAS, name


@pytest.mark.parametrize("name", hiproof.__all__)
def test_every_public_name_is_there_and_documented(name):
    value = getattr(hiproof, name)
    assert name == "__version__" or value.__doc__


@pytest.mark.parametrize("example", ["one_building.py", "one_tile.py"])
def test_examples_run(example, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [example, str(tmp_path / "out")])
    runpy.run_path(str(ROOT / "examples" / example), run_name="__main__")
    assert capsys.readouterr().out.strip()


def test_the_notebook_runs_and_is_stored_with_its_outputs():
    """Its cells run in order, and each gives outputs of the kinds that are stored with it."""
    pytest.importorskip("matplotlib", reason="the notebook plots (extra `report`)").use("Agg")
    from docs.run_notebook import NOTEBOOK, draw_figures, run_notebook

    draw_figures()  # closes those of other tests
    text = NOTEBOOK.read_text(encoding="utf-8")
    stored, notebook = json.loads(text), json.loads(text)
    names = run_notebook(notebook)
    assert max(names["shares"].values()) > 0.9 and names["building"].status.is_model
    assert len(set(names["volumes"])) == 100
    kinds = [[list_kinds(cell) for cell in book["cells"]] for book in (stored, notebook)]
    assert kinds[0] == kinds[1] and {"image/png", "text/html", "stream"} <= set(chain(*kinds[0]))


def list_kinds(cell):
    """Return the kinds of a cell's outputs: those of its data, or of its text."""
    outputs = cell.get("outputs", ())
    return [kind for item in outputs for kind in item.get("data", [item["output_type"]])]


@pytest.fixture(scope="module")
def at_hand(tmp_path_factory):
    """What the documents' snippets speak of: a folder that holds a run in `models`, points and a
    footprint of one house.
    """
    folder, files = tmp_path_factory.mktemp("snippets"), demo_files()
    options = {"footprints": str(files["footprints"]), "where": "id < 'house-04'"}
    hiproof.reconstruct_area(hiproof.Request((str(files["cloud"]),), folder / "models", **options))
    enrich_run(folder / "models", settings=EnrichSettings(sun=True))
    footprint = hiproof.read_footprints(files["footprints"])[0].polygon
    cloud = hiproof.read_points(files["cloud"])
    roof = (cloud.classification == 6) & shapely.intersects_xy(footprint, *cloud.xyz[:, :2].T)
    return folder, {"points": cloud.xyz[roof], "footprint": footprint}


@pytest.mark.parametrize("page", sorted(PAGES))
def test_snippets_run(page, at_hand, monkeypatch):
    """The Python blocks of a page in order, on a run's folder, points and a footprint."""
    folder, values = at_hand
    if "hiproof.plot" in PAGES[page][-1]:
        pytest.importorskip("matplotlib", reason="the snippet plots (extra `report`)").use("Agg")
    monkeypatch.chdir(folder)
    names = dict(values)
    for number, block in enumerate(PAGES[page]):
        exec(compile(block, f"{page}, block {number}", "exec"), names)
    assert names.keys() > values.keys(), "the page's blocks ran and left what they made"


def test_the_sites_generated_pages_tell_every_command_option_and_setting():
    from docs.generated import describe_commands, describe_settings

    commands, settings = describe_commands(), describe_settings()
    for name, command in COMMANDS.items():
        assert f"## hiproof {name}\n" in commands
        options = [p.opts[0] for p in command.params if p.opts[0].startswith("--")]
        assert [option for option in options if f"`{option}`" not in commands] == []
    for section, values in Settings().to_dict().items():
        assert f"## {section}\n" in settings
        assert [name for name in values if f"| `{name}` |" not in settings] == []


@pytest.mark.parametrize(
    ("modules", "absent"),
    [
        ("hiproof", "'torch', 'dask', 'numba', 'scipy', 'onnxruntime'"),
        (
            "hiproof.city.run, hiproof.city.work.solve, hiproof.fit.roof",
            "'dask', 'scipy.ndimage', 'scipy.optimize', 'scipy.sparse', 'scipy.spatial', "
            "'scipy.special', 'onnxruntime', 'rasterio', 'xml.etree'",
        ),
        ("hiproof.classify.split", "'scipy.ndimage', 'scipy.spatial'"),
    ],
    ids=["the package", "a run", "buildings by their class"],
)
def test_nothing_is_imported_that_few_need(modules, absent):
    code = f"import sys, {modules}; print([m for m in ({absent}) if m in sys.modules])"
    assert run_python(code).strip() == "[]"
