"""`hiproof view`: the models of a run in the browser."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import click

from ..errors import OutputError
from ..formats import FORMATS
from ..log import LOGGER
from ..progress import Update, ignore_progress, show_progress
from .convert import convert_models


def view(folder: Path, *, port: int = 0, browser: bool = True) -> None:
    """Show the models of a run in your browser, without a network.

    hiproof makes 3D Tiles of them first. Click a building to see its attributes. Ctrl-C ends the
    page.
    """
    import webbrowser

    with ExitStack() as stack:
        with show_progress("open") as update:
            from ..view.server import make_server

            tiles = stack.enter_context(open_tiles(folder, update))
            title = f"hiproof: {folder.resolve().name}"
            server = stack.enter_context(make_server(tiles, title, port))
        click.echo(f"{server.address} shows {folder}; Ctrl-C ends")
        if browser:
            webbrowser.open(server.address)
        server.serve_until_stopped()


@contextmanager
def open_tiles(folder: Path, update: Update = ignore_progress) -> Iterator[Path]:
    """Yield the tiles in a folder, or those of the run in it.

    They are made where they are missing or older than the models. Where the folder cannot be
    written, they are made in a temporary one, which goes when the block ends.
    """
    from ..evaluate.models import run_models
    from ..write.meshes.tiles.tileset import TILESET

    if (folder / TILESET).is_file():
        yield folder
        return
    tiles, models = folder / FORMATS["3dtiles"].file, run_models(folder)
    with tempfile.TemporaryDirectory(prefix="hiproof-view-") as elsewhere:
        if (
            not (tiles / TILESET).is_file()
            or (tiles / TILESET).stat().st_mtime < models.stat().st_mtime
        ):
            try:
                text = make_tiles(folder, tiles, update)
            except OutputError as error:
                LOGGER.warning("%s. The tiles are made in a temporary folder instead", error)
                tiles = Path(elsewhere) / tiles.name
                text = make_tiles(folder, tiles, update)
            click.echo(text)
        yield tiles


def make_tiles(folder: Path, tiles: Path, update: Update) -> str:
    """Make the tiles of the run in a folder, about their own middle; returns a line on it."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module=r"hiproof\.write\.meshes\.tiles")
        return convert_models(folder, tiles, "3dtiles", None, update)[0]
