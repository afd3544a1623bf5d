"""The buildings of a run without footprints: connected groups of roof points, whose class is known or found."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
import shapely

from ..errors import InputError, InputWarning
from ..model import PointCloud
from ..settings import Settings
from .classes import with_read
from .plan import Job

MOSTLY_GROUND, HARDLY_GROUND = 0.9, 0.2  # shares of the points of a cloud


def jobs_from_cloud(clouds: tuple[str, ...], settings: Settings) -> tuple[tuple[Job, ...], Settings]:
    """A job a group of roof points, and the settings that they were found by."""
    from ..read.split import split_buildings

    cloud = readable_points(clouds, settings)
    if settings.read.roofs == "shape":
        cloud, settings = with_buildings_found(cloud, settings)
    groups = split_buildings(cloud, settings)
    areas = [(group.id, shapely.make_valid(group.area)) for group in groups]
    return tuple(Job(i, id, area, None) for i, (id, area) in enumerate(areas)), settings


def with_buildings_found(cloud: PointCloud, settings: Settings) -> tuple[PointCloud, Settings]:
    """The points of `cloud` found to be buildings', in a class that may hold roofs. Raises InputError where there are none.

    Of a cloud that is one roof, cut out beforehand, all points count.
    """
    from ..classify import BUILDING, classify

    classes = np.zeros(len(cloud), np.uint8) if cloud.classification is None else cloud.classification
    may_be = np.isin(classes, (*settings.read.building_classes, *settings.read.ground_classes))
    xyz, found = cloud.xyz[may_be], classify(cloud.xyz[may_be])
    building = found == BUILDING
    if is_one_roof(cloud, found):
        said = f"{', '.join(cloud.sources)}: taken for the points of one roof, as nothing in it looks like ground"
        warnings.warn(said, InputWarning)
        return cloud, with_read(settings, roofs="class")
    if building.any():
        roof_class = np.full(building.sum(), settings.read.building_classes[0], np.uint8)
        return dataclasses.replace(cloud, xyz=xyz[building], classification=roof_class), settings
    raise InputError(
        f"expected buildings in {', '.join(cloud.sources)}, got {len(cloud):,} points none of which lies on a smooth surface "
        "above the ground; give --footprints, or name the class that holds roofs with --building-class"
    )


def is_one_roof(cloud: PointCloud, found: np.ndarray) -> bool:
    """Whether a small cloud has nothing around its roof: hardly anything `found` (n,) to be ground but eaves, or all of it."""
    from ..classify import BUILDING, GROUND
    from ..read.split import single_building

    ground = (found == GROUND).mean()
    small = single_building(cloud) is not None
    return bool(small and (ground > MOSTLY_GROUND or (BUILDING in found and ground < HARDLY_GROUND)))


def readable_points(clouds: tuple[str, ...], settings: Settings) -> PointCloud:
    """The points of all files that can be read; the step that sorts points names the others."""
    from ..read.pointcloud import read_points

    try:
        return read_points(*clouds, settings=settings)
    except InputError:
        readable = [name for name in clouds if is_readable(name)]
        if len(readable) in (0, len(clouds)):
            raise
        return read_points(*readable, settings=settings)


def is_readable(name: str) -> bool:
    """Whether a point file can be read from end to end."""
    from ..read.pointcloud import iter_points

    try:
        for _ in iter_points(name):
            pass
    except InputError:
        return False
    return True
