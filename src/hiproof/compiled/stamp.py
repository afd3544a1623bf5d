"""The stamp of a source file: a digest of all that its code depends on.

Compiling puts functions and constants of other files into a function, so the stamp is made of the
file's text and of the texts of all files of its package that imports lead to from there, with the
versions of the compiler and of NumPy. A change of any of them is a new stamp; one elsewhere is not.
Imports inside functions do not count: compiled code knows the names at the top of a module alone.
"""

from __future__ import annotations

import functools
import hashlib
import re
import sys
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path

IMPORT = re.compile(
    r"^(?:from[ \t]+(\.*)([\w.]*)[ \t]+import[ \t]+(\([^)]*\)|.+)|import[ \t]+(.+))$", re.MULTILINE
)
# the same for all its patches, which run the same code
PYTHON = f"py{sys.version_info.major}{sys.version_info.minor}{getattr(sys, 'abiflags', '')}"
VERSIONS = ("numba", "llvmlite", "numpy")
HERE = Path(__file__).parent
PACKAGE = HERE.parent
DECIDING = (HERE / "__init__.py", HERE / "dispatcher.py")


@functools.cache
def compute_stamp(file: Path) -> str:
    """Return the stamp of a file, sixteen hexadecimal digits; raises OSError if unreadable."""
    return digest(closure(file))


@functools.cache
def compute_common_stamp() -> str:
    """Return one stamp of all sources of hiproof's compiled functions."""
    return digest(set().union(*map(closure, compiled_files())))


@functools.cache
def count_compiled() -> int:
    """Count the functions that hiproof compiles."""
    return sum(file.read_bytes().count(b"\n@compiled") for file in compiled_files())


@functools.cache
def compiled_files() -> tuple[Path, ...]:
    """Return hiproof's sources with functions that are compiled."""
    return tuple(file for file in PACKAGE.rglob("*.py") if b"\n@compiled" in file.read_bytes())


def digest(files: Iterable[Path]) -> str:
    """Return one stamp of several files, whatever their order and their package's place."""
    versions = [import_module(name).__version__ for name in VERSIONS]
    parts = [" ".join([PYTHON, *versions]).encode(), *sorted(map(digest_file, files))]
    return hashlib.sha256(b"".join(parts)).hexdigest()[:16]


@functools.cache
def digest_file(file: Path) -> bytes:
    """Return the digest of a file's name and text."""
    return hashlib.sha256(file.name.encode() + file.read_bytes()).digest()


def closure(file: Path) -> set[Path]:
    """Return the file and all files to which its imports lead.

    These are files within its own package and hiproof. How code is kept changes nothing of it, so
    of this folder only the decorator and the dispatcher count, which no import names.
    """
    result: set[Path] = set()
    open_ends = [file, *DECIDING]
    while open_ends:
        position = open_ends.pop()
        if position not in result and (position.parent != HERE or position in DECIDING):
            result.add(position)
            open_ends.extend(list_imports(position))
    return result


@functools.cache
def list_imports(file: Path) -> frozenset[Path]:
    """Return the files of the two packages that imports at the top of `file` name."""
    tops, paths = {find_top_folder(file), PACKAGE}, set()
    for dots, module, names, modules in IMPORT.findall(file.read_text(encoding="utf-8")):
        for name in re.findall(r"[\w.]+", modules) or [module]:
            parts = name.split(".")
            starts = [top.parent for top in tops if top.name == parts[0]]
            for start in [file.parents[len(dots) - 1]] if dots else starts:
                base = start.joinpath(*parts)
                paths |= {base, *(base / part for part in re.findall(r"\w+", names))}
    return frozenset().union(*map(find_sources, paths))


@functools.cache
def find_sources(path: Path) -> frozenset[Path]:
    """Return the source files of the module or the package at a path without ending."""
    sources = path.parent / f"{path.name}.py", path / "__init__.py"
    return frozenset(source for source in sources if source.is_file())


@functools.cache
def find_top_folder(file: Path) -> Path:
    """Return the outermost folder of the package of `file`; outside packages, its own stem."""
    top = file.with_suffix("")
    while (top.parent / "__init__.py").exists():
        top = top.parent
    return top
