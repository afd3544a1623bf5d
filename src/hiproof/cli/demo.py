"""`hiproof demo`: the main job on the bundled neighbourhood."""

from __future__ import annotations

from pathlib import Path

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
    return run_request(request)
