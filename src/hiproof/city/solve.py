"""Reconstruct the buildings of one work tile and leave their parts of the output files, ready to be joined."""

from __future__ import annotations

import functools
import pickle
import time
import traceback
from pathlib import Path

import numpy as np

from ..model import Building
from ..read.terrain import Terrain, TerrainChain, lowest_points, read_terrain, terrain_from_points
from ..reconstruct import reconstruct
from ..stages import distinct
from ..status import Status
from ..write.files import atomic_file
from .plan import Job, Plan, neighbourhood
from .sort import GROUND_REACH_M, load_points


@functools.lru_cache(maxsize=2)
def shared(folder: str, stamp: int) -> tuple[Plan, Terrain | None]:
    """The plan and its terrain model, once a process (`stamp` is the plan file's time)."""
    plan = Plan.load(Path(folder) / "plan.pickle")
    return plan, read_terrain(plan.terrain, plan.crs()) if plan.terrain else None


def solve_tile(folder: str, tile: str, avoid: tuple[int, ...] = ()) -> list[tuple]:
    """Reconstruct all buildings of `tile` and write its part file.

    `avoid` are the buildings that killed their worker before: they become internal errors without being tried again.
    Returns a row a building for the ledger: (position, id, status, type, detail, share, psd, seconds).
    """
    root = Path(folder)
    plan, terrain = shared(folder, (root / "plan.pickle").stat().st_mtime_ns)
    points = load_points(root, tile)
    owner = points["roof"][:, 3]
    buildings, rows = [], []
    for index in plan.tiles[tile]:
        job, start = plan.jobs[index], time.perf_counter()
        if index in avoid:
            building = Building(job.id, Status.INTERNAL_ERROR, "the process died while it worked on this building")
        else:
            building = solve_one(plan, job, points["roof"][owner == index, :3], points, terrain)
        buildings.append(building)
        rows.append(ledger_row(index, building, time.perf_counter() - start))
    with atomic_file(root / "tiles" / f"{tile}.pickle") as file:
        pickle.dump(buildings, file, protocol=5)
    return rows


def solve_one(plan: Plan, job: Job, roof: np.ndarray, around: dict[str, np.ndarray], model: Terrain | None) -> Building:
    """One building, whatever happens: an exception becomes its status."""
    try:
        terrain = None if job.area.is_empty else terrain_around(job, around, model)
        return reconstruct(roof, job.footprint, terrain, plan.settings, id=job.id)
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        detail = f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"
        attributes = job.footprint.attributes if job.footprint else {}
        return Building(job.id, Status.INTERNAL_ERROR, detail, footprint=job.area, attributes=attributes)


def terrain_around(job: Job, around: dict[str, np.ndarray], model: Terrain | None) -> TerrainChain:
    """The terrain model, else the ground points in the whole-metre box around the building, else the lowest points."""
    xmin, ymin, xmax, ymax = neighbourhood(job, GROUND_REACH_M)
    ground, low = (
        points[(points[:, :2] >= (xmin, ymin)).all(axis=1) & (points[:, :2] < (xmax, ymax)).all(axis=1)]
        for points in (around["ground"], around["low"])
    )
    # a point that stands in two overlapping files counts once
    ground = distinct(ground)
    found = [model, terrain_from_points(ground) if len(ground) else None, lowest_points(low) if len(low) else None]
    return TerrainChain(found)


def ledger_row(position: int, building: Building, seconds: float) -> tuple:
    quality = building.quality
    share, psd = (float(v) if np.isfinite(v) else None for v in (quality.share_within_20cm, quality.psd_mean))
    return position, building.id, building.status.code, building.type, building.detail, share, psd, seconds
