"""`hiproof edit`: a page to correct the buildings that need attention."""

from __future__ import annotations

import getpass
from pathlib import Path

import click

from ..log import count_things
from ..progress import show_progress


def edit(
    folder: Path,
    *,
    who: str | None = None,
    clouds: Path | None = None,
    only: str | None = None,
    port: int = 0,
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
