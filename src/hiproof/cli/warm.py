"""`hiproof warm`: compile what runs call, before anyone waits for it."""

from __future__ import annotations

from ..city.tasks import ALL, MAIN_JOB, make_ready
from .reconstruct import Bar


def run(everything: bool) -> int:
    with Bar():
        make_ready(ALL if everything else MAIN_JOB)
    return 0
