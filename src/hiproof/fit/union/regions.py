"""Where each volume roofs the outline: inside its four sides, less what a later one replaces."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import shapely

from ...geometry.rings import OVERLAY_GRID_M, with_area
from ...model import Part
from .apart import IN_LINE_M
from .finish import Planes
from .objective import misfits
from .plan import Plan
from .prices import SHAPE_UNITS
from .scene import Scene
from .sides import Side, corners_of
from .volumes import DIRECTION, LEVEL, OFFSET, REPLACES, U0, V1
from .whole import PLACE

# a gap may be the base's where a disc of this radius fits, and is not where it is smaller than that
THICK_M, THICK_M2 = 0.25, 0.19
SHOWS_M = 0.25  # the base shows within a volume where it is above it by more
# of the base apart from the rest of it, from which on that is a part; of what lies between, that is roofed where it runs on
PLACE_M2, ROOFED = 1.0, 0.5
APART_M = 1e-5  # further apart, rounding to the grid of overlays lets no polygons touch
FAR_M = 1e4  # m beyond all of an outline
TURN_M2 = 1e-6  # of the parallelogram that two sides of a volume span; numerically none below


class Site(NamedTuple):
    """What volumes are cut to: an outline (local coordinates), or the part of one in a window.

    Overlays are `known` once they were made: of a roof that changes in one place, most stay.
    """

    outline: shapely.Polygon
    plan: Plan
    scene: Scene
    known: dict

    def once(self, find: Callable[..., Any], *of: Any) -> Any:
        """What `find` makes of these very objects, found the first time that it is asked for."""
        key = find, *map(id, of)
        if key not in self.known:
            self.known[key] = find(*of), of  # no other object takes the number of one that is held
        return self.known[key][0]

    def quad(self, volume: np.ndarray, sides: list[Side]) -> tuple[shapely.Polygon, shapely.Geometry]:
        """A volume's plan, and what of it lies inside the outline."""
        key = volume[PLACE].tobytes(), *sides
        if key not in self.known:
            quad = quad_of(volume, sides, self.plan, self.scene)
            self.known[key] = quad, shapely.intersection(quad, self.outline, grid_size=OVERLAY_GRID_M)
        return self.known[key]

    def rest(self, quads: list[shapely.Polygon]) -> list[shapely.Polygon]:
        """What of the outline lies in no quad."""
        return self.once(rest_of, self.outline, *quads)

    def cut_out(
        self, polygons: list[shapely.Polygon], hole: shapely.Polygon
    ) -> list[shapely.Polygon]:
        """What is left of the polygons without the `hole`."""
        return [left for polygon in polygons for left in self.once(difference, polygon, hole)]


def regions_of(
    volumes: np.ndarray, planes: list[Planes], sides: list[list[Side]], site: Site, base: bool
) -> list[list[shapely.Polygon]]:
    """For each volume the polygons (local coordinates) of the site's outline that it may roof.

    They overlap, as volumes do. What a later volume replaces is cut out. With `base`, what no other
    covers is the base's, and what rises through others.
    """
    cut = [site.quad(volume, own) for volume, own in zip(volumes[1:], sides[1:], strict=True)]
    regions = [polygons_of(site.outline) if base or len(volumes) == 1 else []]
    for k, (quad, own) in enumerate(cut, start=1):
        if volumes[k, REPLACES]:
            regions = [site.cut_out(before, quad) for before in regions]
        elif regions[0] and not rises_through(volumes[0, OFFSET + LEVEL], volumes[k], planes[k], own, site):
            regions[0] = site.cut_out(regions[0], quad)
        regions.append(polygons_of(own))
    return regions if len(volumes) == 1 else gaps_filled(volumes, planes, regions, [quad for quad, _ in cut], site)


def places_of(
    regions: list[list[shapely.Polygon]], outline: shapely.Polygon, plan: Plan
) -> Iterator[tuple[int, list[shapely.Polygon]]]:
    """Which volume roofs which polygons, each to be one part: what lies apart of the base are several, such as two wings."""
    places: list[list[shapely.Polygon]] = []
    for polygon in sorted(polygons_of(shapely.union_all(regions[0], grid_size=OVERLAY_GRID_M)), key=lambda p: -p.area):
        alike = (
            places if polygon.area < PLACE_M2 else (own for own in places if runs_on(own[0], polygon, outline, plan))
        )
        own = next(iter(alike), None)
        if own is None:
            places.append([polygon])
        else:
            own.append(polygon)
    yield from ((0, own) for own in places)
    yield from ((k, own) for k, own in enumerate(regions) if k > 0 and own)


def runs_on(one: shapely.Polygon, other: shapely.Polygon, outline: shapely.Polygon, plan: Plan) -> bool:
    """Whether a roof may run on from one place to another under what stands between: no yard, nor a house in a row with them."""
    both = with_area(shapely.union(one, other, grid_size=OVERLAY_GRID_M))
    between = shapely.difference(shapely.convex_hull(both), both)
    if shapely.intersection(between, outline).area <= ROOFED * between.area:
        return False
    whole, *places = (shapely.transform(p, lambda xy: xy @ plan.frame.rotation.T) for p in (outline, one, other))
    low, high = (shapely.bounds(places)[:, ends] for ends in ([0, 1], [2, 3]))
    for axis in (0, 1):
        start, end = high[:, axis].min(), low[:, axis].max()
        if start < end:
            strip = [start, -FAR_M, end, FAR_M] if axis == 0 else [-FAR_M, start, FAR_M, end]
            hides = shapely.bounds(shapely.clip_by_rect(whole, *strip))[[1 - axis, 3 - axis]]
            deepest = low[:, 1 - axis].min() - IN_LINE_M, high[:, 1 - axis].max() + IN_LINE_M
            return bool(hides[0] < deepest[0] or hides[1] > deepest[1])
    return True


def quad_of(volume: np.ndarray, sides: list[Side], plan: Plan, scene: Scene) -> shapely.Polygon:
    """A volume's plan in local coordinates: inside its sides, or its rectangle where these cross within it."""
    c, s = scene.turn[int(volume[DIRECTION])]
    for own in (sides, [Side(float(x)) for x in volume[U0 : V1 + 1]]):
        ring = plan.frame.xy_local(corners_of(own) @ np.array([[c, s], [-s, c]]))
        quad = shapely.polygons(ring)
        if is_convex(ring.tolist()) or (quad.is_valid and quad.exterior.is_ccw):
            return quad
    return quad


def is_convex(ring: list[list[float]]) -> bool:
    """Whether four corners clearly turn to the left one after another."""
    ways = [(x - u, y - v) for (u, v), (x, y) in pairwise([*ring, ring[0]])]
    turns = [a * d - b * c for (a, b), (c, d) in pairwise([*ways, ways[0]])]
    return min(turns) > TURN_M2


def rises_through(base: float, volume: np.ndarray, planes: Planes, region: shapely.Geometry, site: Site) -> bool:
    """Whether the level base is noticeably above the volume somewhere over its region, and no worse for the points there."""
    corners = shapely.get_coordinates(region)
    if not len(corners) or not (heights_over(volume, planes, corners, site) < base - SHOWS_M).any():
        return False
    xy, z = points_in(region, site)
    height = heights_over(volume, planes, xy, site)
    below = height < base
    at_base, at_volume = misfits(z[below], base, site.scene), misfits(z[below], height[below], site.scene)
    return bool(at_base.sum() <= at_volume.sum())


def points_in(region: shapely.Geometry, site: Site) -> tuple[np.ndarray, np.ndarray]:
    """The points inside a region: local x, y (n, 2) and the plan's z (n,)."""
    _, plan, scene, _ = site
    xy = plan.frame.xy_local(np.column_stack([scene.U[0, : scene.n], scene.V[0, : scene.n]]))
    inside = shapely.contains_xy(region, xy[:, 0], xy[:, 1])
    return xy[inside], scene.z[: scene.n][inside]


def heights_over(volume: np.ndarray, planes: Planes, xy: np.ndarray, site: Site) -> np.ndarray:
    """Heights (n,) of a volume, in the plan's z, at local `xy` (n, 2)."""
    _, plan, scene, _ = site
    c, s = scene.turn[int(volume[DIRECTION])]
    uv = (xy - plan.frame.origin[:2]) @ plan.frame.rotation.T @ np.array([[c, -s], [s, c]])
    rows = planes.rows[np.isfinite(planes.rows[:, 2])]
    return (np.column_stack([uv, np.ones(len(uv))]) @ rows.T).min(axis=1)


def polygons_of(geometry: shapely.Geometry) -> list[shapely.Polygon]:
    parts = getattr(geometry, "geoms", (geometry,))
    return [part for part in parts if part.geom_type == "Polygon" and part.area > 1e-9]


def difference(polygon: shapely.Polygon, hole: shapely.Polygon) -> list[shapely.Polygon]:
    """What is left of a polygon without a hole."""
    if not shapely.dwithin(polygon, hole, APART_M):
        return [polygon]
    if polygon.area < hole.area and shapely.contains_properly(hole, polygon):
        return []
    return polygons_of(shapely.difference(polygon, hole, grid_size=OVERLAY_GRID_M))


def rest_of(outline: shapely.Polygon, *quads: shapely.Polygon) -> list[shapely.Polygon]:
    """What of an outline lies in no quad."""
    covered = with_area(shapely.union_all(quads, grid_size=OVERLAY_GRID_M))
    return difference(outline, covered)


def area_of(parts: Iterable[Part]) -> shapely.Geometry:
    """What parts cover together, without the lines to which slivers shrink on the grid."""
    return with_area(shapely.union_all([piece.outline for part in parts for piece in part.pieces], grid_size=OVERLAY_GRID_M))


def besides(parts: Iterable[Part], some: Iterable[Part]) -> list[Part]:
    """The parts that are none of `some`."""
    return [part for part in parts if not any(part is one for one in some)]


def gaps_filled(
    volumes: np.ndarray, planes: list[Planes], regions: list[list], quads: list[shapely.Polygon], site: Site
) -> list[list]:
    """The regions with every rest of the outline given to the volume beside it, or left to the base where points say so."""
    for gap in site.rest(quads):
        near = site.once(widened, gap)
        k, q = place_beside(near, [[], *regions[1:]], partial(site.once, shared_area))
        if k > 0 and not (regions[0] and is_base(gap, volumes[0], volumes[k], planes[k], site)):
            merged = site.once(merged_inside, regions[k][q], near, site.outline)
            if len(merged) == 1:
                regions[k][q] = merged[0]
                regions[0] = site.cut_out(regions[0], near)
                continue
        if not is_covered(gap, regions[0]):
            regions[0].append(gap)
    return regions


def widened(gap: shapely.Polygon) -> shapely.Polygon:
    """The `gap` a millimetre wider."""
    return shapely.buffer(gap, 1e-3, quad_segs=1)


def merged_inside(
    polygon: shapely.Polygon, near: shapely.Polygon, outline: shapely.Polygon
) -> list[shapely.Polygon]:
    """What two polygons cover together of an outline."""
    wider = with_area(shapely.union_all([polygon, near], grid_size=OVERLAY_GRID_M))
    return polygons_of(shapely.intersection(wider, outline, grid_size=OVERLAY_GRID_M))


def shared_area(one: shapely.Polygon, other: shapely.Polygon) -> float:
    return shapely.intersection(one, other, grid_size=OVERLAY_GRID_M).area


def place_beside(
    near: shapely.Polygon,
    polygons: list[list[shapely.Polygon]],
    area: Callable[..., float] = shared_area,
) -> tuple[int, int]:
    """The two indices of that of the `polygons` which shares most `area` with `near`, or zeros."""
    places = [(k, q) for k, own in enumerate(polygons) for q in range(len(own))]
    if not places:
        return 0, 0
    touch = shapely.intersects(near, [p for own in polygons for p in own])
    beside = [place for place, there in zip(places, touch.tolist(), strict=True) if there]
    if len(beside) > 1:
        areas = [area(near, polygons[k][q]) for k, q in beside]
        beside = [max(zip(areas, beside, strict=True))[1]]
    return beside[0] if beside else (0, 0)


def is_covered(gap: shapely.Polygon, polygons: list[shapely.Polygon]) -> bool:
    """Whether the polygons cover a gap together, but for a millimetre."""
    if any(shapely.covers(polygon, gap) for polygon in polygons):
        return True
    return bool(shapely.covers(shapely.union_all(polygons, grid_size=OVERLAY_GRID_M).buffer(1e-3), gap))


def is_base(gap: shapely.Polygon, base: np.ndarray, volume: np.ndarray, planes: Planes, site: Site) -> bool:
    """Whether a gap is wide enough to be drawn and its points lie on the base rather than on its neighbour continued."""
    if gap.area < THICK_M2 or shapely.buffer(gap, -THICK_M).is_empty:
        return False
    xy, z = points_in(gap, site)
    continued = misfits(z, heights_over(volume, planes, xy, site), site.scene).sum()
    gain = continued - misfits(z, base[OFFSET + LEVEL], site.scene).sum()
    return not len(z) or bool(gain > SHAPE_UNITS * site.scene.evidence)
