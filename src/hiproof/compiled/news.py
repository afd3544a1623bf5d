"""Progress of compiling, for whoever shows it to the user.

`listener` is called before and after a function is compiled, with the numbers of ready and of all
functions. Compiling takes a minute or so, once for each version, and silence would look like a
hang; where nobody listens the news goes into the log.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

from .stamp import count_compiled

# of one core, with everything that it stands on: 82 to 127 s for 315 of them
SECONDS_A_FUNCTION = 0.35

# functions that were compiled or loaded in this process, or by those that it started
ready: set[str] = set()
processes = 1  # that compile at the moment


def headline(finished: int, total: int) -> str:
    """Return a line on what is going on and how long it takes at most.

    >>> headline(20, 220)
    'compiling for this machine, once for each version: up to 200 functions, about 70 s'
    """
    number = total - finished
    seconds = 10 * -(-number * SECONDS_A_FUNCTION // (10 * processes))
    return (
        f"compiling for this machine, once for each version: up to {number} functions, about "
        f"{seconds:.0f} s"
    )


class Lines:
    """Progress as lines of the log: a headline, then a line at every further tenth."""

    def __init__(self, say: Callable[[str], None]):
        self.say = say
        self.due: float | None = None

    def __call__(self, done: int, total: int) -> None:
        if self.due is None:
            self.say(headline(done, total))
        elif done >= self.due:
            self.say(f"compiled {done} of about {total} functions")
        else:
            return
        self.due = done + max(1.0, total / 10)


listener: Callable[[int, int], None] = Lines(logging.getLogger("hiproof").info)


def tell() -> None:
    """Tell the listener how things stand."""
    listener(len(ready), max(count_compiled(), len(ready)))
