"""The files of compiled code.

There is one for each function, stamp of its sources, argument types and processor. What has another
stamp is never read, and is removed when its successor is written. Files lie in NUMBA_CACHE_DIR,
beside the sources, or in the user's cache folder: read from any, written to the first that can be
written. Where none can, functions are compiled in every process, and a warning says so once.
"""

from __future__ import annotations

import functools
import hashlib
import os
import pickle
import tempfile
import uuid
import warnings
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba

from ..errors import NotKeptWarning
from .stamp import PYTHON


class Kept:
    """One function's code, a file for each key of argument types and processor."""

    def __init__(self, file: Path, name: str, stamp: str):
        self.module, self.stamp = file.stem, stamp
        self.start = f"{file.stem}.{name}-{stamp}"
        self.folders = list_folders(file.parent)

    def read(self, part: str, key: tuple) -> Iterator[Any]:
        """Yield the stored content of a `part` of the code, from each folder that has it."""
        for folder in self.folders:
            try:
                with open(folder / self.file_name(part, key), "rb") as file:
                    stored_key, *content = pickle.load(file)
            except Exception:  # not there, or damaged, of which pickle makes errors of any kind
                continue
            if stored_key == key:
                yield content

    def write(self, part: str, key: tuple, *content: Any) -> None:
        """Write a `part` of the code where the next process finds it."""
        folder = place_to_write(self.folders)
        if folder is None:
            return
        file = folder / self.file_name(part, key)
        sibling_path = file.with_name(f"{file.name}.{uuid.uuid4().hex}")
        try:
            sibling_path.write_bytes(pickle.dumps((key, *content)))
            sibling_path.replace(file)
        except OSError:  # a full disk, a folder that went away
            warn_not_kept()
            with suppress(OSError):
                sibling_path.unlink()
            return
        remove_outdated(folder, self.module, self.stamp)

    def file_name(self, part: str, key: tuple) -> str:
        """Return the name of the file of a part of the code."""
        digest = hashlib.sha256(repr(key).encode()).hexdigest()[:16]
        return f"{self.start}-{digest}{part}.{PYTHON}.nbc"


def list_folders(sources: Path) -> tuple[Path, ...]:
    """Return the folders for the code of sources in a folder, best first."""
    name = f"{sources.name}_{hashlib.sha256(str(sources).encode()).hexdigest()[:16]}"
    users = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or "~/.cache"
    chosen = [Path(numba.config.CACHE_DIR, name)] if numba.config.CACHE_DIR else []
    places = *chosen, sources / "__pycache__", Path(users).expanduser() / "hiproof" / name
    return tuple(place for place in places if place.is_absolute())


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
        "(beside the installed package, the user's cache folder); every process compiles for "
        "minutes until NUMBA_CACHE_DIR names one",
        NotKeptWarning,
        stacklevel=2,
    )


@functools.cache
def remove_outdated(folder: Path, module: str, stamp: str) -> None:
    """Remove this Python's code, and no other's, of another state of the module's sources."""
    for file in folder.glob(f"{module}.*.{PYTHON}.*"):
        if f"-{stamp}-" not in file.name:
            file.unlink(missing_ok=True)
