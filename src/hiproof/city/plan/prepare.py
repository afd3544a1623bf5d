"""Making the plan of a run, from footprints or from the cloud itself."""

from __future__ import annotations

import dataclasses
import warnings
from typing import Any

import numpy as np
import shapely

from ...errors import InputError, InputWarning, warn
from ...fit.registration import Registration
from ...frames import Box, Units
from ...masking import mask
from ...model import Footprint
from ...read.crs import horizontal_crs, names_place, same_horizontal
from ...read.crs.operations import Operation, find_operation, warn_if_coarse
from ...read.crs.positions import doubtful_place, format_box, reproject_positions
from ...read.outlines.database import is_database
from ...read.outlines.footprints import find_middle, meets, read_footprints
from ...read.points.pointcloud import as_input_error, format_others, read_header
from ...read.terrain import read_terrain
from ...read.terrain.raster import RasterTerrain
from ...settings import Settings
from ...write.naming import FileUnits
from ...write.reprojected import choose_file_crs
from ...write.tables.geopackage import attributes_with_a_column
from ..request import Request
from .checks import refuse_missing_use
from .classes import settle_classes
from .frame import AreaFrame, plan_bounds, settle_frame
from .from_cloud import Progress, jobs_from_cloud
from .from_overture import with_overture
from .outlines import MOST_ROW_M
from .overlap import check_overlap
from .overrides import check_number_columns
from .passages import add_passages
from .registration import register_footprints
from .work_plan import (
    VOID_REACH_M,
    Job,
    WorkPlan,
    choose_file_offset,
    cut_into_tiles,
    enclose,
    make_job,
    make_jobs,
    unusual_names,
)

TILE_M = 250.0  # m, side of a work tile: some dozens of houses, so that a core has minutes to do
MOST_BUILDINGS_A_TILE = 100  # buildings; a killed worker loses one tile


def make_plan(request: Request, progress: Progress = lambda *_: None) -> WorkPlan:
    """Make the plan of a request.

    Raises InputError when nothing can be read.
    """
    headers = read_headers(request.clouds)
    request = with_overture(request, headers)
    frame = settle_frame(request, headers)
    refuse_box_elsewhere(request.bbox, plan_bounds(headers))
    # opened only to be told now if it cannot be read, and not after all points are sorted
    terrain = read_terrain(request.terrain, frame.crs, frame.units) if request.terrain else None
    if terrain is not None and not request.footprints:
        terrain.knows_any(list_places(frame.units.to_metres(plan_bounds(headers))))
    settings = settle_classes(request.clouds, request.settings)
    if request.underpasses is not None and not request.footprints:
        raise InputError(
            "expected --footprints with --underpasses, got none; name the outlines of the "
            "buildings above them"
        )
    registration, operations, neighbours = None, [], ()
    if request.footprints:
        jobs, neighbours, registration = jobs_from_footprints(request, headers, frame, settings)
        # a warning said where it is coarse when they were read
        operations += list_operations(
            mask(request.footprints), frame.footprints, frame.cloud, frame, jobs, is_told=True
        )
    else:
        jobs, settings = jobs_from_cloud(request, headers, frame.units, settings, progress)
        jobs = jobs_in_box(jobs, request, frame.units)
    if terrain is not None:
        check_terrain(terrain, jobs)
        subject = mask(terrain.path)
        operations += list_operations(subject, frame.crs, terrain.own_crs, frame, jobs)
    units = FileUnits.of(frame.crs, frame.units, settings.write.out_crs)
    if settings.write.out_crs:
        out_crs = choose_file_crs(frame.crs, settings.write.out_crs)
        warn_files_elsewhere(jobs, out_crs, units)
        operations += list_operations("--out-crs", frame.crs, out_crs, frame, jobs)
    return WorkPlan(
        jobs=jobs,
        tiles=cut_into_tiles(jobs, TILE_M, limit_buildings_per_tile(request.settings)),
        crs_wkt=frame.crs.to_wkt() if frame.crs is not None else None,
        settings=settings,
        names=unusual_names(jobs),
        translate=choose_file_offset(jobs, units.cityjson),
        registration=registration,
        operations=tuple(operations),
        others=neighbours,
    )


def warn_files_elsewhere(jobs: tuple[Job, ...], crs: Any, units: FileUnits) -> None:
    """Warn once where the files' CRS is made for another place than that of the buildings."""
    boxes = shapely.bounds([job.area for job in jobs])
    corners = units.gml.from_metres(boxes[np.isfinite(boxes).all(axis=1)].reshape(-1, 2))
    doubt = doubtful_place(crs, corners) if len(corners) else None
    if doubt:
        text = f"the buildings lie at {doubt}; name the UTM zone or the national grid there"
        warn("--out-crs", text)


def check_terrain(terrain: RasterTerrain, jobs: tuple[Job, ...]) -> None:
    """Read the terrain under the buildings before work is spent.

    Damage ends the run. A line warns where no building has a height there, or in reach of it: the
    ground points that stand in for it would else be taken in silence.
    """
    corners = shapely.get_coordinates([job.area for job in jobs])
    boxes = shapely.bounds([job.area for job in jobs if not job.area.is_empty]).reshape(-1, 2, 2)
    around = (boxes + np.array([[-VOID_REACH_M], [VOID_REACH_M]])).reshape(-1, 2)
    if not len(corners) or terrain.knows_any(corners) or terrain.knows_any(around):
        return
    lies, advice = (
        ("has no height under any building", "values")
        if terrain.pixels_at(corners)[2].any()
        else ("no building stands on it", "CRS")
    )
    warn(terrain.path, f"{lies}, so the ground is taken from the points; check its {advice}")


def list_places(boxes: np.ndarray) -> np.ndarray:
    """Return places (k, 2), 8 by 8 of them, over the `boxes` (n, 4).

    Buildings are looked for there first.
    """
    lower, upper = np.reshape(enclose(boxes), (2, 2))
    return np.stack(np.meshgrid(*np.linspace(lower, upper, 8).T), axis=-1).reshape(-1, 2)


def limit_buildings_per_tile(settings: Settings) -> int:
    """Return the most buildings of a tile.

    Progress counts tiles, and the paper's objective takes seconds a building: there each is a tile
    of its own.
    """
    return 1 if settings.fit.objective == "paper" else MOST_BUILDINGS_A_TILE


def read_headers(clouds: tuple[str, ...]) -> list:
    """Return the headers of the point files that hold points.

    A file that cannot be read does not end the run.
    """
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
        raise (
            errors[0]
            if errors
            else InputError(f"expected points in {', '.join(empty)}, got none; check the files")
        )
    if empty:
        warn(f"{empty[0]}{format_others(empty)}", "holds no points")
    return [header for header in headers if header.count]


def jobs_from_footprints(
    request: Request, headers: list, frame: AreaFrame, settings: Settings
) -> tuple[tuple[Job, ...], tuple[shapely.Polygon, ...], Registration | None]:
    """Return one job a footprint, other outlines, and the common shift.

    The outlines are those around that were not requested. All are moved by the shift, None where it
    is not looked for.
    """
    footprints = read_requested_footprints(request, frame, where=request.where, bbox=request.bbox)
    if footprints:
        refuse_missing_use(
            (name for f in footprints for name in f.attributes), request.use_attribute
        )
    check_number_columns(footprints, settings.read)
    footprints = add_passages(footprints, request, frame)
    if request.bbox and not footprints:
        raise InputError(nothing_in(request.bbox))
    say_if_columns_run_out(str(request.footprints), footprints)
    bounds = frame.units.to_metres(plan_bounds(headers))
    if len(bounds):
        check_overlap(footprints, bounds, frame.footprints, frame.cloud, frame.units)
    is_part = request.where or request.bbox
    data_set = all_footprints(request, frame, headers) if is_part else footprints
    registration = register_footprints(
        data_set, headers, frame.units, settings, str(request.footprints)
    )
    shift = registration.shift if registration else (0.0, 0.0)
    areas = [
        make_job(0, footprint, shift).area for footprint in select_neighbours(footprints, data_set)
    ]
    return make_jobs(footprints, shift), tuple(areas), registration


def select_neighbours(
    footprints: tuple[Footprint, ...], data_set: tuple[Footprint, ...]
) -> list[Footprint]:
    """Return those of a data set near the requested footprints, without these themselves."""
    if data_set is footprints:
        return []
    requested = [f.polygon for f in footprints if not f.polygon.is_empty]
    own = {polygon.wkb for polygon in requested}
    neighbours = [f for f in data_set if not f.polygon.is_empty and f.polygon.wkb not in own]
    polygons = np.array([f.polygon for f in neighbours], object)
    tree = shapely.STRtree(requested)
    near = tree.query(polygons, predicate="dwithin", distance=MOST_ROW_M)[0]
    return [neighbours[i] for i in np.unique(near)]


def all_footprints(request: Request, frame: AreaFrame, headers: list) -> tuple[Footprint, ...]:
    """Return the footprints within the clouds, requested or not.

    Of a database they are those that its own condition lets through.

    What is odd about them has been said of those that are asked for.
    """
    bounds, path = plan_bounds(headers), str(request.footprints)
    box: Any = tuple(enclose(bounds)) if len(bounds) else None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InputWarning)
        return read_requested_footprints(
            request, frame, where=request.where if is_database(path) else None, bbox=box
        )


def read_requested_footprints(
    request: Request, frame: AreaFrame, where: str | None, bbox: Box | None
) -> tuple[Footprint, ...]:
    return read_footprints(
        str(request.footprints),
        request.layer,
        request.id_attribute,
        frame.cloud,
        settings=request.settings,
        where=where,
        bbox=bbox,
    )


def list_operations(
    subject: str,
    source: Any,
    target: Any,
    frame: AreaFrame,
    jobs: tuple[Job, ...],
    is_told: bool = False,
) -> list[Operation]:
    """Return the operation between two CRSs in plan at the buildings, and warn if it is coarse.

    The list is empty where both CRSs are the same or one is unknown.
    """
    areas = np.array([job.area for job in jobs if not job.area.is_empty])
    if (
        source is None
        or target is None
        or same_horizontal(source, target)
        or not len(areas)
        or not (names_place(source) and names_place(target))
    ):
        return []
    middle = frame.units.from_metres(np.array([find_middle(areas)]))
    x, y = reproject_positions(middle, frame.crs, source)[0]
    place = float(x), float(y)
    operation = find_operation(subject, horizontal_crs(source), horizontal_crs(target), place)
    if not is_told:
        warn_if_coarse(operation)
    return [operation]


def say_if_columns_run_out(path: str, footprints: tuple[Footprint, ...]) -> None:
    """Warn before any work of more attributes of footprints than a GeoPackage has columns."""
    count = len({name for footprint in footprints for name in footprint.attributes})
    if count > (room := attributes_with_a_column()):
        warn(
            path,
            f"has {count:,} attributes; buildings.gpkg holds the first {room:,}, because its "
            "tables have at most 2,000 columns, and the other files hold all",
        )


def jobs_in_box(jobs: tuple[Job, ...], request: Request, units: Units) -> tuple[Job, ...]:
    """Return the `jobs` that meet the requested box, numbered again.

    Without a box they are all.

    Raises InputError where none does.
    """
    if request.bbox is None:
        return jobs
    met = [job for job in jobs if meets(job.area, request.bbox, units)]
    if not met:
        raise InputError(nothing_in(request.bbox))
    return tuple(dataclasses.replace(job, index=index) for index, job in enumerate(met))


def refuse_box_elsewhere(bbox: Box | None, bounds: np.ndarray) -> None:
    """Refuse a box that meets none of the clouds' boxes (n, 4), both in the clouds' own unit."""
    if (
        bbox is None
        or not len(bounds)
        or shapely.intersects(shapely.box(*bbox), shapely.box(*bounds.T)).any()
    ):
        return
    extent = format_box(enclose(bounds).tolist())
    raise InputError(
        f"expected a --bbox that meets the clouds, which lie in {extent}, got "
        f"{format_box(bbox)}; give it in their coordinates"
    )


def nothing_in(bbox: Box) -> str:
    return (
        f"expected buildings in --bbox {format_box(bbox)}, got none; it is in the coordinates of "
        "the clouds"
    )
