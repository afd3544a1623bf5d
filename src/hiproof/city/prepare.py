"""Make the plan of a run: which buildings there are, from footprints or from the cloud itself."""

from __future__ import annotations

import dataclasses
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from ..errors import InputError, InputWarning
from ..frames import Units
from ..masking import masked
from ..read.overlap import told_box
from ..settings import Settings
from ..write.naming import FileUnits
from ..write.reprojected import crs_of_files
from .classes import settle_classes
from .from_cloud import jobs_from_cloud
from .plan import Job, WorkPlan, cut_into_tiles, jobs_of_footprints, offset_of_jobs, unusual_names
from .request import Box, Request

if TYPE_CHECKING:
    from ..read.raster import RasterTerrain

TILE_M = 250.0  # m, side of a work tile: some dozens of houses, so that a core has minutes to do
MOST_BUILDINGS_A_TILE = 100  # buildings; progress is told by tiles, and a killed worker loses one


def make_plan(request: Request) -> WorkPlan:
    """The plan of a request. Raises InputError when nothing can be read."""
    from ..read.terrain import read_terrain
    from .frame import plan_bounds, settle_frame

    headers = read_headers(request.clouds)
    frame = settle_frame(request, headers)
    refuse_box_elsewhere(request.bbox, plan_bounds(headers))
    # opened only to be told now if it cannot be read, and not after all points are sorted
    terrain = read_terrain(request.terrain, frame.crs, frame.units) if request.terrain else None
    if terrain is not None and not request.footprints:
        terrain.knows_any(places_over(frame.units.to_metres(plan_bounds(headers).reshape(-1, 2))))
    settings = settle_classes(request.clouds, request.settings)
    if request.footprints:
        jobs = jobs_from_footprints(request, headers, frame)
    else:
        jobs, settings = jobs_from_cloud(request.clouds, settings)
        jobs = jobs_in_box(jobs, request, frame.units)
    if terrain is not None:
        check_terrain(terrain, jobs)
    units = FileUnits.of(frame.crs, frame.units, settings.write.out_crs)
    if settings.write.out_crs:
        say_where_files_lie(jobs, crs_of_files(frame.crs, settings.write.out_crs), units)
    return WorkPlan(
        jobs=jobs,
        tiles=cut_into_tiles(jobs, TILE_M, most_buildings_a_tile(request.settings)),
        crs_wkt=frame.crs.to_wkt() if frame.crs is not None else None,
        settings=settings,
        names=unusual_names(jobs),
        translate=offset_of_jobs(jobs, units.cityjson),
    )


def say_where_files_lie(jobs: tuple[Job, ...], crs: Any, units: FileUnits) -> None:
    """One line where the CRS of the files is made for another place than that of the buildings."""
    from ..read.overlap import doubtful_place

    boxes = shapely.bounds([job.area for job in jobs])
    corners = units.gml.from_metres(boxes[np.isfinite(boxes).all(axis=1)].reshape(-1, 2))
    doubt = doubtful_place(crs, corners) if len(corners) else None
    if doubt:
        warnings.warn(
            f"--out-crs: the buildings lie at {doubt}; name the UTM zone or the national grid there", InputWarning
        )


def check_terrain(terrain: RasterTerrain, jobs: tuple[Job, ...]) -> None:
    """Read what lies under the buildings, so that damage ends the run before work is spent, and warn in one line where no
    building has a height there: the ground points that stand in for it would else be taken in silence."""
    corners = shapely.get_coordinates([job.area for job in jobs])
    if not len(corners) or terrain.knows_any(corners):
        return
    lies = "has no height under any building" if terrain.pixels_at(corners)[2].any() else "no building stands on it"
    advice = "its values" if "height" in lies else "its CRS"
    warnings.warn(
        f"{masked(terrain.path)}: {lies}, so the ground is taken from the points; check {advice}", InputWarning
    )


def places_over(corners: np.ndarray) -> np.ndarray:
    """Places (k, 2), 8 by 8 of them over the box of `corners` (n, 2): where buildings are to be looked for first."""
    x, y = (np.linspace(low, high, 8) for low, high in zip(corners.min(axis=0), corners.max(axis=0), strict=True))
    return np.column_stack([grid.ravel() for grid in np.meshgrid(x, y)])


def most_buildings_a_tile(settings: Settings) -> int:
    """Progress is told by tiles, and the paper's objective takes seconds a building: there each is a tile of its own."""
    return 1 if settings.fit.objective == "paper" else MOST_BUILDINGS_A_TILE


def read_headers(clouds: tuple[str, ...]) -> list:
    """Headers of the point files that can be read and hold points; one that does not ends no run."""
    from ..read.pointcloud import and_others, as_input_error, read_header

    headers, errors = [], []
    for name in clouds:
        try:
            headers.append(read_header(name))
        except MemoryError:
            raise
        except Exception as error:
            errors.append(as_input_error(error, name))
    empty = [header.path for header in headers if not header.count]
    if len(empty) == len(headers):
        raise errors[0] if errors else InputError(f"expected points in {', '.join(empty)}, got none; check the files")
    if empty:
        warnings.warn(f"{empty[0]}{and_others(empty)}: holds no points", InputWarning)
    return [header for header in headers if header.count]


def jobs_from_footprints(request, headers: list, frame) -> tuple[Job, ...]:
    from ..read.footprints import read_footprints
    from ..read.overlap import check_overlap
    from .frame import plan_bounds

    footprints = read_footprints(
        request.footprints,
        request.layer,
        request.id_attribute,
        frame.cloud,
        settings=request.settings,
        where=request.where,
        bbox=request.bbox,
    )
    if request.bbox and not footprints:
        raise InputError(nothing_in(request.bbox))
    bounds = frame.units.to_metres(plan_bounds(headers).reshape(-1, 2)).reshape(-1, 4)
    if len(bounds):
        check_overlap(footprints, bounds, frame.footprints, frame.cloud, frame.units)
    return jobs_of_footprints(footprints)


def jobs_in_box(jobs: tuple[Job, ...], request: Request, units: Units) -> tuple[Job, ...]:
    """Those of the `jobs` that meet the box asked for, numbered again; all where none is. Raises InputError where none does."""
    from ..read.footprints import meets

    if request.bbox is None:
        return jobs
    met = [job for job in jobs if meets(job.area, request.bbox, units)]
    if not met:
        raise InputError(nothing_in(request.bbox))
    return tuple(dataclasses.replace(job, index=index) for index, job in enumerate(met))


def refuse_box_elsewhere(bbox: Box | None, bounds: np.ndarray) -> None:
    """A box that meets none of the clouds' boxes (n, 4), both in the clouds' own unit, is refused before anything is read."""
    if bbox is None or not len(bounds) or shapely.intersects(shapely.box(*bbox), shapely.box(*bounds.T)).any():
        return
    extent = [*bounds[:, :2].min(axis=0), *bounds[:, 2:].max(axis=0)]
    raise InputError(
        f"expected a --bbox that meets the clouds, which lie in {told_box(extent)}, got {told_box(bbox)}; give it in their coordinates"
    )


def nothing_in(bbox: Box) -> str:
    return f"expected buildings in --bbox {told_box(bbox)}, got none; it is in the coordinates of the clouds"
