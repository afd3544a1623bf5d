"""`hiproof edit`: a page to correct the buildings that need attention."""

from __future__ import annotations

import getpass
from pathlib import Path
from typing import Annotated

import click

from ..log import count_things
from ..progress import show_progress
from .parameters import Argument, Option


def edit(
    folder: Annotated[Path, Argument(help="output folder of a run")],
    who: Annotated[
        str | None, Option(help="name to keep with each edit (default: your user name)")
    ] = None,
    clouds: Annotated[
        Path | None,
        Option(
            is_folder=True,
            help="folder of the run's inputs, where they were moved since",
        ),
    ] = None,
    only: Annotated[
        str | None,
        Option(
            help="buildings to list: doubtful, no_points, changed, failed or ids, separated by "
            "commas (default: all)"
        ),
    ] = None,
    port: Annotated[
        int,
        Option(
            low=0,
            high=65535,
            shows_default=False,
            help="port on this machine (default: a free one)",
        ),
    ] = 0,
) -> None:
    """Open a page on this machine to check doubtful buildings and correct them.

    Accepted edits go into edits.jsonl in the folder. Pass that file to the next run with
    `--overrides`. Ctrl-C ends the page.
    """
    names = [name.strip() for name in only.split(",")] if only else []
    with show_progress("open"):
        from ..edit.desk import Desk
        from ..edit.edits import EDITS_FILE
        from ..edit.server import Server, Service

        service = Service(Desk(folder, who or user_name(), clouds, names))
    with Server(service, port) as server:
        desk = service.desk
        count = count_things(len(desk.select_rows()), "building")
        click.echo(f"{count}, the most doubtful first; edits go into {folder / EDITS_FILE}")
        if desk.points.missing:
            click.echo(desk.points.missing, err=True)
        click.echo(f"open {service.address}")
        server.serve_until_stopped()  # all that was accepted is on disk


def user_name() -> str:
    """Return the user's name, "somebody" where the system knows none."""
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):
        return "somebody"
