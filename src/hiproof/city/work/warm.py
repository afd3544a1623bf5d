"""Compile what runs call before they start, in two processes, so that no two workers do.

    python -m hiproof.city.work.warm roof  # prints the names of functions as they become ready

One process draws a roof that was not searched, and the other calls all that runs call, what draws
roofs at last: by then the first has compiled it. Where they cannot be started, or one fails,
functions are compiled when they are called.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numba
import numpy as np
import shapely
from llvmlite.binding import get_host_cpu_name

from ...compiled import find_dispatcher, news
from ...compiled.kept import Kept, place_to_write
from ...compiled.stamp import compute_common_stamp
from ...garbage import RARELY
from ...log import LOGGER
from ...settings import Settings
from .cores import cores

HALVES = ("roof", "all")
HALL = shapely.box(0.0, 0.0, 60.0, 6.0)


def make_ready() -> None:
    """Compile what runs call, which takes a minute or so, unless a run did so before.

    A file beside the compiled code says so, for one state of the sources and one processor. It
    names the functions, which count as ready.
    """
    mark = Kept(
        Path(__file__), numba.config.CPU_NAME or get_host_cpu_name(), compute_common_stamp()
    )
    for (names,) in mark.read("", ()):
        news.ready.update(names)
        return
    # where nothing can be kept, every process has to compile anyway
    if find_dispatcher() and place_to_write(mark.folders) and compile_halves():
        mark.write("", (), sorted(news.ready))


def compile_halves() -> bool:
    """Return whether both processes came to their end; what they compiled counts as ready."""
    news.processes = min(cores(), len(HALVES))
    news.tell()
    reader, writer = os.pipe()
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    try:
        processes = [
            subprocess.Popen(
                [sys.executable, "-m", __name__, half],
                stdout=writer,
                stderr=subprocess.DEVNULL,
                env=environment,
            )
            for half in HALVES
        ]
    except OSError as error:
        news.processes = 1
        LOGGER.debug("nothing could be compiled beforehand: %s", error)
        return False
    finally:
        os.close(writer)
    with open(reader, encoding="utf-8") as lines:
        for line in lines:
            news.ready.update(line.split())
            news.tell()
    news.processes = 1
    return not any([process.wait() for process in processes])


def compile_half(half: str) -> None:
    """Call what runs call, on houses so small that compiling is all that takes time."""
    from ...fit.layout.outline import draw_outline
    from ...fit.layout.plan import lay_out_plan
    from ...fit.layout.scene import open_window
    from ...fit.layout.whole import lay_out_whole
    from ...fit.roof import read_parts
    from ...fit.roof.add import list_volumes
    from ...fit.roof.draft import make_draft
    from ...fit.roof.site import make_site
    from ...fit.roof.start import start_roof
    from ...fit.shapes.curved import fit_shapes
    from ...geometry.point_grid import PointGrid
    from ...method import reconstruct
    from ...simulate import random_compound, uniform_points
    from ...write.head import FileHead
    from ...write.run_files import fragments

    rng = np.random.default_rng(0)
    house = random_compound(rng, "dormered")
    outline, points = house.footprint, uniform_points(house, rng)
    settings = Settings().replace({"reconstruct": {"align": "off"}})
    wholes = []
    for xyz, polygon in ((points, outline), (make_hall(), HALL)):
        plan = lay_out_plan(xyz, polygon)
        wholes.append(lay_out_whole(plan, polygon, settings.compound))
    site = make_site(wholes[0])
    if half == "roof":
        draft = make_draft(start_roof(wholes[0], site), site)
        draft.improve()
        parts = read_parts(draft.roof, draft.site, wholes[0].outline, wholes[0].plan, ())
        fit_shapes(parts, points, outline, settings)
        return
    if (scene := open_window(wholes[0], wholes[0].box, len(points))) is not None:
        list(list_volumes(start_roof(wholes[0], site), scene))
    PointGrid(points).inside(outline)
    network = "auto" if find_spec("onnxruntime") else "never"
    one = Settings().replace({"fit": {"parts": "one"}, "segment": {"network": network}})
    reconstruct(points, settings=one)
    moved = shapely.transform(outline, lambda xy: xy + 1.0)
    fragments(reconstruct(points, moved, settings=one), ("a", "a"), FileHead(offset=np.zeros(3)))
    draw_outline(points)
    reconstruct(points, outline, settings=settings)
    reconstruct(make_hall(), HALL, settings=settings)


def make_hall() -> np.ndarray:
    """Return more points (n, 3) than the search takes, of a level roof with a row of boxes."""
    x, y = (axis.ravel() for axis in np.mgrid[0.2:60.0:0.4, 0.2:6.0:0.4])
    return np.column_stack([x, y, np.where((x % 5 < 2) & (y % 5 < 2), 6.0, 5.0)])


def main(half: str) -> None:
    """Compile a half, and print the names of functions, a line each, as they become ready."""
    printed: set[str] = set()

    def tell(*_: int) -> None:
        print(*sorted(news.ready - printed), sep="\n", flush=True)
        printed.update(news.ready)

    news.listener = tell
    gc.set_threshold(RARELY)
    compile_half(half)
    tell()


if __name__ == "__main__":
    main(sys.argv[1])
