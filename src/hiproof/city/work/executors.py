"""Executors, where tasks run: this process, processes of this machine, or a Dask cluster.

One verb: `run`.

`prepare()` comes first: compiled code is made before the work starts, so that no two workers
make the same. `run(function, tasks)` yields (task, result, error) as tasks finish, in any order. A
worker that dies does not end the run: its tasks come back with a `WorkerLost`, and the caller
decides whether to try them again. `isolated()` is an executor whose worker's death harms nobody
else. Tasks are taken from their iterable only when a worker is near.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any, TypeAlias
from urllib.parse import urlsplit

from ...compiled import news
from ...compiled.stamp import count_compiled
from ...errors import InputError, OutputError, raise_interrupt
from ...extras import import_extra
from .processes import Processes, hand_out
from .tasks import TaskOutcome, WorkerLost
from .warm import make_ready

CONNECT_S = 20  # seconds for an answer of the scheduler
# seconds without a worker until a run gives up; seconds between looks at what is done
WORKERLESS_S, POLL_S = 300, 5


class InProcess:
    """One task after the other in this process."""

    def prepare(self) -> None:
        make_ready()

    def run(self, function: Callable, tasks: Iterable[tuple]) -> Iterator[TaskOutcome]:
        for task in tasks:
            try:
                yield task, function(*task), None
            except Exception as error:
                raise_interrupt(error)
                yield task, None, error

    def isolate(self) -> Executor:
        return Processes(1)

    def close(self) -> None:
        pass


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

    def prepare(self) -> None:
        """Compile in one worker of each host, then load in the others.

        A host that joins later has to compile while it works.
        """
        one_of_each = {urlsplit(address).hostname: address for address in self.client.nthreads()}
        ends: SimpleQueue = SimpleQueue()
        tasks = [
            self.submit(ends, make_ready, (), workers=[address], allow_other_workers=True)
            for address in one_of_each.values()
        ]
        patience = threading.Timer(POLL_S, news.listener, (0, count_compiled()))
        patience.start()
        try:
            for _ in tasks:
                self.outcome(self.next_end(ends))
        finally:
            patience.cancel()

    def run(self, function: Callable, tasks: Iterable[tuple]) -> Iterator[TaskOutcome]:
        return hand_out(self, function, tasks)

    def count_workers(self) -> int:
        return sum(self.client.nthreads().values())

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
            "s; start some, the same command then goes on from here"
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
