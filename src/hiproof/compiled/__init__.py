"""Compiled functions, kept on disk until one of their sources changes.

    @compiled
    def distance(points, planes): ...

numba's own cache looks at the file of the function alone, though functions and constants of other
files are compiled into it, and takes old code for new after an upgrade. Here code belongs to a
stamp of all its sources (stamp.py) and is kept under it (kept.py). Wheels and images carry code for
a kind of processors (kinds.py). Large functions are called, not copied (linking.py), kept ones are
loaded without a compiler (loading.py), and only functions that Python calls get a wrapper for that
(dispatcher.py). numba compiles with few of its passes (linking.py), looks up once what a sum of
numbers is (typing_memory.py), and counts few references (references.py). So compiled functions have
no closures, comprehensions or generators, and LLVM alone decides what is inlined. numba's runtime
is kept as well (runtime.py). Whoever wants to show that something is being compiled listens to
news.py.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any


def compiled(function: Callable | None = None, *, allocates: bool = True) -> Any:
    """Compile a function at the top of a module, and keep its code.

    Sums keep their order (no `fastmath`), so that every processor takes the same decisions.
    A division by zero gives infinity or NaN, as in NumPy. A function that makes no array and is
    called a million times says `allocates=False`: then it counts no references to those it reads,
    which cost a tenth of its time.

    >>> @compiled(allocates=False)
    ... def half(x):
    ...     return x / 2
    >>> half(3.0)
    1.5
    """
    if function is None:
        return functools.partial(compiled, allocates=allocates)
    import numba  # not before it is needed: the command line shows its help without

    # both only for what is compiled sooner
    options: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True}
    if not allocates:
        options["_nrt"] = False
    file = Path(function.__code__.co_filename)
    if numba.config.DISABLE_JIT or not file.is_file():
        return numba.njit(**options)(function)
    from .dispatcher import Dispatcher
    from .kept import Kept

    return Dispatcher(function, Kept(function, file), options)
