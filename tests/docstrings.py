"""List the docstrings outside of tests that are not as CONTRIBUTING.md asks.

usage: python tests/docstrings.py
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from naming import (
    ROOT,
    is_property,
    iterate_statements,
    list_files,
    list_files_around,
    name_file,
    parse,
)

LONGEST_LINE = 93  # characters of a first line: with its quotes and indent it fits in 100 columns
NOUNS = ("The", "A", "An", "What", "Whether", "How", "Where", "Which", "Those", "All", "One", "Of")
"""Words that begin a noun or a clause where a function needs a verb."""

Documented = ast.Module | ast.ClassDef | ast.FunctionDef


def iterate_docstrings() -> Iterator[tuple[str, Documented, str]]:
    """Yield the place, the node and the docstring of all that has one outside of tests."""
    around = [file for file in list_files_around() if file.parts[len(ROOT.parts)] != "tests"]
    for file in (*list_files(), *around):
        yield from iterate_file(file)


def iterate_file(file: Path) -> Iterator[tuple[str, Documented, str]]:
    """Yield the place, the node and the docstring of all that has one in a file."""
    for node in iterate_statements(parse(file)):
        if isinstance(node, Documented) and (text := ast.get_docstring(node)):
            yield f"{name_file(file)}: {getattr(node, 'name', 'module')}", node, text


def find_fault(node: Documented, text: str) -> str:
    """Return what is wrong with a docstring, empty where nothing is.

    >>> function = ast.parse("def area(): ...").body[0]
    >>> find_fault(function, "Return the area."), find_fault(function, "The area.")
    ('', 'first line begins with no verb')
    """
    first, *rest = text.splitlines()
    paragraphs = [" ".join(paragraph.split()) for paragraph in text.split("\n\n")]
    if len(set(paragraphs)) < len(paragraphs):
        return "says a paragraph twice"
    if len(first) > LONGEST_LINE:
        return f"first line is longer than {LONGEST_LINE} characters"
    if not first.endswith((".", "?")) or (rest and rest[0].strip()):
        return "first line is no sentence of its own"
    is_function = isinstance(node, ast.FunctionDef) and not is_property(node)
    word = first.split()[0]
    if is_function and (word in NOUNS or not re.fullmatch(r"[A-Z][a-z]+,?", word)):
        return "first line begins with no verb"
    return ""


def find_faulty_docstrings() -> list[str]:
    """Return the places of faulty docstrings, and what is wrong."""
    faults = ((place, find_fault(node, text)) for place, node, text in iterate_docstrings())
    return [f"{place}: {fault}" for place, fault in faults if fault]


if __name__ == "__main__":
    print(*find_faulty_docstrings(), sep="\n")
