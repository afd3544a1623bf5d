"""The plan of an update: the buildings of the earlier run.

The folder of an update holds, beside what every run has, `earlier.jsonl` with the earlier building
of each job, and `earlier/` with the plan and the points of the earlier survey.
"""

from __future__ import annotations

import dataclasses
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ..city.plan.classes import settle_classes
from ..city.plan.frame import plan_bounds, settle_frame
from ..city.plan.prepare import TILE_M, limit_buildings_per_tile, read_headers
from ..city.plan.work_plan import (
    Job,
    WorkPlan,
    cut_into_tiles,
    unusual_names,
)
from ..errors import InputError, InputWarning
from ..masking import mask
from ..read.crs import describe_crs, find_units, same_horizontal
from ..read.crs.positions import format_box
from ..settings import Settings
from ..write.files import atomic
from ..write.parameters import crs_text
from .earlier import EarlierRun
from .members import make_members, save_members
from .request import UpdateRequest

EARLIER_FOLDER = "earlier"


def make_update_plan(request: UpdateRequest, earlier: EarlierRun, state: Path) -> WorkPlan:
    """Make the plan of an update, and keep its members in the folder `state`.

    Raises InputError where the clouds do not fit the run.
    """
    headers = read_headers(request.clouds)
    settings = adopt_crs(request.settings, headers, earlier, request)
    frame = settle_frame(dataclasses.replace(request, settings=settings), headers)
    refuse_other_crs(frame, earlier, request)
    settings = settle_classes(request.clouds, settings)
    members = make_members(request, earlier, frame, headers, settings)
    jobs = tuple(member.make_job(index) for index, member in enumerate(members))
    save_members(state, members)
    refuse_elsewhere(jobs, frame.units.to_metres(plan_bounds(headers)), request)
    if not request.footprints:  # earlier outlines lie on their roofs
        settings = settings.replace({"reconstruct": {"align": "off"}})
    offset = earlier.head.offset
    return WorkPlan(
        jobs=jobs,
        tiles=cut_into_tiles(jobs, TILE_M, limit_buildings_per_tile(settings)),
        crs_wkt=frame.crs.to_wkt() if frame.crs is not None else None,
        settings=settings,
        names=unusual_names(jobs),
        translate=np.zeros(3) if offset is None else offset,
    )


def adopt_crs(
    settings: Settings, headers: list, earlier: EarlierRun, request: UpdateRequest
) -> Settings:
    """Return settings with the run's CRS where the new clouds name none."""
    if (
        settings.read.crs
        or earlier.head.crs is None
        or any(header.crs is not None for header in headers)
    ):
        return settings
    warnings.warn(
        f"{mask(request.clouds[0])}: names no CRS; taken to be in that of {request.run}, "
        f"{describe_crs(earlier.head.crs)}; say otherwise with --crs",
        InputWarning,
    )
    return settings.replace({"read": {"crs": crs_text(earlier.head.crs)}})


def refuse_other_crs(frame: Any, earlier: EarlierRun, request: UpdateRequest) -> None:
    """Raise InputError where run and clouds are in different CRSs or units."""
    crs, unit = earlier.head.crs, earlier.head.unit
    same = (crs is None and frame.crs is None) or (
        crs is not None and frame.crs is not None and same_horizontal(crs, frame.crs)
    )
    if not same or find_units(crs, unit_name=unit) != frame.units:
        raise InputError(
            f"expected clouds in the CRS of {request.run}, {describe_crs(crs)}, got "
            f"{describe_crs(frame.crs)}; reproject them (`pdal translate`)"
        )


def refuse_elsewhere(jobs: tuple[Job, ...], clouds: np.ndarray, request: UpdateRequest) -> None:
    """Raise InputError where the new clouds meet none of the buildings.

    `clouds` (n, 4) are the boxes of the clouds in metres.
    """
    areas = [job.area for job in jobs if not job.area.is_empty]
    if not areas:
        raise InputError(
            f"expected buildings with outlines in {request.run}, got none; name another run"
        )
    boxes = shapely.box(*clouds.T)
    if not len(boxes) or len(shapely.STRtree(boxes).query(areas, predicate="intersects")[0]):
        return
    extent = shapely.total_bounds(areas).tolist()
    lies = shapely.total_bounds(boxes).tolist()
    raise InputError(
        f"expected new clouds that meet the buildings of {request.run}, which lie in "
        f"{format_box(extent)}, got clouds in {format_box(lies)}; check their place and CRS"
    )


def save_earlier_plan(state: Path, plan: WorkPlan, earlier: EarlierRun) -> None:
    """Keep the plan by which the earlier survey is read."""
    folder = state / EARLIER_FOLDER
    (folder / "points").mkdir(parents=True, exist_ok=True)
    settings = earlier.settings.replace({"reconstruct": {"align": "off"}})
    with atomic(folder / "plan.jsonl") as temporary:
        dataclasses.replace(plan, settings=settings).save(Path(temporary))
