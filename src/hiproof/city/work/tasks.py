"""The tasks of a run by name.

What they need is imported where they run: a main process that only hands them out does without
compiled code, the network and the readers of points.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from importlib import import_module
from typing import Any, TypeAlias

MAIN_JOB = ("moves", "planes", "single", "solid", "points")
"""Pieces of compiled code (warm_pieces.py) that every run needs, the longest first."""

WITHOUT_FOOTPRINTS = (*MAIN_JOB, "outlines")
"""Those of runs without footprints."""


WORK = ("hiproof.city.work.sort", "hiproof.city.work.solve", "hiproof.fit.union")
"""Modules that a worker needs."""


Arguments: TypeAlias = tuple[Any, ...]
"""Arguments of a task's function."""
TaskOutcome: TypeAlias = tuple[Arguments, Any, Exception | None]
"""Arguments, result and error of a task."""


class WorkerLost(Exception):
    """The process that ran the task died (killed, out of memory)."""


def call(function: str, *arguments: Any) -> Any:
    """Call the function of a name within hiproof, imported where the call runs."""
    module, _, name = function.rpartition(".")
    return getattr(import_module(f"hiproof.{module}"), name)(*arguments)


sort_cloud = functools.partial(call, "city.work.sort.sort_cloud")
solve_tile = functools.partial(call, "city.work.solve.solve_tile")


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
