"""What is to be done: the buildings asked for, the work tile that owns each, and the point files."""

from __future__ import annotations

import hashlib
import json
import math
import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from .. import __version__
from ..errors import InputError
from ..model import Footprint
from ..settings import Settings


@dataclass(frozen=True)
class Job:
    """One building asked for. `area` is the plan polygon whose points belong to it (world); `footprint` None: estimate."""

    index: int
    id: str
    area: shapely.Polygon
    footprint: Footprint | None


@dataclass(frozen=True)
class Plan:
    """Everything a worker needs to know; pickled once into the run's folder."""

    clouds: tuple[str, ...]
    jobs: tuple[Job, ...]
    tiles: dict[str, tuple[int, ...]]
    crs_wkt: str | None
    terrain: str | None
    settings: Settings
    fingerprint: str

    def crs(self) -> Any:
        """The output's reference system, None where no input names one."""
        from pyproj import CRS

        return CRS.from_wkt(self.crs_wkt) if self.crs_wkt else None

    def save(self, path: Path) -> None:
        path.write_bytes(pickle.dumps(self, protocol=5))

    @staticmethod
    def load(path: Path) -> Plan:
        return pickle.loads(path.read_bytes())


def cut_into_tiles(jobs: tuple[Job, ...], tile_m: float, most: int) -> dict[str, tuple[int, ...]]:
    """Work tiles by name: the buildings whose area starts in the same square, at most `most` in a tile.

    A building belongs to the square of its lower left corner, so ownership needs no geometry and has no ties.
    """
    squares: dict[tuple[int, int], list[int]] = {}
    for job in jobs:
        x, y = (0.0, 0.0) if job.area.is_empty else job.area.bounds[:2]
        squares.setdefault((math.floor(x / tile_m), math.floor(y / tile_m)), []).append(job.index)
    tiles = {}
    for (column, row), members in sorted(squares.items()):
        for number, start in enumerate(range(0, len(members), most)):
            tiles[f"{column}_{row}_{number}"] = tuple(members[start : start + most])
    return tiles


def fingerprint(clouds: tuple[str, ...], footprints: str | None, terrain: str | None, settings: Settings) -> str:
    """A digest of inputs, settings and version: a run continues only where all of them are the same."""
    stamps: list[Any] = [__version__, settings.to_dict()]
    for name in (*clouds, footprints, terrain):
        path = Path(name) if name else None
        stat = path.stat() if path is not None and path.is_file() else None
        stamps.append([str(name), stat.st_size if stat else None, stat.st_mtime_ns if stat else None])
    return hashlib.sha256(json.dumps(stamps, sort_keys=True).encode()).hexdigest()


def jobs_of_footprints(footprints: tuple[Footprint, ...]) -> tuple[Job, ...]:
    """One job a footprint, in the order of the file."""
    if not footprints:
        raise InputError("expected at least one polygon in the footprints, got none; check the file and its layer")
    return tuple(Job(i, f.id, f.polygon, f) for i, f in enumerate(footprints))


def neighbourhood(job: Job, reach_m: float) -> np.ndarray:
    """Box (xmin, ymin, xmax, ymax) around a job's area in which terrain points matter, on whole metres of the world.

    Whole metres keep the terrain cells of a building the same whatever tile it is computed in.
    """
    xmin, ymin, xmax, ymax = job.area.bounds
    return np.array(
        [math.floor(xmin - reach_m), math.floor(ymin - reach_m), math.ceil(xmax + reach_m), math.ceil(ymax + reach_m)],
        float,
    )
