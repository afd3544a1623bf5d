"""Join the regions of volumes that touch at one level.

The search lays rectangles side by side where the outline of a level roof is none. Once their
heights agree, they are one flat part.
"""

from __future__ import annotations

import numpy as np
import shapely

from ...compose.cells import equal_planes
from ...geometry.rings import OVERLAY_GRID_M
from .drawn_plan import EQUAL_PLANE
from .finish import Planes
from .names import find_visible_planes
from .regions import OVERLAY_GAP_M, PlanSite, list_polygons
from .sides import Side
from .volumes import DIRECTION, LEVEL

Regions = list[list[shapely.Polygon]]


def join_levels(
    volumes: np.ndarray,
    sides: list[list[Side]],
    planes: list[Planes],
    regions: Regions,
    site: PlanSite,
) -> tuple[list[list[Side]], Regions]:
    """Return the sides and regions of volumes, those at one level that touch as one.

    What touches the base becomes the base's. Of other volumes, the largest takes what all have.
    """
    sides, regions = list(sides), list(regions)
    level = [
        k
        for k, polygons in enumerate(regions)
        if polygons and is_level(planes[k], place_corners(volumes[k], polygons, site))
    ]
    rows = np.array([planes[k].rows[LEVEL] for k in level]).reshape(-1, 3)
    equal = equal_planes(rows, EQUAL_PLANE)
    for first in sorted(set(equal.tolist())):
        numbers = [k for k, other in zip(level, equal, strict=True) if other == first]
        for polygon, (owner, *joined) in find_touching(numbers, regions):
            for k in joined:
                regions[k] = []
            if owner == 0:
                regions[0] = [*(p for p in regions[0] if not is_inside(p, polygon)), polygon]
                continue
            regions[owner] = [polygon]
            positions = place_corners(volumes[owner], [polygon], site)
            ends = np.stack([positions.min(axis=0), positions.max(axis=0)], axis=1)[:2]
            sides[owner] = [Side(float(end)) for end in ends.ravel()]
    return sides, regions


def place_corners(
    volume: np.ndarray, polygons: list[shapely.Polygon], site: PlanSite
) -> np.ndarray:
    """Return u, v, 1 (n, 3) of polygons' corners in the axes of a volume."""
    c, s = site.scene.turn[int(volume[DIRECTION])]
    axes = np.array([[c, s], [-s, c]]) @ site.plan.frame.rotation
    corners = shapely.get_coordinates(polygons) - site.plan.frame.origin[:2]
    return np.column_stack([corners @ axes.T, np.ones(len(corners))])


def is_level(planes: Planes, positions: np.ndarray) -> bool:
    """Return whether only the level plane is visible over corners (n, 3) at u, v, 1."""
    return bool(np.flatnonzero(find_visible_planes(planes.rows, positions)).tolist() == [LEVEL])


def find_touching(numbers: list[int], regions: Regions) -> list[tuple[shapely.Polygon, list[int]]]:
    """Find volumes whose regions are one polygon together, with it.

    The base comes first, of which each polygon counts by itself, then the largest.
    """
    areas = {k: shapely.union_all(regions[k], grid_size=OVERLAY_GRID_M) for k in numbers}
    touching = []
    for polygon in list_polygons(shapely.union_all(list(areas.values()), grid_size=OVERLAY_GRID_M)):
        inside = [
            k
            for k, area in areas.items()
            if any(is_inside(p, polygon) for p in ([area] if k else list_polygons(area)))
        ]
        if len(inside) > 1:
            touching.append((polygon, sorted(inside, key=lambda k: (k > 0, -areas[k].area))))
    return touching


def is_inside(area: shapely.Geometry, polygon: shapely.Polygon) -> bool:
    return bool(polygon.buffer(OVERLAY_GAP_M).covers(area))
