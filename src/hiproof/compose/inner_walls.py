"""Walls inside the outline of a roof that overhangs them, in plan."""

from __future__ import annotations

import numpy as np
import shapely

from ..errors import CompositionError
from ..geometry.components import label_components
from ..geometry.outline_edges import FARTHEST_MITRE, list_outline_edges, make_strips
from ..geometry.rings import OVERLAY_GRID_M, repair_polygons, with_area
from ..model import GROUND, ROOF, Solid

CORNER_GAP_M = 0.002  # between corners of walls; rounding may part one corner by less


def set_walls_in(
    outline: shapely.Polygon, widths: np.ndarray, least_width_m: float
) -> shapely.Geometry:
    """Return the areas within walls that stand `widths` (n,) inside an outline.

    Walls that would stand less than `least_width_m` apart are left out: the roof there is a slab.
    """
    strips = make_strips(list_outline_edges(outline), widths, side=-1.0)
    taken = [repair_polygons(shapely.polygons(strips[k])) for k in np.flatnonzero(widths)]
    rest = shapely.difference(outline, shapely.union_all(taken), grid_size=OVERLAY_GRID_M)
    walls = tidy_walls(rest, outline, least_width_m)
    if walls.is_empty:
        raise CompositionError(
            "expected walls within the roof, got none; assume a shorter overhang"
        )
    return walls


def tidy_walls(
    walls: shapely.Geometry, outline: shapely.Polygon, least_width_m: float
) -> shapely.Geometry:
    """Return the areas within walls without narrow ones and narrow gaps."""
    half = least_width_m / 2
    wide = offset(offset(offset(walls, -half), least_width_m), -half)
    return with_area(shapely.simplify(shapely.intersection(wide, outline), CORNER_GAP_M))


def join_walls(
    walls: shapely.Geometry, loose: shapely.Geometry, width_m: float
) -> shapely.Geometry:
    """Return `walls` with what lies between those of loose roofs and others.

    That is where the walls of both would meet if they grew by `width_m`.
    """
    joined = offset(offset(walls, width_m), -width_m)
    return shapely.union(walls, shapely.intersection(joined, offset(loose, width_m)))


def offset(area: shapely.Geometry, distance_m: float) -> shapely.Geometry:
    """Return an area whose border has moved outwards, with sharp corners."""
    return shapely.buffer(area, distance_m, join_style="mitre", mitre_limit=FARTHEST_MITRE)


def find_loose_roofs(solid: Solid) -> tuple[shapely.Geometry, shapely.Geometry]:
    """Return the plan of roofs on no walls, and of those on walls apart from others."""
    links = [
        (ring[0], vertex) for face in solid.faces for ring in face.rings for vertex in ring[1:]
    ]
    links += [(face.rings[0][0], ring[0]) for face in solid.faces for ring in face.rings[1:]]
    label = label_components(len(solid.vertices), np.array(links).T)
    grounds, roofs = (
        [(label[face.rings[0][0]], solid.project_face(face)) for face in solid.select_faces(kind)]
        for kind in (GROUND, ROOF)
    )
    largest, _ = max(grounds, key=lambda item: item[1].area)
    standing = {number for number, _ in grounds}
    hanging = [area for number, area in roofs if number not in standing]
    apart = [area for number, area in roofs if number in standing - {largest}]
    return shapely.union_all(hanging), shapely.union_all(apart)
