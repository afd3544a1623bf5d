"""The files of compiled code.

There is one for each function, stamp of its sources, argument types and processor.

Code for the kind of processors that wheels carry (kinds.py) is read where there is none for this
machine's own.

What has another stamp is never read, and is removed when its successor is written. Files lie in
NUMBA_CACHE_DIR, beside the sources, or in the user's cache folder: read from any, written to the
first that can be written. Where none can, functions are compiled in every process, and a warning
says so once.
"""

from __future__ import annotations

import functools
import hashlib
import os
import pickle
import tempfile
import uuid
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba
from numba.core import caching
from numba.core.serialize import dumps

from ..errors import NotKeptWarning
from . import linking, loading, news, runtime
from .kinds import KIND, runs_kind
from .stamp import PYTHON, compute_stamp

WRAPPER = "-python"  # marks the file of a function's wrapper for calls from Python


class Kept:
    """One function's code on disk, a file for each tuple of argument types.

    numba uses it like its own cache.
    """

    def __init__(self, function: Callable, file: Path):
        self.function, self.name = function, f"{function.__module__}.{function.__qualname__}"
        self.module, self.stamp = file.stem, compute_stamp(file)
        self.start = f"{file.stem}.{function.__qualname__}-{self.stamp}"
        self.folders = folders(function, str(file))

    @property
    def cache_path(self) -> str:
        return str(self.folders[0])

    def load(self, signature: Any, context: Any) -> Any:
        """Load the code for these argument types; return None where it has to be compiled.

        What numba compiles with (`context.refresh`) is imported when it compiles; kept code needs
        its memory alone.
        """
        start_runtime(context)
        for code in self.read("", signature, context):
            try:
                result = loading.rebuild(context, *code)
            except Exception:  # damaged inside
                continue
            news.ready.add(self.name)
            return result
        return None

    def load_overload(self, signature: Any, context: Any) -> None:
        """Answer numba, which asks before it compiles, that nothing is kept.

        Otherwise it would be loaded.
        """
        place_to_write(self.folders)
        news.tell()

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep what was just compiled, and remove what is out of date."""
        news.ready.add(self.name)
        news.tell()
        if not result.library.has_dynamic_globals:  # addresses of this process: not to be kept
            linking.settle(result, self.function, signature)
            context, code = result.target_context, reduce_result(result)
            self.write("", signature, context, code, *linking.links(result))

    def load_wrapper(self, signature: Any, context: Any) -> tuple[list, bytes] | None:
        """Return constants and machine code of the wrapper for Python, or None.

        It is None where none is kept.
        """
        return next(self.read(WRAPPER, signature, context), None)

    def save_wrapper(self, signature: Any, context: Any, library: Any, constants: list) -> None:
        """Keep a wrapper that was just compiled."""
        if not library.has_dynamic_globals:
            self.write(WRAPPER, signature, context, constants, library._get_compiled_object())

    def read(self, part: str, signature: Any, context: Any) -> Iterator[Any]:
        """Yield the stored content of a `part` of the code.

        That for this machine's own processor comes first.
        """
        for path in self.places(part, signature, name_processor(context.codegen())):
            try:
                with open(path, "rb") as file:
                    selection, *content = pickle.load(file)
            except Exception:  # not there, or damaged, of which pickle makes errors of any kind
                continue
            if selection == signature:
                yield content

    def write(self, part: str, signature: Any, context: Any, *content: Any) -> None:
        """Write a `part` of the code where the next process finds it."""
        folder = place_to_write(self.folders)
        if folder is None:
            return
        file = folder / self.file_name(part, signature, name_processor(context.codegen()))
        sibling_path = file.with_name(f"{file.name}.{uuid.uuid4().hex}")
        try:
            sibling_path.write_bytes(dumps((signature, *content)))
            sibling_path.replace(file)
        except OSError:  # a full disk, a folder that went away
            warn_not_kept()
            with suppress(OSError):
                sibling_path.unlink()
            return
        remove_outdated(folder, self.module, self.stamp)

    def places(self, part: str, signature: Any, processor: tuple[str, str, str]) -> Iterator[str]:
        """Yield the paths at which a part of the code may lie.

        That for this machine's own processor comes first.
        """
        system, _, _ = processor
        for kind in (processor, (system, KIND, ""))[: 1 + runs_kind()]:
            name = self.file_name(part, signature, kind)
            yield from (os.path.join(folder, name) for folder in self.folders)

    def file_name(self, part: str, signature: Any, processor: tuple[str, str, str]) -> str:
        """Return the name of the file of a part of the code.

        `processor` is numba's name of the system, of the processor and of its features.
        """
        key = hashlib.sha256(repr((signature, processor)).encode()).hexdigest()[:16]
        return f"{self.start}-{key}{part}.{PYTHON}.nbc"

    def flush(self) -> None:
        """Forget the stored code.

        numba asks for this when a function is to be compiled again.
        """
        for folder in self.folders:
            for file in folder.glob(f"{self.start}-*.{PYTHON}.nbc"):
                file.unlink(missing_ok=True)


@functools.cache
def name_processor(codegen: Any) -> tuple[str, str, str]:
    """Return numba's names of the system, of the processor and of its features."""
    return codegen.magic_tuple()


def start_runtime(context: Any) -> None:
    """Have numba's runtime in this process, from disk or compiled."""
    if runtime.is_started():
        return
    selection, signature = Kept(start_runtime, Path(runtime.__file__)), ()
    for code in selection.read("", signature, context):
        with suppress(TypeError, ValueError, RuntimeError):  # damaged inside
            return runtime.start(context, *code)
    selection.write("", signature, context, *runtime.compile_runtime(context))


def reduce_result(result: Any) -> tuple:
    """Return what is pickled of a result.

    The annotation, half of it all, is for people who look into numba. Environments of copied
    functions that hold no constant are read by no code; loading them would import half of numba.
    """
    *code, _, reload, environments = result._reduce()
    selected_environments = tuple(environment for environment in environments if environment.consts)
    return *code, "", reload, selected_environments


def folders(function: Callable, file: str) -> tuple[Path, ...]:
    """Return the folders in which numba would keep functions of `file`.

    The first choice comes first.
    """
    key = file, numba.config.CACHE_DIR
    if key not in FOLDERS:
        kinds = [caching.InTreeCacheLocator, caching.UserWideCacheLocator]
        if numba.config.CACHE_DIR:
            kinds.insert(0, caching.UserProvidedCacheLocator)
        places = (Path(kind(function, file).get_cache_path()) for kind in kinds)
        # a user without a home has "~/.cache"
        FOLDERS[key] = tuple(place for place in places if place.is_absolute())
    return FOLDERS[key]


FOLDERS: dict[tuple[str, str], tuple[Path, ...]] = {}
"""The folders by file and by numba's setting: all functions of a file have the same."""


@functools.cache
def place_to_write(places: tuple[Path, ...]) -> Path | None:
    """Return the first folder that can be written, or None, with a warning."""
    for place in places:
        try:
            place.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=place).close()
            return place
        except OSError:
            continue
    warn_not_kept()
    return None


@functools.cache
def warn_not_kept() -> None:
    """Say once what it costs, and what to do."""
    warnings.warn(
        "expected a folder where compiled functions can be kept, got none that can be written "
        "(beside the installed "
        "package, the user's cache folder); every process compiles for minutes until "
        "NUMBA_CACHE_DIR names one",
        NotKeptWarning,
        stacklevel=2,
    )


@functools.cache
def remove_outdated(folder: Path, module: str, stamp: str) -> None:
    """Remove this Python's code of another state of the module's sources.

    Other Pythons still use theirs.
    """
    for file in folder.glob(f"{module}.*.{PYTHON}.*"):
        if f"-{stamp}-" not in file.name:
            file.unlink(missing_ok=True)
