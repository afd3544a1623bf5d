"""Compile before any work starts, in as many processes as there are cores; later runs only look at a mark.

The processes are fresh ones that run `warm_pieces` each for a piece of the code: where they cannot be started, or one
fails, the functions are compiled when they are called. A mark a piece lies beside the compiled code.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from ..compiled import kept, news
from ..compiled.stamp import PACKAGE, stamp_of_all
from ..log import LOGGER


def make_ready(pieces: Sequence[str]) -> None:
    """Compile those of the `pieces` that no run compiled before: a minute or so, of which `news` tells."""
    places = kept.folders(make_ready, str(PACKAGE / "__init__.py"))
    stamp = stamp_of_all()
    missing = [piece for piece in pieces if not any((place / mark(piece, stamp)).exists() for place in places)]
    folder = kept.place_to_write(places) if missing else None
    if folder is None:  # all is there, or nothing can be kept, so that every process has to compile anyway
        return
    kept.remove_outdated(folder, "warm", stamp)
    news.processes = min(cores(), len(missing))
    news.tell()
    with ThreadPoolExecutor(news.processes) as pool:
        for piece, ready in zip(missing, pool.map(compile_piece, missing), strict=True):
            if ready:
                (folder / mark(piece, stamp)).touch()
    news.processes = 1


def compile_piece(piece: str) -> bool:
    """Have a piece compiled by a process of its own, whose functions count as ready here too; whether it came to its end."""
    command = [sys.executable, "-m", "hiproof.city.warm_pieces", piece]
    silent: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    try:
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment(), **silent) as at_work:
            for line in at_work.stdout or ():
                news.ready.add(line.strip())
                news.tell()
    except OSError as error:
        LOGGER.debug("no process could be started to compile %s: %s", piece, error)
        return False
    if at_work.returncode:
        LOGGER.debug("compiling %s beforehand ended with exit code %d", piece, at_work.returncode)
    return at_work.returncode == 0


def environment() -> dict[str, str]:
    """This process's, with its places to import from."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


def cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def mark(piece: str, stamp: str) -> str:
    """The name of a piece's mark: another state of any compiled source, another processor or Python has another."""
    return f"warm.{piece}.{processor()}-{stamp}-run.{kept.PYTHON}.nbc"


def processor() -> str:
    """What is compiled for: this machine's processor, or the kind that numba's own variables name, which runs on several."""
    from llvmlite.binding import get_host_cpu_name

    return os.environ.get("NUMBA_CPU_NAME") or get_host_cpu_name()
