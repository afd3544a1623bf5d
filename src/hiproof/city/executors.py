"""Executors: where tasks run.

It is this process, processes of this machine, or a Dask cluster.

One verb: `run`.

`start()` may come early: workers import while the main process plans. `prepare(pieces)` comes
first: compiled code is made before the work starts, so that no two workers make the same.
`run(function, tasks)` yields (task, result, error) as tasks finish, in any order. A worker that
dies does not end the run: its tasks come back with a `WorkerLost`, and the caller decides whether
to try them again. `isolated()` is an executor whose worker's death harms nobody else. Tasks are
taken from their iterable only when a worker is near.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.sharedctypes import RawValue
from queue import Empty, SimpleQueue
from typing import Any, TypeAlias
from urllib.parse import urlsplit

from .. import log
from ..compiled import news
from ..compiled.stamp import count_compiled
from ..errors import InputError, OutputError, is_interrupt
from ..extras import import_extra
from . import solved
from .cores import limit_threads
from .tasks import import_work, is_ready, make_ready
from .workers import begin_worker, choose_context, describe_start

CONNECT_S = 20  # seconds for an answer of the scheduler
MOST_ON_WINDOWS = 61  # processes that one can wait for there
# seconds without a worker until a run gives up; seconds between looks at what is done
WORKERLESS_S, POLL_S = 300, 5
COUNT_S = 0.5  # seconds between looks at how many buildings the workers of this machine have solved


Arguments: TypeAlias = tuple[Any, ...]
"""Arguments of a task's function."""
Outcome: TypeAlias = tuple[Arguments, Any, Exception | None]
"""Arguments, result and error of a task."""


class WorkerLost(Exception):
    """The process that ran the task died (killed, out of memory)."""


class InProcess:
    """One task after the other in this process."""

    def start(self) -> None:
        pass

    def prepare(self, pieces: Sequence[str]) -> None:
        make_ready(pieces)

    def run(
        self, function: Callable, tasks: Iterable[tuple]
    ) -> Iterator[tuple[tuple, Any, Exception | None]]:
        for task in tasks:
            try:
                yield task, function(*task), None
            except Exception as error:
                if is_interrupt(error):
                    raise KeyboardInterrupt from error
                yield task, None, error

    def isolate(self) -> Processes:
        return Processes(1)

    def close(self) -> None:
        pass


class Processes:
    """`count` worker processes.

    See workers.py for how they begin.
    """

    def __init__(self, count: int):
        self.count = min(count, MOST_ON_WINDOWS) if sys.platform == "win32" else count
        self.pool: ProcessPoolExecutor | None = None
        self.word: Connection | None = None
        self.count_solved = RawValue("q", 0)  # by all workers, shared with them
        self.told = 0

    def start(self) -> None:
        """Start the workers, which import what tasks need."""
        for _ in range(self.count):
            self.submit(import_work, ())

    def prepare(self, pieces: Sequence[str]) -> None:
        """Compile what no run compiled before.

        A worker looks, so that this process imports the compiler only if it is needed.
        """
        answer = self.submit(is_ready, (pieces,))
        if answer.exception() or not answer.result():
            make_ready(pieces)

    def run(
        self, function: Callable, tasks: Iterable[tuple]
    ) -> Iterator[tuple[tuple, Any, Exception | None]]:
        try:
            yield from self.outcomes(function, tasks)
        # Ctrl-C, most of all: nobody waits any more for what the workers are at
        except BaseException:
            if self.word is not None:
                self.word.close()
            raise

    def outcomes(
        self, function: Callable, tasks: Iterable[tuple]
    ) -> Iterator[tuple[tuple, Any, Exception | None]]:
        waiting = iter(tasks)
        running: dict[Future, tuple] = {}
        while True:
            # two tasks a worker in the queue: enough to keep it busy, few enough to lose little
            # when one dies
            while len(running) < 2 * self.count and (task := next(waiting, None)) is not None:
                running[self.submit(function, task)] = task
            if not running:
                return
            finished, _ = wait(running, timeout=COUNT_S, return_when=FIRST_COMPLETED)
            self.tell_count()
            if any(isinstance(future.exception(), BrokenProcessPool) for future in finished):
                yield from self.bury(running)
                continue
            for future in finished:
                error: Any = future.exception()
                yield running.pop(future), None if error else future.result(), error

    def tell_count(self) -> None:
        """Tell the listener how many more buildings the workers have solved."""
        number = self.count_solved.value - self.told
        if number > 0:
            self.told += number
            solved.listener(number)

    def submit(self, function: Callable, task: tuple) -> Future:
        if self.pool is None:
            context = choose_context()
            heard, self.word = context.Pipe(duplex=False)
            state = describe_start(context)
            arguments: Any = (heard, state, log.worker_arguments(), self.count_solved)
            self.pool = ProcessPoolExecutor(
                self.count, mp_context=context, initializer=begin_worker, initargs=arguments
            )
        try:
            with limit_threads():
                return self.pool.submit(function, *task)
        except BrokenProcessPool as error:
            lost: Future = Future()
            lost.set_exception(error)
            return lost

    def bury(self, running: dict[Future, tuple]) -> Iterator[tuple[tuple, Any, Exception | None]]:
        """Hand back what finished, and report the rest as lost.

        A worker died and the pool with it; a new pool is started.
        """
        wait(running)
        self.close()
        for future, task in list(running.items()):
            error: Any = future.exception()
            lost = isinstance(error, BrokenProcessPool)
            yield (
                task,
                None if error else future.result(),
                WorkerLost("a worker process died") if lost else error,
            )
        running.clear()

    def isolate(self) -> Processes:
        return Processes(1)

    def close(self) -> None:
        if self.pool is not None:
            self.pool.shutdown(wait=True, cancel_futures=True)
            self.pool = None


class Dask:
    """A Dask cluster at `address`.

    Its workers must have hiproof installed and see the same files (a shared file system).
    """

    def __init__(self, address: str):
        distributed = import_distributed()
        self.address = address
        try:
            self.client = distributed.Client(address, timeout=CONNECT_S)
        except (OSError, ValueError) as error:
            raise InputError(
                f"expected a Dask scheduler at {address}, got: {error}; check the address"
            ) from error

    def start(self) -> None:
        pass

    def prepare(self, pieces: Sequence[str]) -> None:
        """Compile in one worker of each host, then load in the others.

        A host that joins later has to compile while it works.
        """
        one_of_each = {urlsplit(address).hostname: address for address in self.client.nthreads()}
        ends: SimpleQueue = SimpleQueue()
        tasks = [
            self.submit(
                ends, make_ready, (tuple(pieces),), workers=[address], allow_other_workers=True
            )
            for address in one_of_each.values()
        ]
        patience = threading.Timer(POLL_S, news.listener, (0, count_compiled()))
        patience.start()
        try:
            for _ in tasks:
                self.outcome(self.next_end(ends))
        finally:
            patience.cancel()

    def run(
        self, function: Callable, tasks: Iterable[tuple]
    ) -> Iterator[tuple[tuple, Any, Exception | None]]:
        waiting = iter(tasks)
        running: dict[Any, tuple] = {}
        ends: SimpleQueue = SimpleQueue()
        while True:
            threads = sum(self.client.nthreads().values())
            while len(running) < max(2 * threads, 2) and (task := next(waiting, None)) is not None:
                running[self.submit(ends, function, task)] = task
            if not running:
                return
            future = self.next_end(ends)
            yield running.pop(future), *self.outcome(future)

    def submit(self, ends: SimpleQueue, function: Callable, task: tuple, **where: Any) -> Any:
        """Submit a task, and return a future that goes into `ends` when it ends."""
        future = self.client.submit(function, *task, pure=False, **where)
        future.add_done_callback(ends.put)
        return future

    def next_end(self, ends: SimpleQueue) -> Any:
        """Return the next future that ends.

        Where all workers are gone and none comes, the run ends: Dask itself would wait for ever.
        """
        count = 0
        while count < WORKERLESS_S:
            with suppress(Empty):
                return ends.get(timeout=POLL_S)
            count = 0 if self.client.nthreads() else count + POLL_S
        raise OutputError(
            f"expected workers at the Dask scheduler {self.address}, got none for {WORKERLESS_S} "
            "s; start some, the same "
            "command then goes on from here"
        )

    def outcome(self, future: Any) -> tuple[Any, Exception | None]:
        """Return (result, error).

        Dask has tried a task whose worker died on other workers before it gives up with
        KilledWorker.
        """
        from distributed.scheduler import KilledWorker

        if future.status == "cancelled":
            raise OutputError(
                f"lost the Dask scheduler at {self.address}; the same command goes on from here"
            )
        if future.status == "error":
            error = future.exception()
            return None, WorkerLost("a worker process died") if isinstance(
                error, KilledWorker
            ) else error
        try:
            return future.result(timeout=WORKERLESS_S), None
        # the worker died before its result was fetched
        except (TimeoutError, CancelledError, KilledWorker):
            return None, WorkerLost("a worker process died with its result")

    def isolate(self) -> Dask:
        return Dask(self.address)

    def close(self) -> None:
        self.client.close()


Executor: TypeAlias = InProcess | Processes | Dask


def import_distributed() -> Any:
    """Import distributed. Raises InputError where it is missing."""
    return import_extra("distributed", "city", "--scheduler")


def make_executor(processes: int, scheduler: str | None = None) -> Executor:
    """Make the executor of the options."""
    if scheduler:
        return Dask(scheduler)
    return Processes(processes) if processes > 1 else InProcess()
