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
from .regions import OVERLAY_GAP_M, PlanSite, list_polygons, transform_places
from .sides import Side
from .volumes import LEVEL

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
        if polygons and is_level(planes[k], place_corners(polygons, volumes[k], site))
    ]
    rows = np.array([planes[k].rows[LEVEL] for k in level]).reshape(-1, 3)
    equal = equal_planes(rows, EQUAL_PLANE)
    for first in sorted(set(equal.tolist())):
        numbers = [k for k, other in zip(level, equal, strict=True) if other == first]
        for polygon, (owner, *joined) in find_touching(numbers, regions):
            for k in joined:
                regions[k] = []
            if owner == 0:
                touched = widen(polygon)
                regions[0] = [*(p for p in regions[0] if not touched.covers(p)), polygon]
                continue
            regions[owner] = [polygon]
            corners = place_corners([polygon], volumes[owner], site)
            ends = np.stack([corners.min(axis=0), corners.max(axis=0)], axis=1)
            sides[owner] = [Side(float(end)) for end in ends.ravel()]
    return sides, regions


def place_corners(
    polygons: list[shapely.Polygon], volume: np.ndarray, site: PlanSite
) -> np.ndarray:
    """Return the polygons' corners (n, 2) in a volume's axes."""
    return transform_places(shapely.get_coordinates(polygons), volume, site)


def is_level(planes: Planes, corners: np.ndarray) -> bool:
    """Return whether only the level plane is visible over corners (n, 2)."""
    positions = np.column_stack([corners, np.ones(len(corners))])
    return bool(np.flatnonzero(find_visible_planes(planes.rows, positions)).tolist() == [LEVEL])


def find_touching(numbers: list[int], regions: Regions) -> list[tuple[shapely.Polygon, list[int]]]:
    """Find volumes whose regions are one polygon together, with it.

    The base comes first, of which each polygon counts by itself, then the largest.
    """
    if len(numbers) < 2:
        return []
    areas = {k: shapely.union_all(regions[k], grid_size=OVERLAY_GRID_M) for k in numbers}
    touching = []
    for polygon in list_polygons(shapely.union_all(list(areas.values()), grid_size=OVERLAY_GRID_M)):
        touched = widen(polygon)
        inside = [
            k
            for k, area in areas.items()
            if any(touched.covers(p) for p in ([area] if k else list_polygons(area)))
        ]
        if len(inside) > 1:
            touching.append((polygon, sorted(inside, key=lambda k: (k > 0, -areas[k].area))))
    return touching


def widen(polygon: shapely.Polygon) -> shapely.Polygon:
    """Return what a polygon touches but for rounding."""
    return polygon.buffer(OVERLAY_GAP_M)
