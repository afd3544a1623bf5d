"""Count lines, numbers, syntax nodes, files and compiled functions of the sources.

usage: python -m benchmarks.search_size [FOLDER ...] [--files]

Without a folder every package below `src/hiproof` is a row, and the last row is the total. A folder
is one below `src/hiproof`, such as `fit/union`, or one below the repository, such as `tests`.
`--files` prints a row a file.

A number is one in an assignment at the top of a module: `NEAR_M, TURNS = 0.2, (1, 2)` holds three.
Syntax nodes are those of Python's `ast` without docstrings and without the marks that say whether a
name is read or assigned, so that no layout changes them.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import hiproof

from .tables import FigureTable, make_parser

PACKAGE = Path(hiproof.__file__).parent
REPOSITORY, SOURCES = Path(__file__).parents[1], PACKAGE.parent
DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


class Size(NamedTuple):
    """What is counted of a file, or of several."""

    lines: int = 0
    numbers: int = 0
    nodes: int = 0
    files: int = 0
    compiled: int = 0


def measure(text: str) -> Size:
    """Return the size of a module's text."""
    tree = ast.parse(text)
    return Size(
        len(text.splitlines()), count_numbers(tree), count_nodes(tree), 1, count_compiled(tree)
    )


def count_numbers(tree: ast.Module) -> int:
    """Count the numbers in assignments at the top of a module.

    >>> text = "NEAR_M, TURNS = 0.2, (1, -2)\\nNAMES = ('a',)\\ndef f(x=3):\\n    y = 4\\n"
    >>> count_numbers(ast.parse(text))
    3
    """
    statements = [s for s in tree.body if isinstance(s, ast.Assign | ast.AnnAssign)]
    nodes = [node for statement in statements for node in ast.walk(statement)]
    values = [node.value for node in nodes if isinstance(node, ast.Constant)]
    return sum(isinstance(value, int | float) and not isinstance(value, bool) for value in values)


def count_nodes(tree: ast.Module) -> int:
    """Count the syntax nodes of a module without its docstrings and contexts of names.

    >>> count_nodes(ast.parse("x = 1")), count_nodes(ast.parse("'What it is.'\\nx = 1"))
    (4, 4)
    """
    nodes = [node for node in ast.walk(tree) if not isinstance(node, ast.expr_context)]
    documented = [node for node in nodes if isinstance(node, DOCUMENTED)]
    # a docstring is a statement and its constant
    return len(nodes) - 2 * sum(ast.get_docstring(node) is not None for node in documented)


def count_compiled(tree: ast.Module) -> int:
    """Count the functions at the top of a module that are compiled.

    >>> count_compiled(ast.parse("@compiled\\ndef f(): ...\\n\\ndef g(): ...\\n"))
    1
    """
    functions = [s for s in tree.body if isinstance(s, ast.FunctionDef)]
    decorators = [" ".join(map(ast.unparse, function.decorator_list)) for function in functions]
    return sum("compiled" in text for text in decorators)


def add(sizes: Iterable[Size]) -> Size:
    return Size(*map(sum, zip(Size(), *sizes, strict=True)))


def find_files(folder: Path) -> list[Path]:
    return [folder] if folder.suffix == ".py" else sorted(folder.rglob("*.py"))


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("folders", nargs="*", metavar="FOLDER", help="below the package")
    parser.add_argument("--files", action="store_true", help="print a row a file")
    a = parser.parse_args()
    folders = [
        next((path / name for path in (PACKAGE, REPOSITORY) if (path / name).exists()), Path(name))
        for name in a.folders
    ] or [path for path in sorted(PACKAGE.iterdir()) if find_files(path)]
    totals = []
    with FigureTable(a.record, "", *Size._fields) as table:
        for folder in folders:
            files = find_files(folder)
            sizes = [measure(path.read_text(encoding="utf-8")) for path in files]
            for path, size in zip(files, sizes, strict=True) if a.files else ():
                table.add(path.relative_to(folder.parent), *(f"{count:,}" for count in size))
            totals.append(add(sizes))
            name = folder.relative_to(SOURCES) if folder.is_relative_to(SOURCES) else folder.name
            table.add(name, *(f"{count:,}" for count in totals[-1]))
        if not a.folders:
            table.add("in all", *(f"{count:,}" for count in add(totals)))


if __name__ == "__main__":
    main()
