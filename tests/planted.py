"""Stand-ins for `solve_tile` that worker processes can import: one that costs nothing, and some
that go wrong.
"""

import os
import signal
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


def solve_killed_once(folder, tile, terrain=None, avoid=()):
    """The worker that first comes to the deadly building is killed, as if from outside."""

    def reconstruct(
        points, footprint, terrain, settings, id, ground=None, unused=None, neighbours=()
    ):
        mark = Path(folder) / "killed"
        if id == DEADLY and not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return count_points(points, footprint, terrain, settings, id)

    return solve_with(reconstruct, folder, tile, terrain, avoid)


def solve_deadly(folder, tile, terrain=None, avoid=()):
    """One building kills every worker that tries it."""

    def reconstruct(
        points, footprint, terrain, settings, id, ground=None, unused=None, neighbours=()
    ):
        if id == DEADLY:
            os.kill(os.getpid(), signal.SIGKILL)
        return count_points(points, footprint, terrain, settings, id)

    return solve_with(reconstruct, folder, tile, terrain, avoid)


def solve_hungry(folder, tile, terrain=None, avoid=()):
    """One building wants more memory than the worker may have."""

    def reconstruct(
        points, footprint, terrain, settings, id, ground=None, unused=None, neighbours=()
    ):
        if id == DEADLY:
            import resource  # Windows has none

            limits = resource.getrlimit(resource.RLIMIT_AS)
            resource.setrlimit(resource.RLIMIT_AS, (4 << 30, limits[1]))
            try:
                np.ones(1 << 30)
            finally:
                resource.setrlimit(resource.RLIMIT_AS, limits)
        return count_points(points, footprint, terrain, settings, id)

    return solve_with(reconstruct, folder, tile, terrain, avoid)


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
    mark = Path(folder) / "killed"
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return update_tile(folder, tile, terrain, avoid)
