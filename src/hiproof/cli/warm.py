"""`hiproof warm`: compile what runs call, before anyone waits for it."""

from __future__ import annotations

from typing import Annotated

import typer


def warm(
    everything: Annotated[
        bool,
        typer.Option(
            "--all",
            help="also what only runs without footprints, with --parts one or the network call",
        ),
    ] = False,
) -> None:
    """Compile what runs call, once for each version, for this machine's own processor, so that the
    first run starts at once.
    """
    from ..city.tasks import ALL, MAIN_JOB, make_ready
    from .running import Bar

    with Bar():
        make_ready(ALL if everything else MAIN_JOB, own=True)
