"""The plan of a run: requested buildings, the work tile that owns each, and point files."""

from __future__ import annotations

import dataclasses
import functools
import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ...errors import ErrorReport, InputError, OutputError
from ...fit.registration import Registration
from ...frames import Units
from ...model import Footprint
from ...read.crs import find_units, parse_crs
from ...read.crs.operations import Operation
from ...settings import Settings
from ...stages.outline import without_needless_vertices
from ...write.cityjson.features import choose_offset
from ...write.head import FileHead
from ...write.naming import UniqueNames, gml_name
from ...write.parameters import crs_text
from ...write.values import plain_text
from .outlines import Outlines

PLAN_FILE = "plan.jsonl"
AROUND_M = 4.0  # of roof points around a footprint: as fit/align.py asks, without its compiler here
OVERHANG_REACH_M = (
    1.5  # of points beyond a footprint that may show an overhang, as in fit/overhang.py
)
SHIFT_M = 3.0  # that a row may be moved, as in fit/align.py
# m around a building in which its ground is looked for: where points have the class, a street's
# width; where it is found by shape, twice that
GROUND_REACH_M, FOUND_GROUND_REACH_M = 10.0, 20.0
VOID_REACH_M = 36.0  # from a building to the nearest heights of its terrain model


@dataclass(frozen=True)
class Job:
    """One building asked for.

    `area` is the plan polygon whose points belong to it (world); `footprint` None: estimate.

    A footprint stays as the file has it. Its area is moved by its `shift`, and is simpler where it
    has thousands of vertices. `error` is what ended the search for buildings there: it is an
    internal error without being solved.
    """

    index: int
    id: str
    area: shapely.Polygon
    footprint: Footprint | None
    error: ErrorReport | None = None


@dataclass(frozen=True)
class WorkPlan:
    """Everything a worker needs to know, kept as JSON in the run's folder.

    The file has a line for the whole, then a line a building.

    What a task reads (its point file, the terrain model) comes with the task: an address may hold a
    password. `names` are the CityJSON id and the gml:id of those buildings whose own id will not
    do; `translate` is the offset of the CityJSON file. Both are settled here, so that a building's
    text does not depend on what is written before it. `registration` is the common shift of the
    footprints, None where it was not looked for; `operations` are those by which PROJ transforms
    what is read and written. `others` are outlines around the buildings that were not asked for,
    moved as they are.
    """

    jobs: tuple[Job, ...]
    tiles: dict[str, tuple[int, ...]]
    crs_wkt: str | None
    settings: Settings
    names: dict[int, tuple[str, str]] = field(default_factory=dict)
    translate: np.ndarray = field(default_factory=lambda: np.zeros(3))
    registration: Registration | None = None
    operations: tuple[Operation, ...] = ()
    others: tuple[shapely.Polygon, ...] = ()

    def list_names(self, job: Job) -> tuple[str, str]:
        return self.names.get(job.index) or (job.id, gml_name(job.id))

    @property
    def terrain_reach_m(self) -> float:
        """How far around a building terrain matters, farther where the ground must be found."""
        return FOUND_GROUND_REACH_M if self.settings.read.roofs == "shape" else GROUND_REACH_M

    @functools.cached_property
    def around_m(self) -> float:
        """How far beyond its area a building sees roof points, which show where its roof ends."""
        sees = self.settings.read.by_class and any(job.footprint is not None for job in self.jobs)
        return AROUND_M if sees else 0.0

    @functools.cached_property
    def beyond_m(self) -> float:
        """How far beyond its footprint a building's own roof may reach (LoD2.3)."""
        return OVERHANG_REACH_M if "2.3" in self.settings.write.lods else 0.0

    @functools.cached_property
    def moves_rows(self) -> bool:
        """Whether rows of footprints are moved onto their roofs."""
        return self.around_m > 0 and self.settings.reconstruct.align != "off"

    @functools.cached_property
    def outlines(self) -> Outlines:
        """The outlines of all buildings, by their number, and of the others around them."""
        return Outlines([*(job.area for job in self.jobs), *self.others])

    @functools.cached_property
    def roof_boxes(self) -> np.ndarray:
        """Whole-metre boxes (n, 4) in which buildings see roof points.

        Upper sides are excluded.

        NaN where an area is empty.

        A border on a whole metre belongs to the area: one metre more on the upper sides.
        """
        if self.moves_rows:
            boxes, reach_m = self.outlines.boxes[: len(self.jobs)], self.around_m + SHIFT_M
        else:
            boxes = shapely.bounds([job.area for job in self.jobs])
            reach_m = max(self.around_m, self.beyond_m)
        return grow_boxes(boxes, reach_m) + [0.0, 0.0, 1.0, 1.0]

    @functools.cached_property
    def units(self) -> Units:
        """Units of the coordinates of clouds and footprints.

        Everything in between is in metres.
        """
        return find_units(self.crs(), unit_name=self.settings.read.unit)

    def crs(self) -> Any:
        """The output's reference system, None where no input names one.

        It is made by its code where that is complete, so that also its plan alone has one.
        """
        return parse_crs(crs_text(self.crs_wkt))

    @functools.cached_property
    def head(self) -> FileHead:
        """What the files written have in common."""
        return FileHead(
            self.crs(),
            self.settings.read.unit,
            self.translate,
            self.settings.compose,
            self.settings.write,
        )

    def save(self, path: Path) -> None:
        whole = {
            "tiles": self.tiles,
            "crs": self.crs_wkt,
            "settings": self.settings.to_dict(),
            "names": [[index, *pair] for index, pair in self.names.items()],
            "translate": self.translate.tolist(),
            "registration": self.registration and self.registration.to_dict(),
            "operations": [operation.to_dict() for operation in self.operations],
            "others": shapely.to_wkb(list(self.others), hex=True).tolist() if self.others else [],
        }
        areas = shapely.to_wkb(
            [job.footprint.polygon if job.footprint else job.area for job in self.jobs], hex=True
        )
        with path.open("w", encoding="utf-8") as file:
            file.write(json.dumps(whole) + "\n")
            for job, area in zip(self.jobs, areas, strict=True):
                attributes = job.footprint.attributes if job.footprint else None
                row = [job.id, area, attributes, job.error, *encode_passages(job)]
                file.write(json.dumps(row, default=str) + "\n")

    @staticmethod
    def load(path: Path) -> WorkPlan:
        """Load the plan at `path`.

        Raises OutputError where it is missing or damaged.
        """
        try:
            with path.open(encoding="utf-8") as file:
                whole, rows = json.loads(file.readline()), [json.loads(line) for line in file]
            areas = shapely.from_wkb([row[1] for row in rows])
            registration = whole["registration"] and Registration.from_dict(whole["registration"])
            shift = registration.shift if registration else (0.0, 0.0)
            return WorkPlan(
                jobs=tuple(
                    read_job(i, *row, shift) for i, row in enumerate(zip(rows, areas, strict=True))
                ),
                tiles={name: tuple(members) for name, members in whole["tiles"].items()},
                crs_wkt=whole["crs"],
                settings=Settings.from_dict(whole["settings"]),
                names={index: tuple(pair) for index, *pair in whole["names"]},
                translate=np.array(whole["translate"]),
                registration=registration,
                operations=tuple(map(Operation.from_dict, whole["operations"])),
                others=tuple(shapely.from_wkb(whole["others"])),
            )
        except (OSError, ValueError, KeyError, TypeError, shapely.errors.GEOSException) as error:
            raise OutputError(
                f"expected the plan of a run in {path}, got: {error}; begin anew with --restart"
            ) from error


def read_job(index: int, row: list, area: shapely.Polygon, shift: tuple[float, float]) -> Job:
    """Read a building of the plan's file: [id, area, attributes, error, passage, ...].

    Attributes are None without a footprint. A passage is [polygon, clearance].
    """
    id, _, attributes, error, *rows = row
    passages = tuple((shapely.from_wkb(wkb), clearance) for wkb, clearance in rows)
    if attributes is None:
        return Job(index, id, area, None, error and ErrorReport(*error))
    return make_job(index, Footprint(id, area, attributes, passages=passages), shift)


def encode_passages(job: Job) -> list[tuple[str, float]]:
    """Return the passages below a building as the plan's file holds them."""
    passages = job.footprint.passages if job.footprint else ()
    return [(polygon.wkb_hex, clearance) for polygon, clearance in passages]


def make_job(index: int, footprint: Footprint, shift: tuple[float, float]) -> Job:
    """Make the job of a footprint that lies `shift` beside its roof."""
    area = without_needless_vertices(footprint.polygon)[0]
    area = shapely.transform(area, lambda xy: xy + shift) if any(shift) else area
    return Job(index, footprint.id, area, dataclasses.replace(footprint, shift=shift))


def load_plan(folder: Path) -> WorkPlan:
    """Load the plan of the run whose state is in `folder`, once a process."""
    path = folder / PLAN_FILE
    return loaded_plan(path, path.stat().st_mtime_ns)


@functools.lru_cache(maxsize=2)  # an update has one of each survey
def loaded_plan(path: Path, stamp: int) -> WorkPlan:
    return WorkPlan.load(path)


def unusual_names(jobs: tuple[Job, ...]) -> dict[int, tuple[str, str]]:
    """Return CityJSON and CityGML names of jobs whose own ids cannot stand there or would meet."""
    json_names, gml_names, unusual = UniqueNames(), UniqueNames(), {}
    for job in jobs:
        pair = json_names.take(plain_text(job.id)), gml_names.take(gml_name(job.id))
        if pair != (job.id, gml_name(job.id)):
            unusual[job.index] = pair
    return unusual


def choose_file_offset(jobs: tuple[Job, ...], units: Units) -> np.ndarray:
    """Return the CityJSON file's offset (3,), in its `units`, by the first area."""
    corners = (units.from_metres(job.area.bounds[:2]) for job in jobs if not job.area.is_empty)
    return next(map(choose_offset, corners), np.zeros(3))


def cut_into_tiles(jobs: tuple[Job, ...], tile_m: float, limit: int) -> dict[str, tuple[int, ...]]:
    """Return the work tiles by name, with their buildings.

    A tile has at most `limit` buildings, whose area starts in the same square.

    A building belongs to the square of its lower left corner, so ownership needs no geometry and
    has no ties.
    """
    squares: dict[tuple[int, int], list[int]] = {}
    for job in jobs:
        x, y = (0.0, 0.0) if job.area.is_empty else job.area.bounds[:2]
        squares.setdefault((math.floor(x / tile_m), math.floor(y / tile_m)), []).append(job.index)
    tiles = {}
    for (column, row), members in sorted(squares.items()):
        for number, start in enumerate(range(0, len(members), limit)):
            tiles[f"{column}_{row}_{number}"] = tuple(members[start : start + limit])
    return tiles


def make_jobs(
    footprints: tuple[Footprint, ...], shift: tuple[float, float] = (0.0, 0.0)
) -> tuple[Job, ...]:
    """Return one job a footprint in the order of the file, all `shift` beside their roofs."""
    if not footprints:
        raise InputError(
            "expected at least one polygon in the footprints, got none; check the file and its "
            "layer"
        )
    return tuple(make_job(i, f, shift) for i, f in enumerate(footprints))


def neighbourhood(job: Job, reach_m: float) -> np.ndarray:
    """Return the whole-metre box (xmin, ymin, xmax, ymax) in which terrain matters to a job.

    Whole metres keep the terrain cells of a building the same whatever tile it is computed in.
    """
    return grow_boxes(np.array(job.area.bounds), reach_m)


def grow_boxes(boxes: np.ndarray, reach_m: float) -> np.ndarray:
    """Return boxes (..., 4) grown by a distance, up to whole metres."""
    return np.hstack([np.floor(boxes[..., :2] - reach_m), np.ceil(boxes[..., 2:] + reach_m)])


def enclose(boxes: np.ndarray) -> np.ndarray:
    """Return the box (4,) around boxes (n, 4)."""
    return shapely.total_bounds(shapely.box(*boxes.T))
