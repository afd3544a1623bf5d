"""The lock of a run's folder: one run at a time.

It ends with its process, however that ends.

SQLite does the locking, as it does for the ledger: the standard library's, one way on every system,
across processes and over network drives that know locks; a library for nothing but this would be
one dependency more. The lock has a file of its own, so that `hiproof status` still reads the
ledger.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from ...errors import OutputError


@contextmanager
def hold_folder(state: Path) -> Iterator[None]:
    """Hold the run's folder `state` for the block.

    Raises OutputError at once where another run holds it.
    """
    try:
        lock = sqlite3.connect(state / "lock.sqlite", isolation_level=None, timeout=0)
        lock.execute("begin exclusive")
    except sqlite3.Error as error:
        if error.sqlite_errorcode == sqlite3.SQLITE_BUSY:
            raise OutputError(
                f"expected {state.parent} for this run alone, got one that another run works in; "
                "wait for its end "
                "(`hiproof status` shows how far it is), or choose another --out"
            ) from None
        raise OutputError(
            f"expected to lock {state}, got: {error}; choose an --out that can be written, on a "
            "drive with locks"
        ) from error
    with closing(lock):
        yield
