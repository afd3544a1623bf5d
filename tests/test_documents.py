"""Every path, command, option, setting and attribute that the documents name exists."""

import re
from functools import cache
from pathlib import Path

import pytest

from hiproof.cli.app import app, import_command
from hiproof.settings import Settings
from hiproof.write.attribute_list import TABLES

ROOT = Path(__file__).parents[1]
DOCUMENTS = [
    ROOT / f"{name}.md" for name in ("README", "ARCHITECTURE", "CONTRIBUTING", "CHANGELOG")
]
DOCUMENTS += sorted((ROOT / "docs").rglob("*.md"))
# by docs/generated.py and docs/demo_in_3d.py, when the site is built
MADE = ("commands.md", "settings.md", "constants.md", "demo/index.html")
COMMANDS = {name: import_command(name) for name in app.commands}
OPTIONS = {
    name
    for command in COMMANDS.values()
    for parameter in command.params
    for name in (*parameter.opts, *parameter.secondary_opts)
}
OPTIONS |= {"--help", "--version"}
PLACES = [ROOT, ROOT / "src/hiproof", ROOT / "src/hiproof/primitives", ROOT / "tests"]
OTHER_PROGRAMS = ("pip ", "dask ", "find ", "git ", "projsync ", "docker ")

ATTRIBUTES = {table.prefix + name for table in TABLES.values() for name in table.names}
# tables of a database, by the prefix that is the default
ATTRIBUTES |= {"hiproof_buildings", "hiproof_roofs", "hiproof_runs"}

every_document = pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)


def list_spans(path):
    """What stands between backticks in the prose."""
    return re.findall(r"(?<!`)`([^`\n]+)`(?!`)", path.read_text())


def list_commands(path):
    """Spans, and lines of indented or fenced code, without their comments."""
    text = path.read_text()
    fenced = [
        line
        for block in re.findall(r"```\w*\n(.*?)```", text, re.DOTALL)
        for line in block.splitlines()
    ]
    indented = re.findall(r"^    (\S.*)$", text, re.MULTILINE)
    return list_spans(path) + [line.split(" # ")[0].strip() for line in fenced + indented]


@cache
def read_sources():
    """All text of the package, its benchmarks and tests, where names of files and values stand."""
    folders = ("src", "benchmarks", "experiments", "tests", "examples")
    files = [file for folder in folders for file in sorted((ROOT / folder).rglob("*.py"))]
    files += sorted((ROOT / "src" / "hiproof" / "data").glob("*.toml"))
    return "\n".join(file.read_text() for file in files if file != Path(__file__))


def find_module_file(name):
    """The file of a module that `python -m` may be given, None where there is none."""
    path = name.replace(".", "/")
    files = (ROOT / f"{path}.py", ROOT / path / "__main__.py", ROOT / "src" / path / "__main__.py")
    return next((file for file in files if file.is_file()), None)


def is_path(span):
    endings = r"\.(py|md|toml|json|jsonl|gml|gpkg|parquet|csv|html)"
    return bool(re.fullmatch(rf"[\w.-]*(/[\w.-]+)*(/|{endings})", span))


@every_document
def test_links_lead_somewhere(path):
    targets = re.findall(r"\]\(([^)#]+)\)", path.read_text())
    local_targets = [target for target in targets if "://" not in target and target not in MADE]
    assert [target for target in local_targets if not (path.parent / target).exists()] == []


@every_document
def test_paths_exist(path):
    """Of the repository, or of a run's output, whose names stand in the source."""

    def is_named(span):
        name = re.escape(Path(span).name)
        return not span.endswith(".py") and re.search(rf"[\"'/]{name}[\"'/]", read_sources())

    paths = [span for span in list_spans(path) if is_path(span)]
    missing = [span for span in paths if not any((place / span).exists() for place in PLACES)]
    assert [span for span in missing if not is_named(span)] == []


@every_document
def test_commands_exist(path):
    def list_unknown(pattern, known):
        found = [name for text in list_commands(path) for name in re.findall(pattern, text)]
        return [name for name in found if not known(name)]

    targets = re.findall(r"^(\w[\w-]*):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert list_unknown(r"^hiproof ([a-z]\w*)", COMMANDS.__contains__) == []
    assert list_unknown(r"^python -m (?!pytest|venv|pip)([\w.]+)", find_module_file) == []
    assert list_unknown(r"^make ([\w-]+)", targets.__contains__) == []


@every_document
def test_options_exist(path):
    for text in list_commands(path):
        if text.startswith((*OTHER_PROGRAMS, "python -m pytest")):
            continue
        module = re.match(r"python -m ([\w.]+)", text)
        options = re.findall(r"--[\w-]+", find_module_file(module[1]).read_text()) if module else ()
        used = set(re.findall(r"(?<![\w-])--[a-z][\w-]*", text))
        assert used <= (set(options) if module else OPTIONS)


@every_document
def test_attributes_and_settings_exist(path):
    names = re.findall(r"`((?:rf|hiproof)_[a-z]\w*)`", path.read_text())
    assert [name for name in names if name not in ATTRIBUTES] == []
    settings = Settings().to_dict()
    pairs = re.findall(r"`\[(\w+)\] (\w+)", path.read_text())
    assert [pair for pair in pairs if pair[1] not in settings.get(pair[0], {})] == []
