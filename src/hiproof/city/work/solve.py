"""Reconstruction of the buildings of one work tile.

Their parts of the output files are left ready to be joined.
"""

from __future__ import annotations

import copy
import dataclasses
import functools
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import shapely

from ...errors import DamagedRaster, report_error
from ...fit.align import Shift, find_shift
from ...frames import Units
from ...geometry.point_grid import PointGrid, grow_polygon
from ...geometry.thin import hashes, thin_to_count, without_repeats
from ...log import LOGGER
from ...masking import mask
from ...method import reconstruct
from ...model import Building
from ...parametric.fallback import list_fallback_columns, use_fallback
from ...parametric.override import Override, overridden
from ...read.points.pointcloud import in_box
from ...read.terrain import Terrain, TerrainChain, read_terrain
from ...read.terrain.raster import RasterTerrain
from ...settings import Settings
from ...stages.footprint import shift_remark
from ...stages.outline import largest_polygon
from ...stages.points import distinct
from ...stages.remarks import add_remark
from ...status import Doubt, Status
from ...write.files import atomic_file
from ...write.fragments import Fragments, save_fragments
from ...write.run_files import fragments
from ..folder.ledger import Outcome
from ..merge.join import name_text_file
from ..plan.outlines import row_outline
from ..plan.overrides import load_overrides, load_redo
from ..plan.work_plan import OVERHANG_REACH_M, Job, WorkPlan, load_plan, make_job, neighbourhood
from .bundles import TerrainRecorder, keep_failure
from .found import BESIDE_M, FEWEST_BESIDE, FoundRoof, found_roof
from .ground import (
    FAR_STEP_M,
    BareAround,
    Cells,
    GroundAround,
    LowestAround,
    ModelAround,
    TerrainModel,
    WhereLikeGround,
    check_terrain,
    ground_cells,
    lowest_in_cells,
)
from .other_classes import (
    OtherPoints,
    explain_missing_points,
    find_bare_cells,
    ground_under_roof,
    remark_other_classes,
)
from .solved import count_building
from .sort import load_points

# corners that change an outline by less make the area beside it slow to draw and no truer
COARSEST_THINNING_M = 0.05

KeepFailure: TypeAlias = Callable[[Job, str, TerrainRecorder | None], None]
"""Keeps the input of a building that failed, with the traceback and its terrain."""

DIED = "the process died while it worked on this building"


class Surroundings:
    """All points of a work tile and its terrain model, looked up building by building."""

    def __init__(self, points: dict[str, np.ndarray], model: TerrainModel | None, plan: WorkPlan):
        self.roof, self.noise, self.plan = points["roof"], points["noise"], plan
        self.model = None if model is None else TerrainRecorder(model)
        self.points, self.grid = points, PointGrid(self.roof)
        self.shifts: dict[int, Shift] = {}
        self.lone: dict[int, bool] = {}

    @functools.cached_property
    def settings(self) -> Settings:
        """The settings of the fit: footprints have been moved before."""
        return self.plan.settings.replace({"reconstruct": {"align": "off"}})

    @functools.cached_property
    def noise_grid(self) -> PointGrid:
        """The noise points by place."""
        return PointGrid(self.noise)

    @functools.cached_property
    def ground(self) -> Cells:
        """The ground points by cell; an update may do without them."""
        return ground_cells(self.points["ground"])

    @functools.cached_property
    def ground_grid(self) -> PointGrid:
        """All ground points by place."""
        return PointGrid(self.points["ground"])

    @functools.cached_property
    def low(self) -> Cells:
        """The lowest points of other classes by cell."""
        return Cells(lowest_in_cells(self.points["low"]))

    def without_moving(self) -> Surroundings:
        """Return the same surroundings, where footprints stay in place."""
        return self.replace(plan=dataclasses.replace(self.plan, settings=self.settings))

    def without_model(self) -> Surroundings:
        """Return the same surroundings without their terrain model."""
        return self.replace(model=None)

    def replace(self, **changes: Any) -> Surroundings:
        """Return a copy with these cells: a copy would find its own, again and again."""
        _ = self.ground, self.low
        result = copy.copy(self)
        vars(result).update(changes)
        return result

    def find_row_shift(self, job: Job) -> Shift:
        """Return the shift of a job's area from its roof, that of its whole row."""
        outlines = self.plan.outlines
        if not self.plan.moves_rows or job.area.is_empty or not outlines.row(job.index):
            return Shift()
        label = int(outlines.labels[job.index])
        if label not in self.shifts:
            outline = row_outline(outlines.row(job.index))
            origin = np.floor(outline.bounds[:2])
            nearby = distinct(self.take_near(outline))
            self.shifts[label] = find_shift(
                nearby[:, :2] - origin, shapely.transform(outline, lambda xy: xy - origin)
            )
        return self.shifts[label]

    def move(self, job: Job) -> tuple[Job, str]:
        """Return the job with its area on its roof, and a remark.

        The remark is for a row that was moved there.
        """
        shift = self.find_row_shift(job)
        if job.footprint is None:
            return job, ""
        if not shift.is_clear:
            return job, shift_remark(shift, 1)
        x, y = (
            round(old + round(float(new), 3), 3)
            for old, new in zip(job.footprint.shift, shift.xy, strict=True)
        )
        remark = shift_remark(shift, len(self.plan.outlines.row(job.index)))
        return make_job(job.index, job.footprint, (x, y)), remark

    def select_roof_points(self, job: Job) -> FoundRoof:
        """Return the roof points (n, 3) inside the job's area, or near it.

        Its footprint may have to be moved onto those near.

        A point that stands in two files comes twice. Roofs found by shape, or alone, are those
        inside the area.
        """
        read = self.plan.settings.read
        if read.by_class or job.area.is_empty:
            return FoundRoof(self.take_near(job.area))
        nearby = self.select_points(job, 0.0)
        if read.roofs == "alone":  # leaves go, unless hardly anything would be left
            found = found_roof(nearby, job.area, np.full(len(nearby), np.nan))
            found = found if found.is_seen else FoundRoof(found.points)
        else:
            height = nearby[:, 2] - TerrainChain(self.find_grounds(job)).height_at(nearby)
            found = found_roof(nearby, job.area, height, job.footprint is not None)
        if not self.plan.beyond_m or job.footprint is None:
            return found
        # points beyond a footprint may show overhangs
        around = self.select_points(job, self.plan.beyond_m)
        outside = around[~shapely.intersects_xy(job.area, around[:, :2])]
        return dataclasses.replace(found, points=np.concatenate([found.points, outside]))

    def take_near(self, area: shapely.Polygon) -> np.ndarray:
        """Take the roof points (n, 3) in an area and around it."""
        return self.roof.take(self.grid.find_within(area, self.plan.around_m), axis=0)

    def select_neighbours(self, job: Job) -> list[shapely.Polygon]:
        """Return the outlines beside a building, moved with it."""
        if job.area.is_empty:
            return []
        planned = self.plan.jobs[job.index].area
        shift = np.subtract(job.area.bounds[:2], planned.bounds[:2])
        near = self.plan.outlines.select_near(job.index, OVERHANG_REACH_M)
        return [shapely.transform(polygon, lambda xy: xy + shift) for polygon in near]

    def select_noise(self, job: Job, roof: np.ndarray) -> np.ndarray:
        """Return noise points (m, 3) over the job's area, higher than half of its `roof` (n, 3).

        Where they are many, they are a spire and not birds.
        """
        if job.area.is_empty or not len(roof) or not len(self.noise):
            return np.zeros((0, 3))
        noise = self.noise.take(self.noise_grid.find_within(job.area, self.plan.around_m), axis=0)
        return without_repeats(noise[noise[:, 2] > np.median(roof[:, 2])])

    def select_points(self, job: Job, reach_m: float) -> np.ndarray:
        """Return points (n, 3), each once, that may be roofs in the box around a job."""
        box = neighbourhood(job, reach_m)
        nearby = self.roof[self.grid.candidates(box)]
        return without_repeats(nearby[in_box(nearby, box)])

    def has_roofs_alone(self, job: Job, box: np.ndarray) -> bool:
        """Return whether all points in a box around a building are of roofs cut out beforehand.

        Then their lowest points are no ground. Where roofs are not found by shape, classes tell it.
        """
        from ...classify.cut_out import is_cut_out

        if self.plan.settings.read.roofs != "shape":
            return False
        if job.index not in self.lone:
            points = self.low.inside(box)
            is_lone = len(points) > 0 and not len(self.ground.inside(box)) and is_cut_out(points)
            self.lone[job.index] = bool(is_lone)
        return self.lone[job.index]

    def find_grounds(self, job: Job) -> list[Terrain]:
        """Return the terrain model, ground points and ground of a building."""
        return self.list_terrains(job)[:-1]

    def list_terrains(self, job: Job) -> list[Terrain]:
        """Return terrains in the box around a building, best first and its lowest points last."""
        box = neighbourhood(job, self.plan.terrain_reach_m)
        find_low = functools.cache(lambda: self.find_lowest(job, box))  # most have better ground
        points = GroundAround(self.ground, box)
        bare, lowest = BareAround(find_low, box), LowestAround(find_low, box)
        if self.model is None:
            return [points, bare, lowest]
        model, own = WhereLikeGround(self.model, points), neighbourhood(job, 0.0)
        far = ModelAround(model, own, FAR_STEP_M, is_guess=True)
        return [model, points, ModelAround(model, own), bare, far, lowest]

    def find_lowest(self, job: Job, box: np.ndarray) -> Cells:
        """Return the cells of lowest points.

        Where too few lie beside the building, they are the roof's own, and no cells are returned.
        """
        points = self.low.inside(box)
        if self.has_roofs_alone(job, box):
            return Cells(points[:0])
        outline = grow_polygon(shapely.simplify(job.area, COARSEST_THINNING_M), BESIDE_M)
        is_beside = ~shapely.intersects_xy(outline, points[:, :2])
        return self.low if is_beside.sum() >= FEWEST_BESIDE else Cells(points[:0])

    def choose_terrain(self, job: Job) -> TerrainChain | None:
        """Return the terrain around the building: its ground, else the lowest points."""
        return None if job.area.is_empty else TerrainChain(self.list_terrains(job))

    def remark_terrain(self, job: Job) -> str:
        """Return a remark, perhaps empty, where ground points contradict the terrain model."""
        if self.model is None or job.area.is_empty:
            return ""
        box = neighbourhood(job, self.plan.terrain_reach_m)
        return check_terrain(
            self.model, GroundAround(self.ground, box), shapely.get_coordinates(job.area)
        )

    def select_other_points(self, job: Job) -> OtherPoints | None:
        """Return the points of other classes inside the building's area.

        None where classes tell no roofs.
        """
        if not self.plan.settings.read.by_class or job.area.is_empty:
            return None
        box = neighbourhood(job, 0.0)
        terrain = TerrainChain(self.find_grounds(job))
        return OtherPoints.inside(job.area, self.ground.inside(box), self.low.inside(box), terrain)

    def bare(self, job: Job, result: FoundRoof, neighbours: OtherPoints | None) -> np.ndarray:
        """Return points (n, 3) of bare ground inside the building's area.

        They are of the ground class with nothing of another class over them, or were told from the
        roof by their height.
        """
        if job.area.is_empty or job.footprint is None:
            return result.ground
        if neighbours is not None:
            return find_bare_cells(neighbours)
        classified = self.ground.inside(neighbourhood(job, 0.0))
        return np.concatenate([result.ground, classified])

    def inspect(self, building: Building, points: OtherPoints | None, roof: np.ndarray) -> Building:
        """Return the building with remarks of other classes, where classes mark roofs.

        `roof` (n, 3) are its own.
        """
        if points is None:
            return building
        if building.status is Status.NO_POINTS:
            classes = self.plan.settings.read.building_classes
            detail = explain_missing_points(points, classes) or building.detail
            return dataclasses.replace(building, detail=detail)
        return add_remark(
            building, remark_other_classes(points, roof), ground_under_roof(points, roof)
        )


def solve_tile(
    folder: str, tile: str, terrain: str | None = None, avoid: tuple[int, ...] = ()
) -> list[Outcome]:
    """Reconstruct all buildings of `tile` on the model `terrain`, and write its part file.

    `avoid` are the buildings that killed their worker before: they become internal errors without
    being tried again. Returns a row a building for the ledger.
    """
    root = Path(folder)
    plan = load_plan(root)
    points = load_points(root, tile)
    surroundings = Surroundings(points, open_terrain(plan, terrain), plan)
    overrides = load_overrides(root)

    def solve(job: Job, keep: KeepFailure) -> tuple[Building, Fragments]:
        return solve_one(plan, job, surroundings, overrides.get(job.index), keep)

    return solve_buildings(root, plan, tile, solve, lambda: points, avoid)


def solve_buildings(
    root: Path,
    plan: WorkPlan,
    tile: str,
    solve: Callable[[Job, KeepFailure], tuple[Building, Fragments]],
    load: Callable[[], dict[str, np.ndarray]],
    avoid: tuple[int, ...],
) -> list[Outcome]:
    """Solve the open buildings of `tile`, and write a file of their texts.

    Of those that fail, or that are to `avoid`, the points are kept, which `load` returns by kind.
    """
    keep = functools.partial(keep_failure, root, load, plan)
    parts, rows = [], []
    for index in load_redo(root).get(tile, plan.tiles[tile]):
        job, start = plan.jobs[index], time.perf_counter()
        if index in avoid:
            building, part = record_failure(plan, job, DIED)
            keep(job, DIED, None)
        else:
            building, part = solve_safely(plan, job, functools.partial(solve, job, keep), keep)
        parts.append(part)
        rows.append(make_outcome(index, building, time.perf_counter() - start))
        count_building()
    file = name_text_file(root, tile)
    with atomic_file(file) as stream:
        save_fragments(stream, parts)
    return [row._replace(file=file.name, number=number) for number, row in enumerate(rows)]


def open_terrain(plan: WorkPlan, path: str | None) -> RasterTerrain | None:
    """Return the terrain model of a run, opened once a thread."""
    return terrain_model(path, plan.crs_wkt, plan.units, threading.get_ident())


@functools.lru_cache(maxsize=32)
def terrain_model(
    path: str | None, crs_wkt: str | None, units: Units, thread: int
) -> RasterTerrain | None:
    """Return the terrain model, opened once a thread.

    GDAL's data sets are not to be shared.
    """
    from pyproj import CRS

    return read_terrain(path, CRS.from_wkt(crs_wkt) if crs_wkt else None, units) if path else None


def keep_nothing(job: Job, trace: str, terrain: TerrainRecorder | None) -> None:
    """Keep nothing of a building that failed."""


def solve_one(
    plan: WorkPlan,
    job: Job,
    surroundings: Surroundings,
    override: Override | None = None,
    keep: KeepFailure = keep_nothing,
) -> tuple[Building, Fragments]:
    """Return one building and its texts, whatever happens.

    An exception becomes its status.

    `keep` is called with the traceback.
    """
    if surroundings.model is not None:
        surroundings.model.places = []
    if job.error is not None:
        keep(job, job.error.trace, None)
        return record_failure(plan, job, job.error.detail)

    def solve() -> tuple[Building, Fragments]:
        # first of all: a footprint is put where points are many
        moved_job, remark = surroundings.move(job)
        building = solve_by_points(plan, moved_job, remark, surroundings, override)
        if building.built is None and list_fallback_columns(plan.settings.read):
            terrain = surroundings.choose_terrain(moved_job)
            building = use_fallback(building, override, terrain, plan.settings)
        building, texts = fragments(building, plan.list_names(job), plan.head)
        if building.status is Status.INTERNAL_ERROR:
            keep(job, building.detail, surroundings.model)
        return building, texts

    return solve_safely(plan, job, solve, keep, surroundings.model)


def solve_safely(
    plan: WorkPlan,
    job: Job,
    solve: Callable[[], tuple[Building, Fragments]],
    keep: KeepFailure,
    terrain: TerrainRecorder | None = None,
) -> tuple[Building, Fragments]:
    """Return what `solve` makes of a building, so that it never stops the others.

    An exception becomes its status, and `keep` is called with the traceback.

    MemoryError is raised: whether memory lasts depends on the neighbours, so the building is tried
    again alone. So is DamagedRaster, for the terrain model is the run's and not the building's.
    """
    try:
        return solve()
    except DamagedRaster:
        raise
    except Exception as error:
        report = report_error(error)
        keep(job, report.trace, terrain)
        return record_failure(plan, job, report.detail)


@contextmanager
def pass_over_failure(job: Job) -> Iterator[None]:
    """Log an error in what precedes a building's solution; raise those of `solve_safely`."""
    try:
        yield
    except DamagedRaster:
        raise
    except Exception as error:
        LOGGER.info("building %s is passed over:\n%s", job.id, report_error(error).trace)


def solve_by_points(
    plan: WorkPlan, job: Job, moved: str, surroundings: Surroundings, override: Override | None
) -> Building:
    """Return a building as its points and its override have it.

    `moved` is the remark on its footprint.
    """
    roof_points = surroundings.select_roof_points(job)
    if (
        not roof_points.is_seen
        and override is None
        and not (roof_points.is_ground and plan.settings.reconstruct.empty_footprints == "model")
    ):
        status = Status.NO_BUILDING if roof_points.is_ground and job.footprint else Status.NO_ROOF
        return add_input(Building(job.id, status, roof_points.remark), job)
    points = without_repeats(roof_points.points)
    in_use = thin_to_count(points, plan.settings.city.max_points_a_building)
    other_points = surroundings.select_other_points(job)
    arguments = (
        in_use,
        job.footprint,
        surroundings.choose_terrain(job),
        surroundings.settings,
        job.id,
        surroundings.bare(job, roof_points, other_points),
    )
    neighbours = surroundings.select_neighbours(job)
    if override is not None:
        building = overridden(override, *arguments, neighbours)
    else:
        unused = surroundings.select_noise(job, points)
        if len(in_use) < len(points):
            thinned_out = points[~np.isin(hashes(points), hashes(in_use))]
            unused = np.concatenate([thinned_out, unused])
        building = reconstruct(*arguments, unused=unused, neighbours=neighbours)
    if len(in_use) < len(points):
        building = add_full_density(building, len(in_use), len(points))
    terrain = surroundings.remark_terrain(job)
    building = add_remark(building, moved, roof_points.remark, terrain)
    return add_remark(
        surroundings.inspect(building, other_points, points), remark_missing_ground(building)
    )


def add_full_density(building: Building, in_use: int, count: int) -> Building:
    """Add the density of all `count` points to a building.

    A model says that it is fitted to those `in_use`.
    """
    quality = dataclasses.replace(
        building.quality, density=building.quality.density * count / in_use
    )
    remark = (
        f"fitted to {in_use} of its {count} points" if building.status is Status.MODELLED else ""
    )
    return add_remark(dataclasses.replace(building, quality=quality), remark)


def remark_missing_ground(building: Building) -> str:
    """Return a remark where no ground was found around a building.

    Volume and height over ground then depend on a wall's usual height.
    """
    if building.built is None or not building.ground_source.startswith("assumed"):
        return ""
    return (
        f"{Doubt.ASSUMED_GROUND.value}, for none is seen near it: its volume and height over "
        "ground are guesses"
    )


def add_input(building: Building, job: Job) -> Building:
    """Add the input's outline and attributes to a building without a model."""
    if job.footprint is None:
        return dataclasses.replace(building, footprint=largest_polygon(job.area))
    footprint, attributes = largest_polygon(job.footprint.polygon), job.footprint.attributes
    return dataclasses.replace(
        building, footprint=footprint, attributes=attributes, shift=job.footprint.shift
    )


def record_failure(plan: WorkPlan, job: Job, detail: str) -> tuple[Building, Fragments]:
    """Record a building that hiproof failed on.

    The outline and attributes may be the cause of the failure. If writing them fails as well, the
    record consists of the id and the message.
    """
    building = Building(job.id, Status.INTERNAL_ERROR, mask(detail))
    try:
        return fragments(add_input(building, job), plan.list_names(job), plan.head)
    except Exception as error:
        LOGGER.info(
            "building %s: its outline cannot be written: %s", job.id, report_error(error).detail
        )
        return fragments(building, plan.list_names(job), plan.head)


def make_outcome(position: int, building: Building, seconds: float) -> Outcome:
    value = building.quality.share_within_20cm
    share = float(value) if np.isfinite(value) else None
    status, grade = building.status.code, None if building.grade is None else building.grade.code
    return Outcome(
        position, building.id, status, grade, building.type, building.detail, share, seconds
    )
