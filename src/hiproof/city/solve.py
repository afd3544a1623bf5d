"""Reconstruct the buildings of one work tile and leave their parts of the output files, ready to be joined."""

from __future__ import annotations

import functools
import pickle
import time
import traceback
from pathlib import Path

import numpy as np

from ..model import Building
from ..read.terrain import read_terrain, terrain_from_points
from ..reconstruct import reconstruct
from ..status import Status
from ..write.files import atomic
from .plan import Job, Plan, neighbourhood
from .sort import GROUND_REACH_M, load_points


@functools.lru_cache(maxsize=2)
def shared(folder: str, stamp: int) -> tuple[Plan, object]:
    """The plan and its terrain model, once a process (`stamp` is the plan file's time)."""
    plan = Plan.load(Path(folder) / "plan.pickle")
    return plan, read_terrain(plan.terrain) if plan.terrain else None


def solve_tile(folder: str, tile: str, avoid: tuple[int, ...] = ()) -> list[tuple]:
    """Reconstruct all buildings of `tile` and write its part file.

    `avoid` are the buildings that killed their worker before: they become internal errors without being tried again.
    Returns a row a building for the ledger: (position, id, status, type, detail, share, psd, seconds).
    """
    root = Path(folder)
    plan, terrain = shared(folder, (root / "plan.pickle").stat().st_mtime_ns)
    owner, roof, ground = load_points(root, tile)
    buildings, rows = [], []
    for index in plan.tiles[tile]:
        job, start = plan.jobs[index], time.perf_counter()
        if index in avoid:
            building = Building(job.id, Status.INTERNAL_ERROR, "the process died while it worked on this building")
        else:
            building = solve_one(plan, job, roof[owner == index], ground, terrain)
        buildings.append(building)
        rows.append(ledger_row(index, building, time.perf_counter() - start))
    with atomic(root / "tiles" / f"{tile}.pickle") as beside:
        Path(beside).write_bytes(pickle.dumps(buildings, protocol=5))
    return rows


def solve_one(plan: Plan, job: Job, points: np.ndarray, ground: np.ndarray, terrain: object) -> Building:
    """One building, whatever happens: an exception becomes its status."""
    try:
        if terrain is None and not job.area.is_empty:
            terrain = terrain_around(job, ground)
        return reconstruct(points, job.footprint, terrain, plan.settings, id=job.id)
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        detail = f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"
        attributes = job.footprint.attributes if job.footprint else {}
        return Building(job.id, Status.INTERNAL_ERROR, detail, attributes=attributes)


def terrain_around(job: Job, ground: np.ndarray) -> object | None:
    """Terrain from the ground points in the box around a building: the median height of each whole-metre cell."""
    xmin, ymin, xmax, ymax = neighbourhood(job, GROUND_REACH_M)
    x, y = ground[:, 0], ground[:, 1]
    near = ground[(x >= xmin) & (x < xmax) & (y >= ymin) & (y < ymax)]
    return terrain_from_points(cell_medians(near)) if len(near) else None


def cell_medians(points: np.ndarray, cell_m: float = 1.0) -> np.ndarray:
    """One point a world-aligned cell: its centre with the lower median height of the points (n, 3) in it.

    The answer does not depend on the order of the points.
    """
    cell = np.floor(points[:, :2] / cell_m)
    order = np.lexsort((points[:, 2], cell[:, 1], cell[:, 0]))
    cell, z = cell[order], points[order, 2]
    first = np.flatnonzero(np.r_[True, np.any(np.diff(cell, axis=0) != 0, axis=1)])
    last = np.r_[first[1:], len(z)] - 1
    return np.column_stack([(cell[first] + 0.5) * cell_m, z[(first + last) // 2]])


def ledger_row(position: int, building: Building, seconds: float) -> tuple:
    quality = building.quality
    share, psd = (float(v) if np.isfinite(v) else None for v in (quality.share_within_20cm, quality.psd_mean))
    return position, building.id, building.status.code, building.type, building.detail, share, psd, seconds
