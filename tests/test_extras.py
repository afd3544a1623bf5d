"""What only some need is an extra: nothing else asks for it, and what does says so in one sentence
before any work.
"""

import re
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import shapely
from click.testing import CliRunner

import hiproof
import hiproof.learn
from hiproof import method
from hiproof.city.run import Request, reconstruct_area
from hiproof.city.work.warm import compile_half
from hiproof.edit.points import RunPoints
from hiproof.errors import InputError
from hiproof.segment import inference, segment
from hiproof.segment.files import segment_files
from hiproof.settings import Settings
from hiproof.simulate import demo_files
from hiproof.simulate.__main__ import app as simulate
from programs import run_hiproof, run_python

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OPTIONAL = PROJECT["optional-dependencies"]
PACKAGES = {
    "rasterio": "terrain",
    "onnxruntime": "network",
    "pyarrow": "parquet",
    "psycopg": "postgis",
    "ifcopenshell": "ifc",
    "ezdxf": "dxf",
    "rhino3dm": "rhino",
    "trimesh": "trimesh",
    "pyvista": "pyvista",
    "geopandas": "geopandas",
    "distributed": "city",
    "fsspec": "city",  # of points; GeoParquet by address asks for the smaller extra `parquet`
    "matplotlib": "report",
    "pvlib": "sun",
}

# what no run asks for
CONVERSIONS = {"ifc", "dxf", "rhino", "trimesh", "pyvista", "geopandas", "sun"}

# name: (package that is missing, TOML, further options)
NEEDY = {
    "a terrain model": ("rasterio", "", ["--terrain", "dtm.tif"]),
    "a terrain model by address": ("rasterio", "", ["--terrain", "https://example.org/dtm.tif"]),
    "the network's opinion": ("onnxruntime", "", ["--network", "always"]),
    "one primitive": ("onnxruntime", "", ["--parts", "one"]),
    "the paper's objective": ("onnxruntime", "", ["--objective", "paper"]),
    "one primitive by the settings": ("onnxruntime", '[fit]\nparts = "one"', []),
    "other weights": ("onnxruntime", '[segment]\nweights = "{cloud}"', []),
    "GeoParquet": ("pyarrow", "", ["--parquet"]),
    "footprints in GeoParquet": ("pyarrow", "", ["--footprints", "https://host/a.parquet"]),
    "footprints of Overture": ("pyarrow", "", ["--footprints", "overture"]),
    "a cluster": ("distributed", "", ["--scheduler", "tcp://127.0.0.1:1"]),
    "footprints from a database": ("psycopg", "", ["--footprints", "postgresql://host/db?table=t"]),
}
FOOTPRINT = shapely.box(0, 0, 12, 8)


def gable_points():
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0.2, 12, 0.4), np.arange(0.2, 8, 0.4)))
    return np.column_stack([x, y, 8 - 0.7 * np.abs(y - 4)])


@pytest.fixture
def hide_package(monkeypatch):
    """Hides a package, as if it were not installed."""

    def hide(package):
        for name in [name for name in sys.modules if name.split(".")[0] == package]:
            monkeypatch.delitem(sys.modules, name)
        monkeypatch.setitem(sys.modules, package, None)
        inference.load.cache_clear()  # a network that was loaded before runs on

    yield hide
    inference.load.cache_clear()


def make_pattern(package):
    return (
        rf"^expected the package {package}[\w.]* for [^;]+, got: .+; "
        rf"try: pip install 'hiproof\[{PACKAGES[package]}\]'"
    )


@pytest.mark.parametrize("name", NEEDY)
def test_a_run_that_needs_what_is_missing_is_refused_before_it_reads_or_writes(
    name, hide_package, tmp_path, capsys
):
    package, toml, options = NEEDY[name]
    cloud, config, out = tmp_path / "cloud.laz", tmp_path / "settings.toml", tmp_path / "out"
    cloud.write_bytes(b"nothing that could be read")
    config.write_text(toml.format(cloud=cloud.as_posix()))
    out.mkdir()
    (out / "buildings.gml").write_text("an earlier run's")
    hide_package(package)
    assert (
        run_hiproof("reconstruct", cloud, "--out", out, "--config", config, "--restart", *options)
        == 2
    )
    (line,) = capsys.readouterr().err.splitlines()
    assert re.match(make_pattern(package), line.removeprefix("hiproof: "))
    assert [path.read_text() for path in out.iterdir()] == ["an earlier run's"]


@pytest.mark.parametrize("options", [["--parts", "one"], ["--objective", "paper"]])
def test_one_primitive_by_the_points_alone_is_said_to_do_without(
    options, hide_package, town_files, tmp_path, capsys
):
    hide_package("onnxruntime")
    cloud, footprints = town_files
    given = ["reconstruct", cloud, "--footprints", footprints, "--out", tmp_path, *options]
    assert run_hiproof(*given) == 2
    assert capsys.readouterr().err.endswith("or --network never to go by the points alone\n")
    if options == ["--parts", "one"]:
        assert run_hiproof(*given, "--network", "never") == 0


def test_points_by_address_are_refused_before_anything_is_written(hide_package, tmp_path):
    hide_package("fsspec")
    with pytest.raises(InputError, match=make_pattern("fsspec")):
        reconstruct_area(Request(("https://example.org/a.laz",), tmp_path / "out"))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("source", ["overture", "https://example.org/a.parquet"])
def test_footprints_by_address_name_the_extra_of_their_format(source, hide_package, tmp_path):
    pytest.importorskip("pyarrow", reason="the extra `parquet` is not installed")
    hide_package("fsspec")
    with pytest.raises(InputError, match=r"fsspec for GeoParquet .+'hiproof\[parquet\]'$"):
        reconstruct_area(Request(("a.laz",), tmp_path / "out", source))
    assert not (tmp_path / "out").exists()


def test_labelling_is_refused_before_it_reads_or_writes(hide_package, tmp_path, capsys):
    hide_package("onnxruntime")
    places = (tmp_path / "missing.laz", "--out", tmp_path / "out" / "labelled.laz")
    assert run_hiproof("segment", *places) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert re.match(make_pattern("onnxruntime"), line.removeprefix("hiproof: "))
    assert line.endswith("'hiproof[network]'") and list(tmp_path.iterdir()) == []


def test_a_neighbourhood_is_refused_before_it_is_written(hide_package, tmp_path):
    hide_package("rasterio")
    result = CliRunner().invoke(simulate, ["neighbourhood", str(tmp_path / "town")])
    assert result.exit_code == 2
    assert re.match(make_pattern("rasterio"), result.output.removeprefix("error: "))
    assert not (tmp_path / "town").exists()


def reconstruct_with(**settings):
    settings = Settings.from_dict(settings)
    return lambda: hiproof.reconstruct(gable_points(), FOOTPRINT, settings=settings)


@pytest.mark.parametrize(
    ("package", "call"),
    [
        ("rasterio", lambda: hiproof.read_terrain(demo_files()["terrain"])),
        ("onnxruntime", lambda: segment(gable_points())),
        ("onnxruntime", lambda: segment_files([], Path("labelled.laz"), Settings())),
        ("matplotlib", lambda: hiproof.plot(hiproof.reconstruct(gable_points(), FOOTPRINT))),
        ("onnxruntime", reconstruct_with(fit={"parts": "one"})),
        ("onnxruntime", reconstruct_with(fit={"objective": "paper"})),
        ("onnxruntime", reconstruct_with(segment={"network": "always"})),
    ],
)
def test_python_gets_the_same_sentence(package, call, hide_package):
    hide_package(package)
    with pytest.raises(InputError, match=make_pattern(package)):
        call()


def test_training_names_its_extra(hide_package):
    hide_package("torch")
    sentence = r"expected the package torch for training, got: .+'hiproof\[train\]'$"
    with pytest.raises(InputError, match=sentence):
        hiproof.learn.train  # noqa: B018


def test_training_is_an_attribute_of_the_package():
    assert run_python("import hiproof; print(hiproof.learn.__name__)") == "hiproof.learn\n"


@pytest.mark.parametrize(
    "arguments", [{}, {"fit": {"parts": "one"}, "segment": {"network": "never"}}]
)
def test_a_roof_is_the_same_without_what_it_does_not_ask_for(arguments, hide_package):
    settings = Settings.from_dict(arguments)
    old = hiproof.reconstruct(gable_points(), FOOTPRINT, settings=settings)
    hide_package("onnxruntime"), hide_package("rasterio")
    new = hiproof.reconstruct(gable_points(), FOOTPRINT, settings=settings)
    assert new.type == "gable" and np.array_equal(new.solid.vertices, old.solid.vertices)


def test_the_page_says_at_once_that_a_terrain_model_cannot_be_read(
    hide_package, town_files, tmp_path
):
    files = {name: str(path) for name, path in demo_files().items()}
    inside, out = (91990, 450990, 92015, 451015), tmp_path / "out"
    inputs = (files["footprints"], files["terrain"])
    reconstruct_area(Request((files["cloud"],), out, *inputs, bbox=inside))
    assert RunPoints(out).missing == ""
    hide_package("rasterio")
    assert "all but refitting works (expected the package rasterio" in RunPoints(out).missing


def test_without_the_network_all_is_compiled_beforehand(hide_package, monkeypatch):
    """A core install has none: the process ended there, and each run started it again."""
    hide_package("onnxruntime")
    fits, reconstruct = [], method.reconstruct

    def note_fit(*arguments, settings):
        fits.append((settings.fit.parts, settings.segment.network))
        return reconstruct(*arguments, settings=settings)

    monkeypatch.setattr(method, "reconstruct", note_fit)
    compile_half("all")
    assert [network for parts, network in fits if parts == "one"] == ["never", "never"]
    assert len(fits) == 4  # it came to its end


def test_the_demo_asks_for_no_extra(tmp_path):
    """Whatever is installed: with all of them hidden it runs, and it loads none where they are
    there.
    """
    few = (91990, 451000, 92034, 451040)  # a box of a few of the demo's houses
    code = f"""
import sys
from dataclasses import replace

def run(out):
    sys.argv[1:] = ["demo", "--out", out]
    try:
        main()
    except SystemExit as end:
        return end.code

hidden, there, *names = sys.argv[1:]
sys.modules.update(dict.fromkeys(names))
from hiproof.cli import main
from hiproof.cli.demo import make_request
sys.modules["hiproof.cli.demo"].make_request = lambda out: replace(make_request(out), bbox={few})
codes = [run(hidden)]
for name in names:
    del sys.modules[name]
codes.append(run(there))
print(*codes, [m for m in ("rasterio", "onnxruntime") if m in sys.modules])
"""
    printed = run_python(code, tmp_path / "hidden", tmp_path / "there", *PACKAGES)
    assert printed.splitlines()[-1] == "0 0 []"
    models = [path.read_bytes() for path in tmp_path.glob("*/buildings.gml")]
    assert len(models) == 2 and models[0] == models[1]


def list_names(requirements):
    """The packages that requirements name: `laspy` of "laspy[lazrs]>=2.5.3"; of dask[distributed]
    what it is there for too.
    """
    texts = (text.partition(">=")[0] for text in requirements)
    return {name for text in texts for name in re.findall(r"[a-z]\w+", text)}


def test_each_sentence_names_the_extra_that_brings_the_package():
    sources = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "src").rglob("*.py"))
    pairs = set(re.findall(r'(?<!>> )import_extra\("(\w+)[\w.]*", "(\w+)"', sources))
    assert pairs == {*PACKAGES.items(), ("fsspec", "parquet")}
    assert [pair for pair in pairs if pair[0] not in list_names(OPTIONAL[pair[1]])] == []
    assert list_names(PROJECT["dependencies"]).isdisjoint(PACKAGES)
    assert list_names(OPTIONAL["all"]) == {"hiproof", *PACKAGES.values()} - CONVERSIONS


def test_the_page_of_installing_tells_of_the_extras_that_exist():
    text = (ROOT / "docs/install.md").read_text(encoding="utf-8")
    developer_extras = {"lint", "test", "experiments", "all"}  # their users have a Makefile
    named = re.findall(r"^\| `(\w+)` \|", text, re.MULTILINE)
    assert sorted(named) == sorted(set(OPTIONAL) - developer_extras)
    assert "extra `all`" in text
