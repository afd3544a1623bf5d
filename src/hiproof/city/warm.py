"""Compile before the workers start, in one process: all of them would else compile the same functions at the same time.

What a run calls is compiled by running: the bundled neighbourhood, with all roof types and compounds in it, goes down the
whole road from points to files. A mark beside the compiled code tells later runs that there is nothing to do.
"""

from __future__ import annotations

import tempfile
import warnings
from pathlib import Path

from ..compiled import kept
from ..compiled.stamp import PACKAGE, stamp_of_all
from ..errors import InputWarning
from ..log import without_progress


def make_ready(scratch: Path | None = None) -> None:
    """Compile what a run with default settings calls, unless that was done before: minutes, of which `news` tells.

    `scratch`: where temporary files go, else where the system has them.
    """
    places = kept.folders(make_ready, str(PACKAGE / "__init__.py"))
    if any((place / mark()).exists() for place in places):
        return
    folder = kept.place_to_write(places)
    if folder is None:  # nothing can be kept, so every worker has to compile anyway
        return
    run_neighbourhood(scratch)
    (folder / mark()).touch()
    kept.remove_outdated(folder, "warm", stamp_of_all())


def mark() -> str:
    """The name of the mark: another state of any compiled source, another processor or Python has another."""
    from llvmlite.binding import get_host_cpu_name

    return f"warm.{get_host_cpu_name()}-{stamp_of_all()}-run.{kept.PYTHON}.nbc"


def run_neighbourhood(scratch: Path | None) -> None:
    """The whole road in this process, with all inputs and with the points alone; what comes out is thrown away."""
    from ..simulate import demo_files
    from .run import Request, reconstruct_area

    files = {name: str(path) for name, path in demo_files().items()}
    for footprints, terrain in ((files["footprints"], files["terrain"]), (None, None)):
        with tempfile.TemporaryDirectory(dir=scratch) as out, without_progress(), warnings.catch_warnings():
            warnings.simplefilter("ignore", InputWarning)
            reconstruct_area(Request((files["cloud"],), Path(out), footprints, terrain))
