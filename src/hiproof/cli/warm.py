"""`hiproof warm`: compile what runs call, before anyone waits for it."""

from __future__ import annotations

import click

from ..progress import show_progress


def warm(*, everything: bool = False) -> None:
    """Compile for the processor of this machine, so that the first run starts at once.

    This takes a minute or two, once for each version.
    """
    from ..city.work.tasks import MAIN_JOB, WITHOUT_FOOTPRINTS
    from ..city.work.warm import make_ready

    with show_progress("compile"):
        make_ready(WITHOUT_FOOTPRINTS if everything else MAIN_JOB)
    click.echo("everything is compiled" if everything else "all that most runs use is compiled")
