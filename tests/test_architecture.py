"""ARCHITECTURE.md against the code: its rooms and files are those there are, and imports run as it draws them."""

import ast
import re
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src/hiproof"
PAGE = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
DOORS = {("model",)}  # its methods open rooms above it when a person calls them, as the page says
SELF_EVIDENT = {"cli", "primitives"}  # a file a command, a file a shape
NOT_DRAWN = {"__init__", "__main__"}  # what the package offers, and what `python -m` calls


def table():
    """What the page's table says of each room or file at the package's top, by name."""
    rows = re.findall(r"^\| ((?:`[\w./]+`\s*)+) \| (.+) \|$", PAGE, re.MULTILINE)
    return {name.rstrip("/"): says for names, says in rows for name in re.findall(r"`([\w./]+)`", names)}


def drawn():
    """The line of the drawing that each room or file stands on, the lowest 0."""
    block = re.search(r"Imports run one way.+?\n\n((?:    [\w ]+\n)+)", PAGE, re.DOTALL)
    lines = [line.split() for line in reversed(block[1].splitlines())]
    return {room: number for number, line in enumerate(lines) for room in line}


def rooms():
    """Rooms and files at the package's top."""
    found = {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").is_file()}
    return found | {path.stem for path in PACKAGE.glob("*.py")} - NOT_DRAWN


def module(file):
    """The names that lead to a file, such as ("fit", "single"); those of a room's own file are the room's."""
    parts = file.relative_to(PACKAGE).with_suffix("").parts
    return parts[:-1] if parts[-1] == "__init__" else parts


MODULES = {module(file): file for file in sorted(PACKAGE.rglob("*.py"))}


@cache
def statements(name):
    """(import statement, whether at the top of the file) of all in the module `name`, inside functions too."""
    tree = ast.parse(MODULES[name].read_text(encoding="utf-8"))
    at_top = {id(node) for node in tree.body}
    return [(node, id(node) in at_top) for node in ast.walk(tree) if isinstance(node, (ast.Import, ast.ImportFrom))]


@cache
def imports(name):
    """(module of the package, whether at the top of the file) of all that the module `name` imports of it."""
    folder = MODULES[name].parent.relative_to(PACKAGE).parts
    found = set()
    for node, at_top in statements(name):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = (*folder[: len(folder) - node.level + 1], *(node.module.split(".") if node.module else ()))
            for imported in node.names:
                target = (*base, imported.name) if (*base, imported.name) in MODULES else base
                found.add((target, at_top))
    return found - {(name, True), (name, False)}


def foreign(name):
    """Packages beside hiproof that the module `name` imports."""
    nodes = [node for node, _ in statements(name)]
    names = [node.module for node in nodes if isinstance(node, ast.ImportFrom) and not node.level]
    names += [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    return {name.split(".")[0] for name in names}


def test_the_table_tells_of_every_room_and_file_and_of_no_other():
    assert {name.removesuffix(".py") for name in table()} == rooms()
    assert [name for name in table() if not (PACKAGE / name).exists()] == []


def test_the_drawing_has_every_room_once():
    block = re.search(r"Imports run one way.+?\n\n((?:    [\w ]+\n)+)", PAGE, re.DOTALL)[1].split()
    assert sorted(block) == sorted(rooms())


@pytest.mark.parametrize("room", sorted(rooms()))
def test_a_room_imports_only_from_below(room):
    """As drawn, inside functions too."""
    line = drawn()
    wrong = {
        f"{'.'.join(name)} imports {'.'.join(target)}"
        for name in MODULES
        if name[:1] == (room,)
        for target, at_top in imports(name)
        if target and target[0] != room and line[target[0]] >= line[room] and (at_top or name not in DOORS)
    }
    assert wrong == set()


def test_no_file_imports_itself_by_way_of_others():
    graph = {
        name: {target for target, at_top in imports(name) if at_top or name not in DOORS} for name in MODULES if name
    }
    assert len(list(TopologicalSorter(graph).static_order())) >= len(graph)


@pytest.mark.parametrize("package", re.findall(r"the only package that imports (\w+)", PAGE))
def test_only_one_room_imports(package):
    (room,) = (name for name, says in table().items() if f"the only package that imports {package}" in says)
    assert {name[0] for name in MODULES if package in foreign(name)} == {room}


@pytest.mark.parametrize("room", sorted(name for name in rooms() - SELF_EVIDENT if (PACKAGE / name).is_dir()))
def test_a_room_tells_its_files(room):
    """In the text at its door, and so do rooms within it."""
    for door in (PACKAGE / room).rglob("__init__.py"):
        told = ast.get_docstring(ast.parse(door.read_text(encoding="utf-8"))) or ""
        files = {path.stem for path in door.parent.glob("*.py") if not path.stem.startswith("__")}
        files |= {path.parent.name for path in door.parent.glob("*/__init__.py")}
        assert [name for name in sorted(files) if not re.search(rf"\b{name}\b", told)] == []
