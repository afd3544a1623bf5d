"""Work that keeps killing its process: run it alone, and find the building that does it.

A process may also die of what others do (a kill from outside, memory taken by a neighbour). So nothing is blamed before
it has died TRIES times with nothing beside it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from .executors import WorkerLost
from .plan import load_plan

TRIES = 3  # deaths of its process, alone, until a task is taken for their cause: memory may run out by chance


def run_alone(executor: Any, function: Callable, task: tuple) -> tuple[Any, Exception | None]:
    """(result, error) of `function(*task)` with no other task beside it, tried again when its process dies."""
    alone = executor.isolated()
    try:
        for _ in range(TRIES):
            ((_, result, error),) = alone.run(function, [task])
            if not isinstance(error, (WorkerLost, MemoryError)):
                break
        return result, error
    finally:
        alone.close()


def solve_in_quarantine(executor: Any, function: Callable, task: tuple) -> tuple[Any, Exception | None]:
    """The rows of `solve_tile` for its arguments `task` (folder, tile, terrain), without the buildings that kill their process: they become internal errors.

    Where the tile as a whole kills its process even alone, its buildings are tried one by one.
    """
    result, error = run_alone(executor, function, task)
    if not isinstance(error, (WorkerLost, MemoryError)):
        return result, error
    folder, tile, _ = task
    members, deadly = load_plan(Path(folder)).tiles[tile], []
    for index in members:
        others = tuple(i for i in members if i != index)
        if isinstance(run_alone(executor, function, (*task, others))[1], (WorkerLost, MemoryError)):
            deadly.append(index)
    return run_alone(executor, function, (*task, tuple(deadly)))
