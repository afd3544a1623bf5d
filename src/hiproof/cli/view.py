"""`hiproof view`: the models of a run in the browser."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from ..errors import OutputError
from ..formats import FORMATS
from ..log import LOGGER
from .convert import convert_models


def view(
    folder: Annotated[
        Path,
        typer.Argument(help="output folder of a run, or a folder of 3D Tiles that hiproof wrote"),
    ],
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="port on this machine (default: a free one)")
    ] = 0,
    browser: Annotated[
        bool, typer.Option(help="open the browser; otherwise only print the address")
    ] = True,
) -> None:
    """Show the models of a run in your browser, without a network.

    hiproof makes 3D Tiles of them first. Click a building to see its attributes. Ctrl-C ends the
    page.
    """
    import webbrowser

    from ..view.server import make_server

    with (
        open_tiles(folder) as tiles,
        make_server(tiles, f"hiproof: {folder.resolve().name}", port) as server,
    ):
        typer.echo(f"{server.address} shows {folder}; Ctrl-C ends")
        if browser:
            webbrowser.open(server.address)
        server.serve_until_stopped()


@contextmanager
def open_tiles(folder: Path) -> Iterator[Path]:
    """Yield the tiles in a folder, or those of the run in it.

    They are made where they are missing or older than the models.

    Where the folder cannot be written, they are made in a temporary one, which goes when the block
    ends.
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
                convert_models(folder, tiles, "3dtiles")
            except OutputError as error:
                LOGGER.warning("%s. The tiles are made in a temporary folder instead", error)
                tiles = Path(elsewhere) / tiles.name
                convert_models(folder, tiles, "3dtiles")
        yield tiles
