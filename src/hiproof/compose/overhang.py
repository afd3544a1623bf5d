"""A solid whose roof reaches beyond its walls (LoD2.3).

The roof is composed over its own outline first, down to the ground. Its plan is then cut along the
walls and, beyond them, along the roof faces. Within the walls the solid stays as it is. Beyond them
a slab of the roof is left: it ends at a ceiling, parallel to the roof face above.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np
import shapely

from ..errors import CompositionError
from ..geometry.rings import with_area
from ..model import CEILING, ROOF, Solid, Underside
from .arrangement import GRID_M
from .lids import (
    BESIDE_EDGE_UNITS,
    ON_EDGE_UNITS,
    Lid,
    Place,
    close_lids,
    divide_edges,
    list_edges,
    list_lids,
    list_open_edges,
    list_places,
    list_rings,
    to_grid,
)
from .underside import (
    SAME_PLACE_UNITS,
    Cap,
    draw_ground,
    fit_plane,
    list_undersides,
    measure_ground,
    node_rings,
    snap_corners,
)

LEAST_CLEARANCE_M = 0.1  # between a slab and the ground; eaves of a shed may hang that low
SAME_HEIGHT_UNITS = 10  # 1 mm; heights over one place nearer than that are one
SLIVER_STRIP_UNITS = 20.0  # 2 mm; strips between walls and roof edge thinner than that are rounding


def hang_over(
    solid: Solid, underside: Underside, cap: Cap, walls: shapely.Geometry, thickness: int
) -> Solid:
    """Return a solid on one level with slabs of a `thickness` beyond `walls` (grid units)."""
    roofs = list_lids(solid, ROOF)
    inside, outside, owners = cut_plan(solid, walls)
    crossings, corners = find_crossings(roofs, thickness), list_places(roofs)
    plans = node_rings(list(map(list_rings, outside)), crossings, corners, ON_EDGE_UNITS)
    slabs = list(draw_slabs(solid, roofs, plans, owners, thickness))
    undersides = list_undersides(solid, underside, cap, inside, list_places([*roofs, *slabs]))
    hanging = [corner for slab in slabs for ring in slab.rings for corner in ring]
    ground = measure_ground((corner[:2] for corner in hanging), solid, underside, cap)
    room = GRID_M * min((z - ground[x, y] for x, y, z in hanging), default=10**9)
    if room < LEAST_CLEARANCE_M:
        raise CompositionError(
            f"expected overhangs at least {LEAST_CLEARANCE_M:g} m over the ground, got one "
            f"{room:.2f} m over it; leave them out"
        )
    return close_lids([*roofs, *undersides, *slabs])


def cut_plan(
    solid: Solid, walls: shapely.Geometry
) -> tuple[shapely.Geometry, list[shapely.Polygon], list[int]]:
    """Return the plan within the walls, and the slabs outside with their roof faces."""
    area, corners = draw_ground(solid), list_places(list_lids(solid, ROOF))
    roofs = np.array([to_grid(solid.project_face(face)) for face in solid.select_faces(ROOF)])
    edges = shapely.multilinestrings([*shapely.get_rings(roofs)])
    walls = snap_corners(walls, edges, SAME_PLACE_UNITS)
    plans = [list_rings(polygon) for polygon in [area, *roofs]]
    places = set(itertools.chain(*itertools.chain(*plans)))
    feet = [list_rings(polygon) for polygon in shapely.get_parts(with_area(walls))]
    feet = node_rings(feet, places, corners, SAME_PLACE_UNITS)
    rings = node_rings([*feet, *plans], set(), corners, ON_EDGE_UNITS)
    lines = shapely.union_all(
        [shapely.linearrings(ring) for ring in itertools.chain(*rings)], grid_size=1.0
    )
    cells = shapely.get_parts(shapely.polygonize(shapely.get_parts(lines)))
    middles = shapely.point_on_surface(cells)
    cells, middles = (a[shapely.contains(area, middles)] for a in (cells, middles))
    is_inside = shapely.contains(walls, middles)
    is_inside |= find_slivers(cells, shapely.boundary(walls))
    inside = shapely.union_all(cells[is_inside], grid_size=1.0)
    owners = shapely.distance(middles[:, None], roofs[None]).argmin(axis=1)
    return (
        shapely.simplify(inside, BESIDE_EDGE_UNITS),
        list(cells[~is_inside]),
        owners[~is_inside].tolist(),
    )


def find_crossings(roofs: list[Lid], thickness: int) -> set[Place]:
    """Return the places at which the slab above a step passes the roof below it."""
    edges = (edge for lid in roofs for ring in lid.rings for edge in list_edges(ring))
    crossings = set()
    for step in list_open_edges({edge: list(edge) for edge in edges}):
        if len(step) != 2:
            continue
        (low_end, low_start), (high_start, high_end) = step
        first, last = (
            high[2] - low[2] - thickness
            for low, high in ((low_start, high_start), (low_end, high_end))
        )
        if first * last < 0 and min(abs(first), abs(last)) > SAME_HEIGHT_UNITS:
            start, end = np.array((high_start[:2], high_end[:2]))
            x, y = np.rint(start + first / (first - last) * (end - start)).astype(int).tolist()
            crossings.add((x, y))
    return crossings


def draw_slabs(
    solid: Solid,
    roofs: list[Lid],
    plans: list[list[list[Place]]],
    owners: list[int],
    thickness: int,
) -> Iterable[Lid]:
    """Yield the ceiling of each slab under its roof face; heights that all but meet are one."""
    places = np.array(list(set(itertools.chain(*itertools.chain(*plans)))))
    fixed: dict[Place, set[int]] = {}
    edges = (edge for lid in roofs for ring in lid.rings for edge in list_edges(ring))
    for x, y, z in itertools.chain(*divide_edges(edges, places).values()):
        fixed.setdefault((x, y), set()).add(z)
    faces = solid.select_faces(ROOF)
    for rings, owner in zip(plans, owners, strict=True):
        a, b, c = fit_plane(solid, faces[owner])
        heights: dict[Place, int] = {}
        for place in itertools.chain(*rings):
            z = round(a * place[0] + b * place[1] + c / GRID_M) - thickness
            known = fixed.setdefault(place, set())
            nearest = min(known, key=lambda other: abs(other - z), default=z)
            heights[place] = nearest if abs(nearest - z) <= SAME_HEIGHT_UNITS else z
            known.add(heights[place])
        yield Lid([[(*place, heights[place]) for place in ring[::-1]] for ring in rings], CEILING)


def find_slivers(cells: np.ndarray, walls: shapely.Geometry) -> np.ndarray:
    """Return whether cells (n,) are rounding along the walls' outline."""
    is_thin = shapely.is_empty(shapely.buffer(cells, -SLIVER_STRIP_UNITS / 2))
    shared = shapely.length(shapely.intersection(shapely.boundary(cells), walls))
    return is_thin & (shared > 0.0)
