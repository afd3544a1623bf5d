"""The open tasks of a run, worked off by an executor.

A task whose process keeps dying goes into quarantine: it is run in a process of its own, and of a
work tile the buildings that kill that process are found and left out.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...log import LOGGER, count_things
from ...status import Status
from ..folder.ledger import Ledger
from ..merge.join import write_tile
from ..plan.from_cloud import Progress
from ..plan.overrides import load_redo
from ..plan.work_plan import WorkPlan, load_plan
from . import solved
from .executors import Executor
from .tasks import Arguments, WorkerLost

# deaths of its process, alone, until a task is taken for their cause: memory may run out by chance
TRIES = 3


def run_isolated(single: Any, function: Callable, task: tuple) -> tuple[Any, Exception | None]:
    """Return (result, error) of `function(*task)` run alone, tried again if its process dies."""
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


MOST_LOSSES = 3  # deaths of its process until a task is tried alone: two may be a neighbour's doing


@dataclass
class Queue:
    """The open tasks of a run: point files to sort, and tiles to solve.

    `clouds` and `terrain` are what they read.
    """

    plan: WorkPlan
    state: Path
    ledger: Ledger
    executor: Executor
    clouds: tuple[str, ...]
    terrain: str | None
    progress: Progress
    counted: int = 0

    def work_off(self, kind: str, function: Callable[..., Any]) -> None:
        """Run all open tasks of a kind.

        One whose process dies is tried again, and after MOST_LOSSES alone.
        """
        tasks = [task for task in self.ledger.tasks() if task.kind == kind]
        sizes = {task.name: task.buildings if kind == "solve" else 1 for task in tasks}
        total, self.counted = sum(sizes.values()), 0

        def show(ended: int, since: int = 0) -> None:
            """Show what tasks that ended hold, and what was counted since of others."""
            self.counted = max(self.counted + since, ended)
            self.progress(kind, min(self.counted, total), total)

        while names := self.ledger.open_tasks(kind):
            ended = total - sum(sizes[name] for name in names)
            show(ended)
            suspects = [name for name in names if self.ledger.losses(name) >= MOST_LOSSES]
            for name in suspects:
                self.run_isolated(name, function)
            solved.listener = lambda count: show(0, count)
            try:
                started = self.start([name for name in names if name not in suspects])
                for task, result, error in self.executor.run(function, started):
                    name = f"{kind}:{task[1]}"
                    if is_loss(error):
                        self.ledger.lose(name)
                        text = "%s was lost (%s) and is tried again"
                        LOGGER.warning(text, name, error or "out of memory")
                    else:
                        self.finish(name, result, error)
                        ended += sizes[name]
                        show(ended)
            finally:
                solved.listener = solved.ignore

    def start(self, names: list[str]) -> Iterator[Arguments]:
        """Yield the arguments of tasks, and record each as running when it is taken."""
        for name in names:
            self.ledger.start(name)
            yield self.make_arguments(name)

    def make_arguments(self, name: str) -> Arguments:
        """Return the run's folder, the task's file or tile, and what it reads."""
        kind, key = name.split(":", 1)
        folder = str(self.state.absolute())
        if kind == "sort":
            return folder, int(key), make_absolute(self.clouds[int(key)])
        return folder, key, self.terrain and make_absolute(self.terrain)

    def finish(self, name: str, result: Any, error: Exception | None) -> None:
        """Enter a finished task.

        Only unreadable point files may fail; any other error ends the run with what is done kept.
        """
        kind, key = name.split(":", 1)
        if kind == "sort" and isinstance(error, InputError):
            self.ledger.finish(name, "failed", str(error))
            LOGGER.error("a point file could not be read: %s", error)
        elif error is not None:
            raise error
        elif kind == "sort":
            self.ledger.finish(name, "done", json.dumps(result))
            LOGGER.info("%s is done: %s", name, result)
        else:
            with self.ledger.transact():
                self.ledger.finish(name, "done", "", result)
                write_tile(self.plan, self.state, key, self.ledger.texts(key))
            for outcome in result:
                is_error = outcome.status == Status.INTERNAL_ERROR.code
                level = logging.ERROR if is_error else logging.DEBUG
                LOGGER.log(level, "building %s: %s", outcome.id, outcome.detail)
            LOGGER.info("%s is done: %s", name, count_things(len(result), "building"))

    def run_isolated(self, name: str, function: Callable[..., Any]) -> None:
        """Run a task whose process kept dying in a process of its own."""
        times = count_things(self.ledger.losses(name), "time")
        LOGGER.warning("%s was lost %s and is now tried alone", name, times)
        run = solve_in_quarantine if name.startswith("solve:") else run_isolated
        with closing(self.executor.isolate()) as single:
            result, error = run(single, function, self.make_arguments(name))
        if is_loss(error):
            died = (
                "the process died each time it read this file; not enough memory, or a damaged file"
            )
            self.ledger.finish(name, "failed", died)
        else:
            self.finish(name, result, error)


def make_absolute(name: str) -> str:
    """Return a path that means the same to a worker started elsewhere.

    Addresses stay as they are.
    """
    return name if "://" in name or name.startswith("/vsi") else str(Path(name).absolute())
