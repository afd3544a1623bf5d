"""Compiling before any work starts, in as many processes as cores.

Later runs only look at a mark.

The processes are fresh ones that run `warm_pieces`, one piece of the code after the other, so that
what pieces share of numba's own is compiled once a process: where they cannot be started, or one
fails, the functions are compiled when they are called. A mark a piece lies beside the compiled
code, and names the functions that were ready by then.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba
from llvmlite.binding import get_host_cpu_name

from ...compiled import find_dispatcher, kept, news
from ...compiled.stamp import PACKAGE, compute_common_stamp
from ...log import LOGGER
from .cores import cores


def make_ready(pieces: Sequence[str]) -> None:
    """Compile those of the `pieces` that no run compiled before.

    It takes a minute or so, which `news` reports.
    """
    missing = list_missing(pieces)
    stamp, places = compute_common_stamp(), list_places()
    folder = kept.place_to_write(places) if missing and find_dispatcher() else None
    # all is there, or nothing can be kept, so that every process has to compile anyway
    if folder is None:
        return
    kept.remove_outdated(folder, "warm", stamp)
    news.processes = min(cores(), len(missing))
    news.tell()
    remainder = iter(missing)

    def work_off() -> None:
        for piece in compiled_pieces(remainder):
            keep_mark(folder / mark(piece, stamp, read_processor()))

    with ThreadPoolExecutor(news.processes) as pool:
        for finished in [pool.submit(work_off) for _ in range(news.processes)]:
            finished.result()
    news.processes = 1


def list_missing(pieces: Sequence[str]) -> list[str]:
    """Return those of the `pieces` that no run compiled before.

    The functions of the others count as ready.
    """
    stamp = compute_common_stamp()
    missing = []
    for piece in pieces:
        name = mark(piece, stamp, read_processor())
        marks = [place / name for place in list_places()]
        if created := next(filter(Path.exists, marks), None):
            news.ready.update(created.read_text(encoding="utf-8", errors="replace").split())
        else:
            missing.append(piece)
    return missing


def list_places() -> tuple[Path, ...]:
    """Return the folders in which marks may lie."""
    return kept.list_folders(PACKAGE)


def keep_mark(file: Path) -> None:
    """Write the mark `file`: the functions that are ready.

    Where it cannot be written, the next run compiles the piece again.
    """
    try:
        file.write_text("\n".join(sorted(news.ready.copy())), encoding="utf-8")
    except OSError:  # a full disk, most of all
        with suppress(OSError):
            file.unlink()
        kept.warn_not_kept()


def compiled_pieces(remainder: Iterator[str]) -> Iterator[str]:
    """Compile pieces in a process while any remain.

    `remainder` is shared with other threads. Yields each that came to its end. The process'
    functions count as ready here too.
    """
    command = [sys.executable, "-m", "hiproof.city.work.warm_pieces"]
    pipes: dict[str, Any] = {
        "stdin": subprocess.PIPE,
        "stdout": subprocess.PIPE,
        "stderr": subprocess.DEVNULL,
    }
    try:
        with subprocess.Popen(command, text=True, bufsize=1, env=environment(), **pipes) as at_work:
            assert at_work.stdin and at_work.stdout
            for piece in remainder:
                print(piece, file=at_work.stdin)
                for line in map(str.strip, iter(at_work.stdout.readline, "")):
                    if line == piece:
                        yield piece
                    if line in (piece, news.FAILED):
                        break
                    news.ready.add(line)
                    news.tell()
                else:
                    raise OSError(f"the process ended while it compiled {piece}")
    except OSError as error:
        LOGGER.debug("not all could be compiled beforehand: %s", error)


def environment() -> dict[str, str]:
    """Return the environment of a compiling process.

    It has this process's places to import from.
    """
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


def read_processor() -> str:
    """Return the name of this machine's processor, or of the one numba is given."""
    return numba.config.CPU_NAME or get_host_cpu_name()


def mark(piece: str, stamp: str, processor: str) -> str:
    """Return the name of a piece's mark.

    Another state of any compiled source, another processor or Python has another.
    """
    return f"warm.{piece}.{processor}-{stamp}-run.{kept.PYTHON}.nbc"
