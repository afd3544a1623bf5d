"""The points of a building that can be used, in one order."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from ..frames import LocalFrame
from ..geometry.rings import subtract, unite
from ..read.plausible import is_plausible
from ..status import Status
from .outline import largest_polygon

FEWEST_POINTS = 4  # a roof plane and one point to doubt it; below that a building is a flat block

LINE_WIDTH_M = 0.05  # width (m) of a strip of points that is too narrow for a roof


def usable(
    points: np.ndarray, footprint: shapely.Polygon | None
) -> tuple[np.ndarray, shapely.Polygon | None, Status]:
    """Return finite, distinct points inside the footprint, whatever order they came in."""
    points = finite(points)
    if footprint is not None:
        footprint = largest_polygon(footprint)
        if not footprint.area >= 0.1:
            return np.zeros((0, 3)), None, Status.BAD_FOOTPRINT
        points = compress_inside(points, footprint)
    points = distinct(points)
    if len(points) == 0:
        return points, footprint, Status.NO_POINTS
    if footprint is None and (len(points) < FEWEST_POINTS or on_a_line(points[:, :2])):
        return points, None, Status.NO_ROOF
    return points, footprint, Status.MODELLED


def drop_neighbour_roofs(
    points: np.ndarray,
    outline: shapely.Polygon | None,
    surroundings: np.ndarray,
    neighbours: Sequence[shapely.Geometry],
    frame: LocalFrame,
) -> np.ndarray:
    """Drop the points on neighbours' roofs that reach over the outline.

    `points` (n, 3) and the outline are in the local frame, what lies around it is in the world.
    """
    if outline is None or not neighbours:
        return points
    from ..fit.neighbour_roofs import find_neighbour_roofs

    area = subtract(shapely.transform(unite(neighbours), frame.to_local), outline)
    points_beside = distinct(compress_inside(frame.to_local(finite(surroundings)), area))
    return points[~find_neighbour_roofs(points, outline, points_beside, area)]


def compress_inside(points: np.ndarray, area: shapely.Geometry) -> np.ndarray:
    """Return the points (n, 3) inside an area or on its border."""
    from ..geometry.point_in_polygon import find_inside

    return points.compress(find_inside(area, points[:, 0], points[:, 1]), axis=0)


def finite(points: np.ndarray) -> np.ndarray:
    """Return the points (n, 2 or 3) of this Earth; no value may be stored as 3.4e38."""
    is_usable = is_plausible(points)
    return points if is_usable.all() else points[is_usable]


def distinct(points: np.ndarray) -> np.ndarray:
    """Sort points (n, 3) by x, y, z, without repeats; the same set gives the same array."""
    # complex numbers are in order by x, then by y
    plan = np.ascontiguousarray(points[:, :2]).view(complex)[:, 0]
    order = np.argsort(plan)
    if (plan[order[1:]] != plan[order[:-1]]).all():  # none over another, as nearly always
        return points.take(order, axis=0)
    points = points[np.lexsort(points.T[::-1])]
    return points[np.r_[True, (points[1:] != points[:-1]).any(axis=1)]]


def on_a_line(xy: np.ndarray) -> bool:
    """Return whether plan points (n, 2) lie in a strip too narrow for a roof."""
    across = np.linalg.svd(xy - xy.mean(axis=0), full_matrices=False)[2][-1]
    return bool(np.ptp((xy - xy.mean(axis=0)) @ across) < LINE_WIDTH_M)
