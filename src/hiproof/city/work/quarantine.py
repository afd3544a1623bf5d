"""Work that keeps killing its process.

It runs alone, so that the building that does it is found.

A process may also die of what others do (a kill from outside, memory taken by a neighbour). So
nothing is blamed before it has died TRIES times with nothing beside it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..plan.overrides import load_redo
from ..plan.work_plan import load_plan
from .tasks import WorkerLost

# deaths of its process, alone, until a task is taken for their cause: memory may run out by chance
TRIES = 3


def run_isolated(single: Any, function: Callable, task: tuple) -> tuple[Any, Exception | None]:
    """Return (result, error) of `function(*task)` in an isolated executor.

    It is tried again when its process dies.
    """
    for _ in range(TRIES):
        ((_, result, error),) = single.run(function, [task])
        if not is_loss(error):
            break
    return result, error


def is_loss(error: Exception | None) -> bool:
    """Return whether a task ended with its process or for want of memory."""
    return isinstance(error, (WorkerLost, MemoryError))


def solve_in_quarantine(
    single: Any, function: Callable, task: tuple
) -> tuple[Any, Exception | None]:
    """Solve a tile without the buildings that kill their process.

    `task` (folder, tile, terrain) are the arguments of `solve_tile`, whose rows are returned. Such
    buildings become internal errors.

    Where the tile as a whole kills its process even alone, its buildings are tried one by one.
    """
    result, error = run_isolated(single, function, task)
    if not is_loss(error):
        return result, error
    folder, tile, _ = task
    members = load_redo(Path(folder)).get(tile) or load_plan(Path(folder)).tiles[tile]

    def is_deadly(index: int) -> bool:
        selected_members = tuple(i for i in members if i != index)
        return not selected_members or is_loss(
            run_isolated(single, function, (*task, selected_members))[1]
        )

    return run_isolated(single, function, (*task, tuple(filter(is_deadly, members))))
