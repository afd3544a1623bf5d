"""Stand-ins for `solve_tile` that worker processes can import: one that costs nothing, and some
that go wrong.
"""

import os
import signal
from functools import partial
from pathlib import Path

import numpy as np

from hiproof.city.plan.work_plan import make_jobs
from hiproof.city.work import solve
from hiproof.compiled import news
from hiproof.model import Building, Quality
from hiproof.read.outlines.footprints import read_footprints
from hiproof.status import Status
from hiproof.update.solve import update_tile

DEADLY = "house-2"
PRELOADED = ["planted", "hiproof.fit.roof", "distributed"]  # by the process that forks workers


def count_points(points, footprint, terrain, settings, id, ground=None, unused=None, neighbours=()):
    """No roof, but everything that a building's neighbours, tile or files could change: its points
    and its ground.
    """
    points = np.unique(points, axis=0)
    corner = np.array([footprint.polygon.bounds[:2]])
    ground = float(terrain.height_at(corner)[0])
    quality = Quality(points=len(points), rmse=float(points.sum()) if len(points) else float("nan"))
    return Building(
        id, Status.NO_POINTS, f"{len(points)} points", None, quality, ground, terrain.source
    )


def solve_with(reconstruct, folder, tile, terrain, avoid):
    original, solve.reconstruct = solve.reconstruct, reconstruct
    try:
        return solve.solve_tile(folder, tile, terrain, avoid)
    finally:
        solve.reconstruct = original


def solve_quickly(folder, tile, terrain=None, avoid=()):
    return solve_with(count_points, folder, tile, terrain, avoid)


def solve_spoilt(spoil, folder, tile, terrain, avoid):
    """Count the points of all buildings, and do to the process what comes with the deadly one."""

    def reconstruct(points, footprint, terrain, settings, id, *rest, **named):
        if id == DEADLY:
            spoil()
        return count_points(points, footprint, terrain, settings, id)

    return solve_with(reconstruct, folder, tile, terrain, avoid)


def die():
    os.kill(os.getpid(), signal.SIGKILL)


def die_once(folder):
    """Die as if killed from outside, once a run."""
    mark = Path(folder) / "killed"
    if not mark.exists():
        mark.touch()
        die()


def eat_memory():
    """Want more memory than the worker may have."""
    import resource  # Windows has none

    limits = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (4 << 30, limits[1]))
    try:
        np.ones(1 << 30)
    finally:
        resource.setrlimit(resource.RLIMIT_AS, limits)


def solve_killed_once(folder, tile, terrain=None, avoid=()):
    return solve_spoilt(partial(die_once, folder), folder, tile, terrain, avoid)


def solve_deadly(folder, tile, terrain=None, avoid=()):
    return solve_spoilt(die, folder, tile, terrain, avoid)


def solve_hungry(folder, tile, terrain=None, avoid=()):
    return solve_spoilt(eat_memory, folder, tile, terrain, avoid)


def read_jobs_from(path):
    """A stand-in for reading footprints that takes those of `path`, whatever the address."""
    return lambda *_: (make_jobs(read_footprints(path)), (), None)


def solve_without_compiling(folder, tile, terrain=None, avoid=()):
    """The real work, refusing to compile anything."""

    def refuse(finished, total):
        raise AssertionError("a worker had to compile")

    news.listener = refuse
    return solve.solve_tile(folder, tile, terrain, avoid)


def kill_once_and_update(folder, tile, terrain=None, avoid=()):
    """The worker that comes first is killed, as if from outside."""
    die_once(folder)
    return update_tile(folder, tile, terrain, avoid)
