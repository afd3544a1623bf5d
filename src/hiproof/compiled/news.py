"""News of compiling, for whoever wants to show it: how many functions there are, and how many are ready."""

from __future__ import annotations

from collections.abc import Callable

known: set[str] = set()  # all functions that would be compiled when called
ready: set[str] = set()  # those that have been compiled or loaded
news: Callable[[int, int], None] | None = None  # called with (ready, known) before and after a function is compiled


def tell() -> None:
    if news is not None:
        news(len(ready), len(known))
