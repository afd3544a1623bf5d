"""What is published works by itself: the source archive makes the wheel, and the wheel, alone in an
environment, models the demo.
"""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
from fnmatch import fnmatch
from pathlib import Path

import pytest

import hiproof

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src/hiproof"
OURS = [path.relative_to(ROOT / "src").as_posix() for path in PACKAGE.rglob("*") if path.is_file()]
OURS = {name for name in OURS if "__pycache__" not in name}


def build(kind, folder, source):
    """Build an archive or a wheel of `source` into a folder; return its path."""
    options = ("-t", kind, "-d", folder)
    run(sys.executable, "-m", "hatchling", "build", *options, cwd=source)
    (path,) = folder.glob("*.tar.gz" if kind == "sdist" else "*.whl")
    return path


def run(*command, **options):
    process = subprocess.run(
        list(map(str, command)), capture_output=True, text=True, check=False, **options
    )
    assert process.returncode == 0, process.stderr
    return process.stdout


def test_the_types_of_every_public_name_are_checked_strictly():
    """`py.typed` promises types, so a function without them is a fault of a public module."""
    config = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (strict,) = (o for o in config["tool"]["mypy"]["overrides"] if "disallow_untyped_defs" in o)
    homes = {getattr(getattr(hiproof, n), "__module__", "hiproof") for n in hiproof.__all__}
    loose = [home for home in homes if not any(fnmatch(home, name) for name in strict["module"])]
    assert len(homes) > 20 and not loose


@pytest.fixture(scope="module")
def archive_and_wheel(tmp_path_factory):
    """(source archive, wheel made of nothing else)."""
    pytest.importorskip(
        "hatchling", reason="building needs hatchling, which the extra `test` brings"
    )
    folder = tmp_path_factory.mktemp("built")
    archive = build("sdist", folder, ROOT)
    with tarfile.open(archive) as tar:
        tar.extraction_filter = getattr(tarfile, "data_filter", None)  # since Python 3.11.4
        tar.extractall(folder)
    return archive, build("wheel", folder, folder / archive.name.removesuffix(".tar.gz"))


@pytest.fixture(scope="module")
def installed_python(archive_and_wheel, tmp_path_factory):
    """The python of an environment that holds the wheel, and beside it only what the wheel depends
    on.
    """
    home = tmp_path_factory.mktemp("clean")
    venv.create(home, with_pip=False)
    python = home / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    pip = (sys.executable, "-m", "pip", "--python", python, "install", "--quiet")
    run(*pip, "--no-deps", "--no-index", archive_and_wheel[1])
    (site,) = [path for path in home.rglob("site-packages") if (path / "hiproof").is_dir()]
    places = dict.fromkeys([sysconfig.get_path("purelib"), *sys.path])
    dependencies = "\n".join(path for path in places if "site-packages" in path)
    (site / "dependencies.pth").write_text(dependencies, encoding="utf-8")
    # compiled code belongs to its sources, and these are the same
    for file in PACKAGE.rglob("*.nbc"):
        place = site / "hiproof" / file.relative_to(PACKAGE)
        place.parent.mkdir(exist_ok=True)
        shutil.copy2(file, place)
    return python


def test_the_wheel_holds_every_file_of_the_package_and_nothing_else(archive_and_wheel):
    with zipfile.ZipFile(archive_and_wheel[1]) as wheel:
        names = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert names == OURS
    assert "hiproof/py.typed" in names


def test_the_archive_is_small_and_holds_what_builds_and_tests_it(archive_and_wheel):
    with tarfile.open(archive_and_wheel[0]) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"pyproject.toml", "README.md", "LICENSE", "CITATION.cff", "tests/conftest.py"} <= names
    assert not any("__pycache__" in name for name in names)
    assert archive_and_wheel[0].stat().st_size < 20e6


def test_the_installed_wheel_is_imported_and_models_houses_of_the_demo(installed_python, tmp_path):
    environment = {name: v for name, v in os.environ.items() if not name.startswith("PYTHON")}
    code = "import hiproof.simulate; print(hiproof.__file__, hiproof.__version__, sep='\\n'); "
    code += "print(*map(hiproof.simulate.demo_files().get, ('cloud', 'footprints')), sep='\\n')"
    printed = run(installed_python, "-c", code, cwd=tmp_path, env=environment)
    place, version, cloud, footprints = printed.splitlines()
    assert Path(place).is_relative_to(installed_python.parents[1])
    command = installed_python.with_name("hiproof.exe" if os.name == "nt" else "hiproof")
    assert run(command, "--version", env=environment).split() == ["hiproof", version]
    few = ("--footprints", footprints, "--bbox", "91990,451000,92034,451040")
    output = run(command, "reconstruct", cloud, *few, "--out", tmp_path / "out", env=environment)
    assert "buildings" in output and (tmp_path / "out/buildings.gml").stat().st_size > 10_000


def test_a_citation_names_the_version_that_is_there():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"version: {hiproof.__version__}\n" in text


def test_the_conda_recipe_asks_for_what_the_project_depends_on():
    yaml = pytest.importorskip("yaml", reason="no PyYAML here, which MkDocs brings")
    recipe = yaml.safe_load((ROOT / "conda/recipe.yaml").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    run = {line.split()[0]: line for line in recipe["requirements"]["run"]}
    bounds = dict(
        re.fullmatch(r"([\w-]+)(?:\[.*\])?(>=.+)", d).groups() for d in project["dependencies"]
    )
    assert run.pop("python") == f"python {project['requires-python']}"
    assert run.pop("lazrs-python")  # which laspy's extra brings from PyPI
    assert run == {name: f"{name} {bound}" for name, bound in bounds.items()}
    assert recipe["context"]["version"] == hiproof.__version__
    assert recipe["about"]["license"] == project["license"]["text"]
    scripts = [f"{name} = {target}" for name, target in project["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == scripts
