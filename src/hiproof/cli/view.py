"""`hiproof view`: the models of a run in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..formats import FORMATS


def view(
    folder: Annotated[Path, typer.Argument(help="output folder of a run, or a folder of 3D Tiles that hiproof wrote")],
    port: Annotated[int, typer.Option(min=0, max=65535, help="port on this machine [default: any that is free]")] = 0,
    browser: Annotated[bool, typer.Option(help="open the browser, or only tell the address")] = True,
) -> None:
    """Show the models of a run in the browser, without a network: 3D Tiles are made of them first, where they are not yet.

    Turn, zoom, click on a building for its attributes. Ctrl-C ends it.
    """
    import webbrowser

    from ..view.server import server_of

    with server_of(tiles_of(folder), f"hiproof: {folder.resolve().name}", port) as server:
        typer.echo(f"{server.address} shows {folder}; Ctrl-C ends")
        if browser:
            webbrowser.open(server.address)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            return


def tiles_of(folder: Path) -> Path:
    """The folder's own tiles, or those of the run in it, made where they are missing or older than the models."""
    from ..evaluate.models import run_models
    from ..write.tiles.tileset import TILESET
    from .convert import convert

    if (folder / TILESET).is_file():
        return folder
    tiles, models = folder / FORMATS["3dtiles"].file, run_models(folder)
    if not (tiles / TILESET).is_file() or (tiles / TILESET).stat().st_mtime < models.stat().st_mtime:
        convert(folder, tiles)
    return tiles
