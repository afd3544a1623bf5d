"""`hiproof warm`: compile what runs call, before anyone waits for it."""

from __future__ import annotations

import click

from ..progress import show_progress


def warm() -> None:
    """Compile for the processor of this machine, so that the first run starts at once.

    This takes a minute or two, once for each version.
    """
    from ..city.work.warm import make_ready

    with show_progress("compile"):
        make_ready()
    click.echo("all that most runs use is compiled")
