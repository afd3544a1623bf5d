"""Make the plan of a run: which buildings there are, from footprints or from the cloud itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely

from ..errors import InputError
from .plan import Job, Plan, cut_into_tiles, jobs_of_footprints, offset_of_jobs, unusual_names

TILE_M = 250.0
MOST_BUILDINGS_A_TILE = 100


def make_plan(request, mark: str) -> Plan:
    """Plan of a `run.Request`; `mark` is its fingerprint. Raises InputError when nothing can be read."""
    from ..read.crs import parse_crs
    from ..read.footprints import footprint_crs

    headers, crs = read_headers(request.clouds)
    crs = parse_crs(request.settings.read.crs) or crs
    if request.footprints:
        jobs = jobs_from_footprints(request, headers, crs)
        # a cloud that names no CRS is taken to be in the footprints'
        crs = crs or footprint_crs(request.footprints)
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
        translate=offset_of_jobs(jobs),
    )


def absolute(name: str) -> str:
    """A path that means the same to a worker started elsewhere; addresses stay as they are."""
    return name if "://" in name or name.startswith("/vsi") else str(Path(name).absolute())


def read_headers(clouds: tuple[str, ...]) -> tuple[list, object]:
    """Headers of the readable point files, and the first CRS among them; one unreadable file does not end the run."""
    from ..read.pointcloud import read_header

    headers, errors = [], []
    for name in clouds:
        try:
            headers.append(read_header(name))
        except InputError as error:
            errors.append(error)
    if not headers:
        raise errors[0]
    return headers, next((h.crs for h in headers if h.crs is not None), None)


def jobs_from_footprints(request, headers: list, crs) -> tuple[Job, ...]:
    from ..read.footprints import check_overlap, read_footprints

    footprints = read_footprints(request.footprints, id_attribute=request.id_attribute, target_crs=crs)
    bounds = np.array([header.bounds for header in headers])
    box = (*bounds[:, :2].min(axis=0), *bounds[:, 3:5].max(axis=0))
    check_overlap(footprints, box, cloud_crs=crs)
    return jobs_of_footprints(footprints)


def jobs_from_cloud(request) -> tuple[Job, ...]:
    """Without footprints, the connected groups of roof points are the buildings."""
    from ..read.pointcloud import read_points
    from ..read.split import split_buildings

    groups = split_buildings(read_points(*request.clouds, settings=request.settings), request.settings)
    areas = [(group.id, shapely.make_valid(group.area)) for group in groups]
    return tuple(Job(i, id, area, None) for i, (id, area) in enumerate(areas))
