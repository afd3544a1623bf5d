"""The buildings of a run without footprints, found among the roof points of a cloud."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import shapely

from ...errors import InputError, warn
from ...frames import Box, Units
from ...log import count_things
from ...model import PointCloud
from ...read.points.pointcloud import PointFileHeader, iter_points, list_boxes, read_points
from ...settings import Settings
from ..request import Request
from .work_plan import Job

MOST_BLOCK_M = 250.0
"""Distance (m) from the box of a run beyond which point files are not read for its buildings: no
block of touching houses is longer."""

Progress = Callable[[str, int, int | None], None]


def jobs_from_cloud(
    request: Request,
    headers: list[PointFileHeader],
    units: Units,
    settings: Settings,
    progress: Progress,
) -> tuple[tuple[Job, ...], Settings]:
    """Return one job a building found, and the settings for its points.

    The settings choose all points in a cloud of roofs alone. With a box in the request there may be
    no jobs, and some may lie beside it.
    """
    from ...classify.split import split_buildings

    progress("read", 0, None)
    box: Any = None if request.bbox is None else tuple(units.to_metres(request.bbox))
    names = request.clouds if box is None else select_clouds(request.clouds, box, headers, units)
    cloud = readable_points(names, settings)
    has_roofs = not settings.read.by_class or np.isin(cloud.classes, settings.read.building_classes)
    if len(names) < len(request.clouds) and not np.any(has_roofs):
        return (), settings
    buildings = split_buildings(cloud, settings, box, progress)
    if settings.read.roofs == "shape" and buildings and buildings[0].is_cut_out:
        roofs = count_things(len(buildings), "roof") if len(buildings) > 1 else "one roof"
        text = f"taken for the points of {roofs}, as nothing in it looks like ground"
        warn(", ".join(cloud.sources), text)
        settings = settings.replace({"read": {"roofs": "alone"}})
    return tuple(
        Job(i, item.id, item.area, None, item.error) for i, item in enumerate(buildings)
    ), settings


def select_clouds(
    clouds: tuple[str, ...], box: Box, headers: list[PointFileHeader], units: Units
) -> tuple[str, ...]:
    """Return the point files to look for buildings in: those near the box."""
    boxes = units.to_metres(list_boxes(headers))
    gaps = shapely.distance(shapely.box(*box), shapely.box(*boxes.T))
    distant = {header.path for header, gap in zip(headers, gaps, strict=True) if gap > MOST_BLOCK_M}
    return tuple(name for name in clouds if name not in distant)


def readable_points(clouds: tuple[str, ...], settings: Settings) -> PointCloud:
    """Read the points of all files that can be read.

    The step that sorts points names the others.
    """
    try:
        return read_points(*clouds, settings=settings)
    except InputError:
        readable = [name for name in clouds if is_readable(name)]
        if len(readable) in (0, len(clouds)):
            raise
        return read_points(*readable, settings=settings)


def is_readable(name: str) -> bool:
    """Return whether a point file can be read from end to end."""
    try:
        for _ in iter_points(name):
            pass
    except InputError:
        return False
    return True
