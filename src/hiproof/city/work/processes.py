"""The executor of worker processes on this machine: see executors.py."""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.sharedctypes import RawValue
from queue import Empty, SimpleQueue
from typing import Any

from ... import log
from ...errors import NotKeptWarning
from ...garbage import RARELY
from . import solved
from .cores import limit_threads
from .tasks import TaskOutcome, WorkerLost
from .warm import make_ready

MOST_ON_WINDOWS = 61  # processes that one can wait for there
COUNT_S = 0.5  # seconds between looks at how many buildings the workers of this machine have solved


class Processes:
    """`count` worker processes.

    See `begin_worker` for how they begin.
    """

    def __init__(self, count: int):
        self.count = min(count, MOST_ON_WINDOWS) if sys.platform == "win32" else count
        self.pool: ProcessPoolExecutor | None = None
        self.word: Connection | None = None
        self.count_solved = RawValue("q", 0)  # by all workers, shared with them
        self.told = 0

    def prepare(self) -> None:
        """Compile what no run compiled before."""
        make_ready()

    def run(self, function: Callable, tasks: Iterable[tuple]) -> Iterator[TaskOutcome]:
        try:
            yield from hand_out(self, function, tasks)
        # Ctrl-C, most of all: nobody waits any more for what the workers are at
        except BaseException:
            if self.word is not None:
                self.word.close()
            raise

    def count_workers(self) -> int:
        return self.count

    def submit(self, ends: SimpleQueue, function: Callable, task: tuple) -> Future:
        """Submit a task, and return a future that goes into `ends` when it ends."""
        if self.pool is None:
            context = get_context("spawn")
            heard, self.word = context.Pipe(duplex=False)
            arguments: Any = (heard, log.worker_arguments(), self.count_solved)
            self.pool = ProcessPoolExecutor(
                self.count, mp_context=context, initializer=begin_worker, initargs=arguments
            )
        try:
            with limit_threads(), start_deaf():
                future = self.pool.submit(function, *task)
        except BrokenProcessPool:  # a worker died, and the pool with it
            self.close()
            return self.submit(ends, function, task)
        future.add_done_callback(ends.put)
        return future

    def next_end(self, ends: SimpleQueue) -> Future:
        """Return the next future that ends, and tell how many more buildings are solved."""
        future = None
        while future is None:
            with suppress(Empty):
                future = ends.get(timeout=COUNT_S)
            number = self.count_solved.value - self.told
            if number > 0:
                self.told += number
                solved.listener(number)
        return future

    def outcome(self, future: Future) -> tuple[Any, Exception | None]:
        """Return (result, error)."""
        error: Any = future.exception()
        if isinstance(error, BrokenProcessPool):
            error = WorkerLost("a worker process died")
        return None if error else future.result(), error

    def isolate(self) -> Processes:
        return Processes(1)

    def close(self) -> None:
        if self.pool is not None:
            self.pool.shutdown(wait=True, cancel_futures=True)
            self.pool = None


def hand_out(workers: Any, function: Callable, tasks: Iterable[tuple]) -> Iterator[TaskOutcome]:
    """Run tasks on `workers`, Processes or Dask, and yield their outcomes as they end."""
    waiting = iter(tasks)
    running: dict[Any, tuple] = {}
    ends: SimpleQueue = SimpleQueue()
    while True:
        # two tasks a worker in the queue: enough to keep it busy, few enough to lose little when
        # one dies
        most = max(2 * workers.count_workers(), 2)
        while len(running) < most and (task := next(waiting, None)) is not None:
            running[workers.submit(ends, function, task)] = task
        if not running:
            return
        future = workers.next_end(ends)
        yield running.pop(future), *workers.outcome(future)


@contextmanager
def start_deaf() -> Iterator[None]:
    """Let processes started in here not hear Ctrl-C.

    A terminal sends it to all, but it is the main process's to answer.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def begin_worker(heard: Connection, logging: tuple, count: Any) -> None:
    """Set up a worker process, which logs as the main process does and ends with it.

    It counts buildings in memory that both share. It ends when the main process closes the pipe, or
    is gone: a kill -9 of that leaves nothing running.

    That compiled code cannot be kept, the main process has said.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    log.start(*logging)
    solved.shared = count
    gc.set_threshold(RARELY)
    warnings.simplefilter("ignore", NotKeptWarning)
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent and not heard.poll(0.5):
            pass
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
