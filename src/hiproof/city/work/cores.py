"""How many processes a run may take on this machine, and how many of them pay."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# A process takes a second to start, as long as 50 buildings with footprints or five of those that a
# cloud is split into, where blocks of houses are one and outlines are drawn. Delft's 160 on two
# cores: 6.6 s by one process, 5.4 by two, which took 1.2 s of CPU more.
BUILDINGS_A_PROCESS, SPLIT_A_PROCESS = 150, 20
QUOTA = Path(
    "/sys/fs/cgroup/cpu.max"
)  # of a container on Linux: microseconds of CPU in a period, or "max", and the period
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def cores() -> int:
    """Return the number of cores that this process may use.

    The system and the quota of its container limit it.
    """
    count = (
        len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    )
    try:
        quota, period = QUOTA.read_text(encoding="ascii").split()
        return max(1, min(count, round(int(quota) / int(period))))
    except (OSError, ValueError, ZeroDivisionError):
        return count


def as_many_as_pay(buildings: int, tiles: int, footprints: bool = True) -> int:
    """Return how many processes pay for so many buildings and work tiles.

    There are `footprints`, or buildings are split from the cloud.

    >>> as_many_as_pay(40, 3)
    1
    """
    count = min(
        cores(), tiles, buildings // (BUILDINGS_A_PROCESS if footprints else SPLIT_A_PROCESS)
    )
    return count if count > 1 and has_semaphores() else 1


def has_semaphores() -> bool:
    """Return whether processes can be handed work here.

    Sandboxes without shared memory lack what that takes.
    """
    from multiprocessing import get_context

    try:
        get_context("spawn").Semaphore()
        return True
    except (ImportError, OSError):
        return False


@contextmanager
def limit_threads() -> Iterator[None]:
    """Let processes started in here use one thread for linear algebra, unless the user set it."""
    own_names = [name for name in THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(own_names, "1"))
    try:
        yield
    finally:
        for name in own_names:
            os.environ.pop(name, None)
