"""How worker processes begin and end.

On Linux they are forked from one process that has imported what tasks need and does nothing else,
so that a worker begins in no time. Elsewhere each is spawned and imports by itself. None is forked
from the main process: that would copy locks of compiled code mid-flight.
"""

from __future__ import annotations

import functools
import gc
import os
import signal
import sys
import tempfile
import threading
import warnings
from collections.abc import Sequence
from contextlib import suppress
from multiprocessing import get_context, reduction, util
from multiprocessing.connection import Connection
from typing import Any

from ... import log
from ...errors import NotKeptWarning
from ...garbage import RARELY
from . import solved
from .cores import limit_threads
from .tasks import WORK

# Characters of the folder for temporary files. That of a socket, 35 more, may have at most 107.
LONGEST_FOLDER = 70
STREAMS = (1, 2)  # files of the standard output and of errors


def choose_context() -> Any:
    """Return the context of multiprocessing in which workers begin."""
    return get_context("forkserver" if start_server() else "spawn")


def start_server() -> bool:
    """Start the process from which workers are forked, if none runs.

    It imports while this process goes on. Return whether workers can be forked here.
    """
    if sys.platform != "linux" or len(tempfile.gettempdir()) > LONGEST_FOLDER:
        return False
    from multiprocessing import forkserver

    forkserver.set_forkserver_preload(list(WORK))
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # Ctrl-C is for this process
    try:
        with limit_threads():
            forkserver.ensure_running()
    except OSError:  # a sandbox without sockets, or a fork of a process that has its own
        return False
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    stop_server_at_exit()
    return True


@functools.cache
def stop_server_at_exit() -> None:
    """Let the process from which workers are forked end with this one."""
    util.Finalize(None, stop_server, exitpriority=-1)  # after the workers


def stop_server() -> None:
    """End the process from which workers are forked, and wait for it.

    So the system counts the time of workers as this process's.
    """
    from multiprocessing import forkserver

    if stop := getattr(forkserver._forkserver, "_stop", None):
        stop()


class StartState:
    """The environment and the output of the main process, for workers.

    They take it on when they receive it: the process from which they are forked may have begun
    with others.
    """

    def __reduce__(self) -> tuple:
        streams = []
        for number in STREAMS:
            with suppress(OSError):  # a closed one
                os.fstat(number)
                streams.append((number, reduction.DupFd(number)))
        with limit_threads():
            return take_on, (dict(os.environ), streams)


def take_on(environment: dict[str, str], streams: Sequence[tuple[int, Any]]) -> None:
    """Have the environment and the output of the main process."""
    os.environ.clear()
    os.environ.update(environment)
    for number, stream in streams:
        os.dup2(stream.detach(), number)


def describe_start(context: Any) -> StartState | None:
    """Return what workers of a context do not inherit."""
    return StartState() if context.get_start_method() == "forkserver" else None


def begin_worker(heard: Connection, state: StartState | None, logging: tuple, count: Any) -> None:
    """Set up a worker process, which has taken on the `state`.

    It logs as the main process does, counts buildings in memory that both share, and ends with it.

    That compiled code cannot be kept, the main process has said.
    """
    log.start(*logging)
    solved.begin_worker(count)
    gc.set_threshold(RARELY)
    warnings.simplefilter("ignore", NotKeptWarning)
    leave_with_parent(heard)


def leave_with_parent(heard: Connection) -> None:
    """Make a worker end when the main process closes the pipe, or is gone.

    A kill -9 of the main process leaves nothing running.

    Ctrl-C, which a terminal sends to all, is the main process's to answer.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent and not heard.poll(0.5):
            pass
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
