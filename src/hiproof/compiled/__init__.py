"""Compiled functions, kept on disk until one of their sources changes.

    @compiled
    def distance(points, planes): ...

numba's own cache looks at the file of the function alone, though functions and constants of other
files are compiled into it, and takes old code for new after an upgrade. Here code belongs to a
stamp of all its sources (stamp.py) and is kept under it (kept.py). Large functions are called, not
copied, and only functions that Python calls get a wrapper for that (dispatcher.py, the one file
that uses numba beyond `njit`). Whoever wants to show that something is being compiled listens to
news.py.
"""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import NotKeptWarning


def compiled(function: Callable) -> Any:
    """Compile a function at the top of a module, and keep its code.

    Sums keep their order (no `fastmath`), so that every processor takes the same decisions.
    A division by zero gives infinity or NaN, as in NumPy.

    >>> @compiled
    ... def half(x):
    ...     return x / 2
    >>> half(3.0)
    1.5
    """
    import numba  # not before it is needed: the command line shows its help without

    has_file = Path(function.__code__.co_filename).is_file()
    if has_file and not numba.config.DISABLE_JIT and (keep := find_dispatcher()):
        return keep(function)
    return numba.njit(error_model="numpy")(function)


@functools.cache
def find_dispatcher() -> Callable | None:
    """Return the dispatcher that keeps code; None, with a warning, if numba lacks what it needs."""
    try:
        from .dispatcher import Dispatcher
    except (ImportError, AttributeError) as error:
        warnings.warn(
            f"expected a release of numba that hiproof was tested with, got another one ({error}); "
            "compiled functions cannot be kept, and every process compiles for minutes until you "
            "install one of the releases that hiproof's package names",
            NotKeptWarning,
            stacklevel=2,
        )
        return None
    return Dispatcher
