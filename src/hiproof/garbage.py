"""Python's collection of garbage, done seldom while a run imports and works.

Python looks for garbage after every 700 new objects, or 2,000. Importing makes hundreds of
thousands that stay, and a tenth of the CPU time of a short run was spent on looking through them.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

# New objects between two collections: some megabytes, and none while a command imports.
RARELY = 200_000


@contextmanager
def collect_rarely() -> Iterator[None]:
    """Collect garbage rarely in here, and as before afterwards."""
    thresholds = gc.get_threshold()
    gc.set_threshold(RARELY, *thresholds[1:])
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)


def leave_garbage() -> None:
    """Have Python end without a last collection, which takes a tenth of a short run."""
    gc.freeze()
