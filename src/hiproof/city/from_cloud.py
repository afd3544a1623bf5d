"""The buildings of a run without footprints.

They come from a cloud of roof points, whose class is known or found.
"""

from __future__ import annotations

import warnings

from ..errors import InputError, InputWarning
from ..log import count_things
from ..model import PointCloud
from ..settings import Settings
from .classes import choose_classes
from .plan import Job


def jobs_from_cloud(
    clouds: tuple[str, ...], settings: Settings
) -> tuple[tuple[Job, ...], Settings]:
    """Return one job a building found, and the settings for its points.

    These choose all points in a cloud of roofs alone.
    """
    from ..classify.split import split_buildings

    cloud = readable_points(clouds, settings)
    buildings = split_buildings(cloud, settings)
    if settings.read.roofs == "shape" and buildings and buildings[0].is_cut_out:
        roofs = count_things(len(buildings), "roof") if len(buildings) > 1 else "one roof"
        text = (
            f"{', '.join(cloud.sources)}: taken for the points of {roofs}, as nothing in it looks "
            "like ground"
        )
        warnings.warn(text, InputWarning)
        settings = choose_classes(settings, roofs="alone")
    return tuple(
        Job(i, item.id, item.area, None, item.error) for i, item in enumerate(buildings)
    ), settings


def readable_points(clouds: tuple[str, ...], settings: Settings) -> PointCloud:
    """Read the points of all files that can be read.

    The step that sorts points names the others.
    """
    from ..read.pointcloud import read_points

    try:
        return read_points(*clouds, settings=settings)
    except InputError:
        readable = [name for name in clouds if is_readable(name)]
        if len(readable) in (0, len(clouds)):
            raise
        return read_points(*readable, settings=settings)


def is_readable(name: str) -> bool:
    """Return whether a point file can be read from end to end."""
    from ..read.pointcloud import iter_points

    try:
        for _ in iter_points(name):
            pass
    except InputError:
        return False
    return True
