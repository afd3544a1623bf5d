"""The tasks of a run by name.

What they need is imported where they run: a main process that only hands them out does without
compiled code, the network and the readers of points.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any, TypeAlias

from ..folder.ledger import Outcome

MAIN_JOB = ("moves", "planes", "solid", "points", "curves")
"""Pieces of compiled code (warm_pieces.py) that every run needs, the longest first."""

ONE_PRIMITIVE = (*MAIN_JOB, "single")
"""Those of runs that fit one primitive a building."""

WITHOUT_FOOTPRINTS = (*ONE_PRIMITIVE, "outlines")
"""Those of runs without footprints."""


WORK = ("hiproof.city.work.sort", "hiproof.city.work.solve", "hiproof.fit.union")
"""Modules that a worker needs."""


Arguments: TypeAlias = tuple[Any, ...]
"""Arguments of a task's function."""
TaskOutcome: TypeAlias = tuple[Arguments, Any, Exception | None]
"""Arguments, result and error of a task."""


class WorkerLost(Exception):
    """The process that ran the task died (killed, out of memory)."""


def sort_cloud(folder: str, number: int, address: str) -> dict:
    """Sort a point file; see sort.py."""
    from . import sort

    return sort.sort_cloud(folder, number, address)


def solve_tile(
    folder: str, tile: str, terrain: str | None = None, avoid: tuple[int, ...] = ()
) -> list[Outcome]:
    """Solve a work tile; see solve.py."""
    from . import solve

    return solve.solve_tile(folder, tile, terrain, avoid)


def import_work() -> None:
    """Import what tasks need, in a worker that waits for its first one."""
    for name in WORK:
        import_module(name)


def is_ready(pieces: Sequence[str]) -> bool:
    """Return whether everything was compiled before; see warm.py."""
    from . import warm

    return not warm.list_missing(pieces)


def make_ready(pieces: Sequence[str]) -> None:
    """Compile ahead of the work; see warm.py."""
    from . import warm

    warm.make_ready(pieces)
