"""Buildings counted as they are solved, for the progress of a run.

Tasks last minutes. A worker process counts in memory that it shares with the main process, and
without a lock, which a worker that dies would hold for ever. A building that two workers count at
once may be missed until its task ends.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

shared: Any = None  # the count of this worker process and its siblings, None in the main process


def ignore(count: int) -> None:
    """Take no notice of buildings that are solved."""


listener: Callable[[int], None] = ignore


def count_building() -> None:
    """Count a building that was solved in this process."""
    if shared is None:
        listener(1)
    else:
        shared.value += 1
