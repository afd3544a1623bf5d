"""The roof points of one building, read from the run's clouds as its run read them."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ..city.plan.work_plan import PLAN_FILE, Job, WorkPlan
from ..city.work.noted import noted_file
from ..city.work.solve import terrain_model
from ..city.work.sort import Gatherer, Reaches, wanted_points
from ..city.work.surveys import SurveyPoints
from ..errors import HiproofError, InputError
from ..evaluate.inputs import found_inputs
from ..evaluate.run import run_record
from ..geometry.thin import thin_to_count
from ..parametric.record import read_outline
from ..read.terrain.raster import import_rasterio
from ..stages.points import distinct, usable
from ..write.files import STATE_FOLDER

# work tiles and buildings whose points stay in memory: those a person goes back and forth between
KEPT_TILES, KEPT_BUILDINGS = 3, 64


class RunPoints:
    """Points of the run in `folder`.

    Its files may have `moved_to` another. `missing` is a sentence where they cannot be had, empty
    otherwise.
    """

    def __init__(self, folder: Path, moved_to: Path | None = None) -> None:
        self.lock, self.missing = threading.Lock(), ""
        self.tile_points = lru_cache(maxsize=KEPT_TILES)(self.read_tile)
        self.of_job = lru_cache(maxsize=KEPT_BUILDINGS)(self.read_job)
        inputs = found_inputs(run_record(folder), moved_to)
        self.surveys, self.terrain = inputs.surveys, inputs.terrain
        self.state = folder / STATE_FOLDER
        plan = self.state / PLAN_FILE
        if not plan.is_file() or not (inputs.clouds or inputs.gone):
            self.missing = (
                "no run of `hiproof reconstruct` in this folder: its points are not known, "
                "refitting is off"
            )
        elif inputs.gone:
            self.missing = (
                f"{inputs.told_gone}: all but refitting works; say with --clouds FOLDER where they "
                "lie now"
            )
        elif inputs.terrain:
            self.missing = missing_reader()
        self.known = None if self.missing else WorkPlan.load(plan)
        jobs = self.known.jobs if self.known else ()
        self.jobs = {job.id: job for job in reversed(jobs)}
        tiles = self.known.tiles.items() if self.known else ()
        self.tile_of = {index: tile for tile, members in tiles for index in members}

    @property
    def plan(self) -> WorkPlan:
        """The run's. Raises InputError where there is none, or no cloud to read by it."""
        if self.known is None:
            raise InputError(self.missing)
        return self.known

    def of(self, record: Mapping[str, Any]) -> np.ndarray:
        """Return world points (n, 3) inside the outline of a building.

        `record` is its object of parameters.jsonl. (0, 3) where the run has none, or where its
        clouds cannot be read, which `missing` then says.
        """
        job, outline = self.jobs.get(record["id"]), read_outline(record)
        if job is None or outline is None or self.missing:
            return np.zeros((0, 3))
        try:
            with self.lock:  # one file is read once, however many windows ask
                result = self.of_job(job.index, tuple(record.get("epochs_used") or ()))
        except (HiproofError, OSError) as error:
            self.missing = explain_unreadable(error)
            return np.zeros((0, 3))
        return usable(result, outline)[0]

    def read_job(self, index: int, epochs: tuple[str, ...]) -> np.ndarray:
        """Return points (n, 3) around a building as a run uses, by survey for `epochs`."""
        job: Job = self.plan.jobs[index]
        surroundings = self.tile_points(self.tile_of[index]).choose({"epochs_used": epochs})
        points = surroundings.select_roof_points(surroundings.move(job)[0]).points
        max_points_a_building = self.plan.settings.city.max_points_a_building
        return (
            points
            if len(points) <= max_points_a_building
            else thin_to_count(distinct(points), max_points_a_building)
        )

    def read_tile(self, tile: str) -> SurveyPoints:
        """Return points that buildings of a work tile may need, by survey, of noted runs only."""
        reaches = Reaches(self.plan, {tile: self.plan.tiles[tile]})
        shifts = {survey.name: survey.shift for survey in self.surveys}
        clouds = [(survey.name, cloud) for survey in self.surveys for cloud in survey.clouds]
        model = terrain_model(
            self.terrain, self.plan.crs_wkt, self.plan.units, threading.get_ident()
        )
        with tempfile.TemporaryDirectory(prefix="hiproof-edit-") as folder:
            for number, (name, cloud) in enumerate(clouds):
                gatherer = Gatherer(
                    reaches, self.plan.settings.read, Path(folder) / "points" / name, number
                )
                for chunk in wanted_points(
                    cloud, reaches, self.plan.units, noted_file(self.state, number)
                ):
                    gatherer.add(chunk)
                gatherer.flush()
            return SurveyPoints.load(Path(folder), tile, model, shifts, self.plan)


def missing_reader() -> str:
    """Return a sentence where a package to read the run's terrain is missing, else ""."""
    try:
        import_rasterio()
    except InputError as error:
        return explain_unreadable(error)
    return ""


def explain_unreadable(error: Exception) -> str:
    return f"the run's points cannot be read: all but refitting works ({error})"
