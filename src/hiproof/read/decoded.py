"""Points of LAS, LAZ and COPC files as they are decoded, in few bytes.

A run reads its files twice, to plan and to sort their points, and decoding takes most of the time
of reading. So what is read from end to end inside `hold_points` is held for the next reading. Of a
file with too many points, the places of its runs are held: a box needs few of them (runs.py).
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

from .remote import is_url

MOST_HELD_POINTS = 1_000_000
"""Points that are held at once, in 14 bytes each: a tile of a town."""


class Decoded(NamedTuple):
    """Decoded points.

    They have whole steps (n, 3) of the file's scales (3,) from its offsets (3,), classes (n,), and
    a mark (n,) on those that are withheld.
    """

    steps: np.ndarray
    classes: np.ndarray
    is_withheld: np.ndarray
    scales: np.ndarray
    offsets: np.ndarray

    @property
    def xyz(self) -> np.ndarray:
        """World coordinates (n, 3)."""
        xyz = np.empty(self.steps.shape)
        for axis in range(3):
            np.multiply(self.steps[:, axis], self.scales[axis], out=xyz[:, axis])
            xyz[:, axis] += self.offsets[axis]
        return xyz


FileKey: TypeAlias = tuple[str, tuple[int, int] | None]
"""A file's name and state: one that was written again in between is another one."""


class Holder:
    """The chunks of whole files that are held, and boxes (k, 4) of their runs."""

    def __init__(self) -> None:
        self.is_open = False
        self.held: dict[FileKey, list[Decoded]] = {}
        self.places: dict[FileKey, list[np.ndarray]] = {}

    def count_points(self) -> int:
        return sum(len(chunk.classes) for chunks in list(self.held.values()) for chunk in chunks)

    def hold(self, key: FileKey, chunks: Iterator[Decoded], count: int) -> Iterator[Decoded]:
        """Yield the chunks of a file of `count` points, and hold them once all are read.

        Nothing is held of a file that breaks off, or for which there is no room.
        """
        if not self.is_open or self.count_points() + count > MOST_HELD_POINTS:
            yield from chunks
            return
        passed: list[Decoded] = []
        for chunk in chunks:
            passed.append(chunk)
            count -= len(chunk.classes)
            if not count:
                self.held[key] = passed
            yield chunk

    def release(self, key: FileKey, chunk_points: int) -> Iterator[Decoded] | None:
        """Return the chunks of a file that is held.

        None of them is held any longer once it is yielded. None is for a file that is not held, or
        in larger chunks.
        """
        chunks = self.held.pop(key, None)
        if chunks is None or len(chunks[0].classes) > chunk_points:
            return None
        return (chunks.pop(0) for _ in range(len(chunks)))


HOLDER = Holder()


@contextmanager
def hold_points() -> Iterator[None]:
    """Hold whole files that are read in here until they are read again."""
    HOLDER.is_open = True
    try:
        yield
    finally:
        HOLDER.is_open = False


def forget_points() -> None:
    """Hold no file any longer."""
    HOLDER.held.clear()
    HOLDER.places.clear()


def decode_or_release(
    path: str | Path, chunk_points: int, count: int, chunks: Iterator[Decoded]
) -> Iterator[Decoded]:
    """Yield the `chunks` of a whole file, or what is held of it.

    It has `count` points.
    """
    key = identify_file(path)
    yield from HOLDER.hold(key, HOLDER.release(key, chunk_points) or chunks, count)


def is_held(path: str | Path) -> bool:
    """Return whether the points of a file need not be decoded again."""
    return identify_file(path) in HOLDER.held


def note_places(path: str | Path) -> list[np.ndarray] | None:
    """Return a list for the boxes of a file's runs while it is read from end to end.

    It is None outside of `hold_points`.
    """
    if not HOLDER.is_open:
        return None
    places: list[np.ndarray] = []
    HOLDER.places[identify_file(path)] = places
    return places


def take_places(path: str | Path) -> list[np.ndarray]:
    """Return the boxes of a file's runs, and hold them no longer.

    There are none where the file was not read.
    """
    return HOLDER.places.pop(identify_file(path), [])


def identify_file(path: str | Path) -> FileKey:
    if is_url(path):
        return str(path), None
    facts = Path(path).stat()
    return os.path.abspath(path), (facts.st_mtime_ns, facts.st_size)
