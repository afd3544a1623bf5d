"""`hiproof demo`: the main job on the bundled neighbourhood."""

from __future__ import annotations

from pathlib import Path

import typer

from ..city.run import Request
from .reconstruct import run_request


def run(folder: Path) -> int:
    from ..simulate import demo_files

    files = demo_files()
    request = Request(
        clouds=(str(files["cloud"]),),
        out=folder,
        footprints=str(files["footprints"]),
        terrain=str(files["terrain"]),
        restart=True,
    )
    code = run_request(request)
    if code == 0:
        typer.echo(f"look at them: hiproof view {folder}; a page about them: hiproof report {folder}")
    return code
