"""Compare ARCHITECTURE.md with the code: its packages exist, and imports run as it draws them."""

import ast
import re
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = ROOT / "src/hiproof"
PAGE = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
NOT_DRAWN = {"__init__", "__main__"}  # what hiproof exports, and what `python -m` calls


def read_table():
    """Return the page's description of each package or file, by name."""
    rows = re.findall(r"^\| ((?:`[\w./]+`\s*)+) \| (.+) \|$", PAGE, re.MULTILINE)
    names = [(re.findall(r"`([\w./]+)`", cell), description) for cell, description in rows]
    return {name.rstrip("/"): description for row, description in names for name in row}


def read_drawing():
    """Return the names on each line of the page's drawing, the lowest line first."""
    block = re.search(r"Imports run one way.+?\n\n((?:    [\w ]+\n)+)", PAGE, re.DOTALL)
    return [line.split() for line in reversed(block[1].splitlines())]


def list_packages():
    """Return the names of packages and files at the top of hiproof."""
    packages = {path.name for path in SOURCES.iterdir() if (path / "__init__.py").is_file()}
    return packages | {path.stem for path in SOURCES.glob("*.py")} - NOT_DRAWN


def name_module(file):
    """Return a file's module as a tuple, such as ("fit", "single")."""
    parts = file.relative_to(SOURCES).with_suffix("").parts
    return parts[:-1] if parts[-1] == "__init__" else parts


MODULES = {name_module(file): file for file in sorted(SOURCES.rglob("*.py"))}


@cache
def list_import_statements(module):
    """Return all import statements of a module, those inside functions too."""
    tree = ast.parse(MODULES[module].read_text(encoding="utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]


@cache
def list_imported_modules(module):
    """Return the modules of hiproof that a module imports, inside functions too."""
    folder = MODULES[module].parent.relative_to(SOURCES).parts
    modules = set()
    for node in list_import_statements(module):
        if isinstance(node, ast.ImportFrom) and node.level:
            names = node.module.split(".") if node.module else []
            base = (*folder[: len(folder) - node.level + 1], *names)
            for imported in node.names:
                submodule = (*base, imported.name)
                modules.add(submodule if submodule in MODULES else base)
    return modules - {module}


def list_other_packages(module):
    """Return the packages other than hiproof that a module imports."""
    nodes = list_import_statements(module)
    names = [node.module for node in nodes if isinstance(node, ast.ImportFrom) and not node.level]
    names += [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    return {name.split(".")[0] for name in names}


def test_the_table_describes_every_package_and_file():
    assert {name.removesuffix(".py") for name in read_table()} == list_packages()
    assert [name for name in read_table() if not (SOURCES / name).exists()] == []


def test_the_drawing_shows_every_package_once():
    assert sorted(name for line in read_drawing() for name in line) == sorted(list_packages())


@pytest.mark.parametrize("package", sorted(list_packages()))
def test_a_package_imports_only_from_lines_below(package):
    level = {name: number for number, line in enumerate(read_drawing()) for name in line}
    wrong = {
        f"{'.'.join(module)} imports {'.'.join(target)}"
        for module in MODULES
        if module[:1] == (package,)
        for target in list_imported_modules(module)
        if target and target[0] != package and level[target[0]] >= level[package]
    }
    assert wrong == set()


def test_no_imports_run_in_a_circle():
    graph = {module: list_imported_modules(module) - {()} for module in MODULES if module}
    assert len(list(TopologicalSorter(graph).static_order())) >= len(graph)


@pytest.mark.parametrize("library", re.findall(r"the only package that imports (\w+)", PAGE))
def test_one_package_alone_imports(library):
    phrase = f"the only package that imports {library}"
    (package,) = (name for name, description in read_table().items() if phrase in description)
    assert {module[0] for module in MODULES if library in list_other_packages(module)} == {package}
