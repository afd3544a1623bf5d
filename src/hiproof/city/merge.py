"""Join the texts that the workers made into the output files, in plan order, one tile in memory at a time."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from pathlib import Path

from ..write.run_files import Fragments, join_fragments
from .plan import Plan

FILES = ("buildings.gml", "buildings.city.jsonl", "parameters.jsonl", "buildings.gpkg", "buildings.parquet")


def merge(plan: Plan, state: Path, out: Path, progress: Callable[[str, int, int], None]) -> None:
    """Write the files of the run, each whole or not at all, and remove what a killed merge left unfinished."""
    for name in FILES:
        for leftover in out.glob(f".{name}-*"):
            leftover.unlink(missing_ok=True)
    join_fragments(out, parts_of(plan, state, progress), plan.translate, plan.crs(), plan.settings.city.parquet)


def parts_of(plan: Plan, state: Path, progress: Callable[[str, int, int], None]) -> Iterator[Fragments]:
    for number, tile in enumerate(plan.tiles):
        progress("merge", number, len(plan.tiles))
        yield from pickle.loads((state / "tiles" / f"{tile}.pickle").read_bytes())
