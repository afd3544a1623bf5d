"""Join the tiles' buildings into the output files, in plan order, one tile in memory at a time."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from pathlib import Path

from ..model import Building
from .plan import Plan


def merge(plan: Plan, state: Path, out: Path, progress: Callable[[str, int, int], None]) -> list[str]:
    """Write buildings.gml, buildings.city.jsonl, parameters.jsonl and buildings.gpkg, each whole or not at all.

    Returns the ids of buildings whose solid could not be written; they appear without it.
    """
    from ..write import write_all

    return write_all(out, buildings_of(plan, state, progress), plan.crs())


def buildings_of(plan: Plan, state: Path, progress: Callable[[str, int, int], None]) -> Iterator[Building]:
    for number, tile in enumerate(plan.tiles):
        progress("merge", number, len(plan.tiles))
        yield from pickle.loads((state / "tiles" / f"{tile}.pickle").read_bytes())
