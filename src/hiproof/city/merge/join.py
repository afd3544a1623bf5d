"""Joining of the workers' texts into the output files, in plan order, a tile at a time.

Size and digest of each file are kept in the ledger, and show whether it still stands.
"""

from __future__ import annotations

import functools
import hashlib
import re
from collections.abc import Callable, Iterable, Iterator
from itertools import chain, starmap
from pathlib import Path

from ...formats import (
    FORMATS,
    OF_TILES,
    TILE_FOLDER,
    list_requested_files,
    list_requested_tile_files,
)
from ...write.fragments import Fragments, load_fragments
from ...write.head import FileHead
from ...write.run_files import join_fragments
from ..folder.ledger import Claim, Ledger
from ..plan.work_plan import WorkPlan

TEXTS_FOLDER = "tiles"  # of the run's own folder: the texts of solved buildings, ready to be joined
ENDINGS = "|".join(re.escape(format.tile_ending) for format in OF_TILES.values())
TILE_FILE = re.compile(rf"\.?-?\d+_-?\d+_\d+({ENDINGS}).*")  # a dot before it: unfinished


def merge(
    plan: WorkPlan,
    head: FileHead,
    state: Path,
    ledger: Ledger,
    progress: Callable[[str, int, int], None],
) -> None:
    """Write the files of the run, which begin by `head`, each whole or not at all.

    What a killed merge left unfinished is removed.
    """
    out = state.parent
    for name in (format.file for format in FORMATS.values() if format.fragment):
        for leftover in out.glob(f".{name}-*"):
            leftover.unlink(missing_ok=True)
    remove_tiles(out, ".*")

    def load(number: int, tile: str) -> Iterator[Fragments]:
        progress("merge", number, len(plan.tiles))
        return load_texts(state, ledger.texts(tile))

    parts = chain.from_iterable(starmap(load, enumerate(plan.tiles)))
    join_fragments(list_requested_files(plan.settings, out), parts, head)


def load_texts(state: Path, places: Iterable[tuple[str, int]]) -> Iterator[Fragments]:
    """Load the texts of buildings, of which files and numbers there are known."""
    load = functools.lru_cache(maxsize=8)(lambda file: list(load_fragments(file)))
    return (load(state / TEXTS_FOLDER / file)[number] for file, number in places)


def list_text_files(state: Path, tile: str) -> list[Path]:
    """Return the files with texts of a work tile's buildings, the latest last."""
    return sorted((state / TEXTS_FOLDER).glob(f"{tile}.*.npz"), key=number_text_file)


def name_text_file(state: Path, tile: str) -> Path:
    """Return a new file for texts of a work tile's buildings."""
    files = list_text_files(state, tile)
    number = number_text_file(files[-1]) + 1 if files else 0
    return state / TEXTS_FOLDER / f"{tile}.{number}.npz"


def number_text_file(file: Path) -> int:
    return int(file.name.split(".")[1])


def list_output_files(plan: WorkPlan, out: Path) -> list[Path]:
    """Return all files that a run of this plan writes.

    The record of the run is left out.
    """
    tiles = (list_requested_tile_files(plan.settings, out / TILE_FOLDER, t) for t in plan.tiles)
    files = chain([list_requested_files(plan.settings, out)], tiles)
    return list(chain.from_iterable(map(dict.values, files)))


def write_tile(plan: WorkPlan, state: Path, tile: str, places: Iterable[tuple[str, int]]) -> None:
    """Write the models of a work tile, whose texts are at `places`, if the settings ask for it."""
    folder = state.parent / TILE_FOLDER
    if files := list_requested_tile_files(plan.settings, folder, tile):
        join_fragments(files, load_texts(state, places), plan.head)


def remove_tiles(out: Path, pattern: str = "*") -> None:
    """Remove the models of work tiles whose names match `pattern`.

    Files of others stay.
    """
    for file in (out / TILE_FOLDER).glob(pattern):
        if TILE_FILE.fullmatch(file.name):
            file.unlink(missing_ok=True)


SQLITE = b"SQLite format 3\0"
SQLITE_HEAD_BYTES = 100
# bytes of an SQLite file's head that change when a viewer opens it: how it is locked, and counters
# of that
RESTLESS = ((18, 20), (24, 28), (92, 100))


def claims(files: Iterable[Path], out: Path) -> list[Claim]:
    """Return the record of each of `files` of a run in `out`."""
    return [
        Claim(file.relative_to(out).as_posix(), file.stat().st_size, digest(file)) for file in files
    ]


def broken_claims(claims: Iterable[Claim], out: Path) -> list[str]:
    """Return the names of files that are missing or changed.

    Sizes are compared before digests.
    """

    def stands(file: Path, claim: Claim) -> bool:
        try:
            return file.stat().st_size == claim.bytes and digest(file) == claim.digest
        except OSError:
            return False

    return [claim.name for claim in claims if not stands(out / claim.name, claim)]


def digest(file: Path) -> str:
    """Return the SHA-256 of a file's content."""
    with open(file, "rb") as content:
        head = bytearray(content.read(SQLITE_HEAD_BYTES))
        if head.startswith(SQLITE):
            for start, end in RESTLESS:
                head[start:end] = bytes(end - start)
        sha = hashlib.sha256(head)
        return hashlib.file_digest(content, lambda: sha).hexdigest()
