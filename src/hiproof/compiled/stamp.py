"""The stamp of a source file: a digest of all that its code depends on.

Compiling puts functions and constants of other files into a function, so the stamp is made of the
file's text and of the texts of all files of its package that imports lead to from there, with the
versions of the compiler and of NumPy. A change of any of them is a new stamp; one elsewhere is not.
Imports inside functions do not count: compiled code knows the names at the top of a module alone.
"""

from __future__ import annotations

import functools
import hashlib
import os
import re
import sys
from collections.abc import Iterable, Iterator
from importlib import import_module
from pathlib import Path

IMPORT = re.compile(
    r"^(?:from[ \t]+(?P<dots>\.*)(?P<module>[\w.]*)[ \t]+import[ "
    r"\t]+(?P<names>\([^)]*\)|.+)|import[ \t]+(?P<modules>.+))$",
    re.MULTILINE,
)
# the same for all its patches, which run the same code
PYTHON = f"py{sys.version_info.major}{sys.version_info.minor}{getattr(sys, 'abiflags', '')}"
VERSIONS = ("numba", "llvmlite", "numpy")
HERE = Path(__file__).parent
PACKAGE = HERE.parent
DECIDING = ("__init__.py", "dispatcher.py", "linking.py", "references.py", "typing_memory.py")


@functools.cache
def compute_stamp(file: Path) -> str:
    """Return the stamp of a file, sixteen hexadecimal digits.

    Files that cannot be read raise OSError.
    """
    return digest(closure(file))


def compute_common_stamp() -> str:
    """Return one stamp of all sources of hiproof's compiled functions."""
    return digest(set().union(*map(closure, compiled_files())))


@functools.cache
def count_compiled() -> int:
    """Count the functions that hiproof compiles."""
    return sum(file.read_bytes().count(b"\n@compiled") for file in compiled_files())


@functools.cache
def compiled_files() -> tuple[Path, ...]:
    return tuple(Path(file) for file in iterate_sources(PACKAGE) if compiles(file))


def compiles(file: str) -> bool:
    """Return whether a source file holds a function that is compiled."""
    with open(file, "rb") as source:
        return b"\n@compiled" in source.read()


def iterate_sources(folder: str | Path) -> Iterator[str]:
    """Yield the source files in a folder and in those below it.

    Folders of compiled code hold thousands of files, and are not looked into.
    """
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.endswith(".py"):
                yield entry.path
            elif entry.name != "__pycache__" and entry.is_dir():
                yield from iterate_sources(entry.path)


def digest(files: Iterable[Path]) -> str:
    """Return one stamp of several files.

    It depends neither on their order nor on where their package lies.
    """
    hasher = hashlib.sha256(" ".join([PYTHON, *map(read_version, VERSIONS)]).encode())
    for file in sorted(files, key=place_in_package):
        hasher.update(digest_file(file))
    return hasher.hexdigest()[:16]


@functools.cache
def digest_file(file: Path) -> bytes:
    """Return the digests of a file's place and of its text, one after the other."""
    return b"".join(
        hashlib.sha256(text).digest()
        for text in (place_in_package(file).encode(), file.read_bytes())
    )


@functools.cache
def read_version(library: str) -> str:
    return import_module(library).__version__  # its metadata take ten times as long to find


def closure(file: Path) -> set[Path]:
    """Return the file and all files to which its imports lead.

    These are files within its own package and hiproof.

    How code is kept changes nothing of it, so of this folder only the decorator and the linking
    count, which no import names.
    """
    result: set[Path] = set()
    open_ends = [file, *(HERE / name for name in DECIDING)]
    while open_ends:
        position = open_ends.pop()
        if position not in result and (position.parent != HERE or position.name in DECIDING):
            result.add(position)
            open_ends.extend(list_imports(position))
    return result


@functools.cache
def list_imports(file: Path) -> frozenset[Path]:
    """Return the files that import statements at the top of `file` name.

    These are files of the two packages.
    """
    statements = IMPORT.finditer(file.read_bytes().decode())
    paths = {path for statement in statements for path in resolve_import(file, statement)}
    return frozenset().union(*map(find_sources, paths))


@functools.cache
def find_sources(path: str) -> frozenset[Path]:
    """Return the source files of the module or the package at a path without ending."""
    sources = (f"{path}.py", os.path.join(path, "__init__.py"))
    return frozenset(Path(source) for source in sources if os.path.isfile(source))


def resolve_import(file: Path, statement: re.Match) -> Iterator[str]:
    """Yield the modules and packages that one import statement may mean.

    They are paths without ending.
    """
    if statement["modules"]:
        for name in re.findall(r"[\w.]+", statement["modules"]):
            parts = name.split(".")
            yield from (
                os.path.join(start, *parts[:n])
                for start in starts(file, parts[0])
                for n in range(1, len(parts) + 1)
            )
        return
    parts = [part for part in statement["module"].split(".") if part]
    dots = len(statement["dots"])
    for start in (file.parents[dots - 1],) if dots else starts(file, parts[0]):
        base = os.path.join(start, *parts)
        yield base
        # a module holds no others
        if is_folder(base):
            yield from (os.path.join(base, name) for name in re.findall(r"\w+", statement["names"]))


def starts(file: Path, package: str) -> Iterator[Path]:
    """Yield the folders in which absolute imports of `package` are looked up.

    They are beside the file's own package and beside hiproof.
    """
    for top in {find_top_folder(file), PACKAGE}:
        if top.name == package:
            yield top.parent


is_folder = functools.cache(os.path.isdir)


@functools.cache
def find_top_folder(file: Path) -> Path:
    """Return the outermost folder of the package to which `file` belongs.

    For a file outside packages it is the file itself without ending.
    """
    top = file.with_suffix("")
    while (top.parent / "__init__.py").exists():
        top = top.parent
    return top


@functools.cache
def place_in_package(file: Path) -> str:
    """Return the file's path from its package's folder, with forward slashes."""
    return file.relative_to(find_top_folder(file).parent).as_posix()
