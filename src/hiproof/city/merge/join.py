"""Joining of the workers' texts into the output files.

It goes in plan order, with one tile in memory at a time.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
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
from ..plan.work_plan import WorkPlan

ENDINGS = "|".join(re.escape(format.tile_ending) for format in OF_TILES.values())
TILE_FILE = re.compile(rf"\.?-?\d+_-?\d+_\d+({ENDINGS}).*")  # a dot before it: unfinished


def merge(
    plan: WorkPlan,
    head: FileHead,
    state: Path,
    out: Path,
    progress: Callable[[str, int, int], None],
) -> None:
    """Write the files of the run, which begin by `head`, each whole or not at all.

    What a killed merge left unfinished is removed.
    """
    for name in (format.file for format in FORMATS.values() if format.fragment):
        for leftover in out.glob(f".{name}-*"):
            leftover.unlink(missing_ok=True)
    remove_tiles(out, ".*")
    join_fragments(whole_files(plan, out), iterate_fragments(plan, state, progress), head)


def iterate_fragments(
    plan: WorkPlan, state: Path, progress: Callable[[str, int, int], None]
) -> Iterator[Fragments]:
    for number, tile in enumerate(plan.tiles):
        progress("merge", number, len(plan.tiles))
        yield from load_fragments(tile_parts(state, tile))


def tile_parts(state: Path, tile: str) -> Path:
    """Return where the buildings of a work tile wait to be joined."""
    return state / "tiles" / f"{tile}.npz"


def output_files(plan: WorkPlan, out: Path) -> list[Path]:
    """Return all files that a run of this plan writes.

    The record of the run is left out.
    """
    return [
        *whole_files(plan, out).values(),
        *(file for tile in plan.tiles for file in tile_files(plan, out, tile).values()),
    ]


def whole_files(plan: WorkPlan, out: Path) -> dict[str, Path]:
    """Return the files of the whole area by format."""
    return list_requested_files(plan.settings, out)


def tile_files(plan: WorkPlan, out: Path, tile: str) -> dict[str, Path]:
    """Return the files of one work tile's models by format.

    There are none unless the settings ask for them.
    """
    return list_requested_tile_files(plan.settings, out / TILE_FOLDER, tile)


def write_tile(plan: WorkPlan, out: Path, tile: str, parts: list[Fragments]) -> None:
    """Write the models of a work tile into the folder of tiles.

    That is done where the settings ask for it.
    """
    join_fragments(tile_files(plan, out, tile), parts, plan.head)


def remove_tiles(out: Path, pattern: str = "*") -> None:
    """Remove the models of work tiles whose names match `pattern`.

    Files of others stay.
    """
    for file in (out / TILE_FOLDER).glob(pattern):
        if TILE_FILE.fullmatch(file.name):
            file.unlink(missing_ok=True)
