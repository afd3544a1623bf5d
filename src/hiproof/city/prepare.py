"""Make the plan of a run: which buildings there are, from footprints or from the cloud itself."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import shapely

from ..errors import InputError, InputWarning
from ..frames import Units
from ..settings import Settings
from ..write.naming import FileUnits
from .plan import Job, Plan, cut_into_tiles, jobs_of_footprints, offset_of_jobs, unusual_names

TILE_M = 250.0
MOST_BUILDINGS_A_TILE = 100


def make_plan(request, mark: str) -> Plan:
    """Plan of a `run.Request`; `mark` is its fingerprint. Raises InputError when nothing can be read."""
    from ..read.crs import units_of
    from ..read.footprints import footprint_crs
    from ..read.terrain import read_terrain

    headers = read_headers(request.clouds)
    cloud = crs_of_clouds(headers, request.settings)
    footprints = footprint_crs(request.footprints, request.layer) if request.footprints else None
    if cloud is None and footprints is not None:
        refuse_degrees_alone(request.footprints, footprints)
    crs = cloud or footprints
    units = units_of(crs, "the point clouds", request.settings.read.unit)
    if crs is None:
        refuse_degrees_of(headers)
    if cloud is None:
        say_what_is_assumed(headers[0].path, footprints, units)
    if request.terrain:
        read_terrain(
            request.terrain, crs, units
        )  # only to be told now, not after all points are sorted, if it cannot be
    if request.footprints:
        jobs = jobs_from_footprints(request, headers, cloud, footprints, units)
    else:
        jobs = jobs_from_cloud(request)
    return Plan(
        clouds=tuple(map(absolute, request.clouds)),
        jobs=jobs,
        tiles=cut_into_tiles(jobs, TILE_M, MOST_BUILDINGS_A_TILE),
        crs_wkt=crs.to_wkt() if crs is not None else None,
        terrain=absolute(request.terrain) if request.terrain else None,
        settings=request.settings,
        fingerprint=mark,
        names=unusual_names(jobs),
        translate=offset_of_jobs(jobs, FileUnits.of(crs, units).cityjson),
    )


def absolute(name: str) -> str:
    """A path that means the same to a worker started elsewhere; addresses stay as they are."""
    return name if "://" in name or name.startswith("/vsi") else str(Path(name).absolute())


def read_headers(clouds: tuple[str, ...]) -> list:
    """Headers of the readable point files; one unreadable file does not end the run."""
    from ..read.pointcloud import as_input_error, read_header

    headers, errors = [], []
    for name in clouds:
        try:
            headers.append(read_header(name))
        except MemoryError:
            raise
        except Exception as error:
            errors.append(as_input_error(error, name))
    if not headers:
        raise errors[0]
    return headers


def crs_of_clouds(headers: list, settings: Settings) -> object:
    """The CRS that the settings give the clouds, else the one their headers agree on, None where none names one."""
    from ..read.crs import parse_crs
    from ..read.pointcloud import common_crs

    return common_crs({header.path: header.crs for header in headers}, parse_crs(settings.read.crs))


def plan_bounds(headers: list) -> np.ndarray:
    """Boxes (n, 4) of the point files in plan, in their own unit; those without points left out."""
    bounds = np.array([header.bounds for header in headers], float).reshape(-1, 6)[:, [0, 1, 3, 4]]
    return bounds[np.isfinite(bounds).all(axis=1)]


def refuse_degrees_of(headers: list) -> None:
    from ..read.overlap import refuse_degrees

    advice = "reproject them to the UTM zone or the national grid of the place (`pdal translate`)"
    refuse_degrees(plan_bounds(headers), "the point clouds", advice)


def refuse_degrees_alone(path: str, crs) -> None:
    """Footprints in degrees cannot stand in for the CRS of clouds that name none."""
    from ..read.crs import described

    if crs.is_geographic:
        raise InputError(
            f"expected footprints that tell the CRS of clouds that name none, got {path} in {described(crs)}, which is in "
            "degrees; name the clouds' CRS with --crs, or reproject the footprints"
        )


def say_what_is_assumed(path: str, footprints: object, units: Units) -> None:
    """One line where no cloud names a CRS: whatever is then taken for granted would else be taken in silence."""
    from ..read.crs import described

    taken = f"taken to be in the footprints' {described(footprints)}" if footprints else f"its unit is taken as {units}"
    warnings.warn(f"{path}: names no CRS; {taken}; say otherwise with --crs or --unit", InputWarning)


def jobs_from_footprints(request, headers: list, cloud_crs, footprints_crs, units: Units) -> tuple[Job, ...]:
    from ..read.footprints import read_footprints
    from ..read.overlap import check_overlap

    footprints = read_footprints(
        request.footprints, request.layer, request.id_attribute, cloud_crs, settings=request.settings
    )
    bounds = units.to_metres(plan_bounds(headers).reshape(-1, 2)).reshape(-1, 4)
    if len(bounds):
        check_overlap(footprints, bounds, footprints_crs, cloud_crs, units)
    return jobs_of_footprints(footprints)


def jobs_from_cloud(request) -> tuple[Job, ...]:
    """Without footprints, the connected groups of roof points are the buildings."""
    from ..read.pointcloud import read_points
    from ..read.split import split_buildings

    try:
        cloud = read_points(*request.clouds, settings=request.settings)
    except InputError:
        readable = [name for name in request.clouds if is_readable(name)]
        if len(readable) in (0, len(request.clouds)):
            raise
        cloud = read_points(*readable, settings=request.settings)
    groups = split_buildings(cloud, request.settings)
    areas = [(group.id, shapely.make_valid(group.area)) for group in groups]
    return tuple(Job(i, id, area, None) for i, (id, area) in enumerate(areas))


def is_readable(name: str) -> bool:
    """Whether a point file can be read from end to end; the step that sorts points names those that cannot."""
    from ..read.pointcloud import iter_points

    try:
        for _ in iter_points(name):
            pass
    except InputError:
        return False
    return True
