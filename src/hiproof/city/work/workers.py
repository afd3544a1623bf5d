"""How worker processes begin and end.

Each is spawned and imports by itself. None is forked from the main process: that would copy locks
of compiled code mid-flight.
"""

from __future__ import annotations

import gc
import os
import signal
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any

from ... import log
from ...errors import NotKeptWarning
from ...garbage import RARELY
from . import solved


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
    """Set up a worker process.

    It logs as the main process does and counts buildings in memory that both share. It ends when
    the main process closes the pipe, or is gone: a kill -9 of that leaves nothing running.

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
