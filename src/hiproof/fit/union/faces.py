"""Find the faces of a drawn roof, and hand one to the volumes beside it.

A volume that roofs a place for want of its neighbours leaves a strip along an eave there, or a
patch within a slope. Its neighbours cover that once they are drawn out over it. Where several do,
the roof is the highest of them, as everywhere.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import shapely

from .drawn_plan import DrawnPlan
from .regions import (
    PlanSite,
    find_neighbour,
    list_polygons,
    merge_inside,
    transform_places,
    widen_gap,
)
from .repairs import LOW_STEP_M, ON_M
from .sides import Side

Regions = Sequence[list[shapely.Polygon]]


class PlanFace(NamedTuple):
    """A face of a drawn plan: a `polygon` of the volume `owner`.

    `takers` are the volumes across its fold lines and low steps.
    """

    polygon: shapely.Polygon
    owner: int
    takers: frozenset[int]

    @property
    def key(self) -> tuple:
        """The values that distinguish the face from others that were tried."""
        return self.owner, self.takers, *np.round(self.polygon.bounds, 1).tolist()

    def list_choices(self) -> list[frozenset[int]]:
        """List who may take the face: one of the takers, or all of them."""
        return list(dict.fromkeys([*(frozenset([k]) for k in sorted(self.takers)), self.takers]))


def list_faces(plan_drawn: DrawnPlan) -> Iterator[PlanFace]:
    """List the faces that others may take, the smallest first."""
    owners = np.append(plan_drawn.owner[:, 0], -1)[plan_drawn.beside]  # -1 of -1, outside
    is_low = (plan_drawn.gaps.max(axis=1) < LOW_STEP_M) & (owners[:, 0] != owners[:, 1])
    if not is_low.any():
        return
    ends = plan_drawn.places[plan_drawn.edges]
    sides = {tuple(e.ravel().tolist()): (n, 0) for n, e in enumerate(ends)}
    sides |= {tuple(e[::-1].ravel().tolist()): (n, 1) for n, e in enumerate(ends)}
    polygons = list_polygons(shapely.polygonize(shapely.linestrings(ends)))
    for polygon in sorted(polygons, key=lambda polygon: polygon.area):
        oriented = shapely.orient_polygons(polygon)
        edges, ways = np.array([sides[edge] for edge in list_ring_edges(oriented)]).T
        takers = owners[edges, 1 - ways][is_low[edges]]
        if len(takers):
            yield PlanFace(polygon, int(owners[edges[0], ways[0]]), frozenset(takers.tolist()))


def list_ring_edges(polygon: shapely.Polygon) -> Iterator[tuple[float, ...]]:
    """Yield the edges of all rings of a polygon: x, y of their starts and ends."""
    for ring in (polygon.exterior, *polygon.interiors):
        xy = shapely.get_coordinates(ring)
        yield from map(tuple, np.hstack([xy[:-1], xy[1:]]).tolist())


def assign_face(face: PlanFace, takers: Iterable[int], regions: Regions, site: PlanSite) -> Regions:
    """Return the regions with a face given to the volumes `takers`.

    There are none if one of these does not touch it.
    """
    wide, assigned = widen_gap(face.polygon), list(regions)
    assigned[face.owner] = site.cut_out(regions[face.owner], wide)
    for k in takers:
        _, q = find_neighbour(wide, [regions[k]])
        merged = merge_inside(regions[k][q], wide, site.outline) if regions[k] else []
        if len(merged) != 1:
            return ()
        assigned[k] = [*regions[k][:q], merged[0], *regions[k][q + 1 :]]
    return assigned


def draw_out_sides(
    volume: np.ndarray, sides: list[Side], region: list[shapely.Polygon], site: PlanSite
) -> list[Side]:
    """Return a volume's sides, with those drawn out beyond which its `region` reaches."""
    places = transform_places(shapely.get_coordinates(region), volume, site)
    drawn_out = []
    for edge, side in enumerate(sides):
        x, y = places[:, edge // 2], places[:, 1 - edge // 2]
        offsets = x - side.lean * y
        offset = float(offsets.min() if edge % 2 == 0 else offsets.max())
        is_beyond = offset < side.offset - ON_M if edge % 2 == 0 else offset > side.offset + ON_M
        # What lies beyond ends where others do, which no points of this volume determine.
        drawn_out.append(Side(offset, side.lean, False, 0.0) if is_beyond else side)
    return drawn_out
