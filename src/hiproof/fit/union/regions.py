"""Cut the outline into the regions that volumes roof.

A region lies inside a volume's four sides, without what a later volume replaces.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import shapely

from ...geometry.point_in_polygon import find_inside
from ...geometry.rings import OVERLAY_GRID_M, with_area
from ...model import Part
from .apart import ROW_DEPTH_M
from .finish import Planes
from .objective import compute_misfits
from .plan import Plan
from .prices import SHAPE_UNITS
from .scene import Scene
from .sides import Side, find_corners
from .volumes import DIRECTION, LEVEL, OFFSET0, REPLACES, U0, V1
from .whole import POSITION

THICK_M = 0.25  # A gap may be the base's if a disc of this radius (m) fits in.
THICK_M2 = 0.19  # A smaller gap (m2) is not the base's.
SHOWS_M = 0.25  # The base is visible within a volume where it is higher by more (m).
PLACE_M2 = 1.0  # Least area (m2) of the base, apart from the rest of it, that is a part.
ROOFED_SHARE = 0.5  # Share between two places that is roofed if the roof continues.
# Polygons further apart (m) do not touch after rounding to the grid of overlays.
OVERLAY_GAP_M = 1e-5
FAR_M = 1e4  # A distance (m) beyond all of an outline.
TURN_M2 = 1e-6  # Least area (m2) of the parallelogram that two sides span: numerically none below.


class PlanSite(NamedTuple):
    """What volumes are cut to: an outline in local coordinates, or a part of one.

    Overlays are kept in `cache`: of a roof that changes in one place, most stay.
    """

    outline: shapely.Polygon
    plan: Plan
    scene: Scene
    cache: dict

    def recall(self, find: Callable[..., Any], *arguments: Any) -> Any:
        """Return what `find` makes of these very objects, computed once."""
        key = find, *map(id, arguments)
        if key not in self.cache:
            # The cache holds the objects, so that no other object takes their numbers.
            self.cache[key] = (
                find(*arguments),
                arguments,
            )
        return self.cache[key][0]

    def draw_quad(self, volume: np.ndarray, sides: list[Side]) -> shapely.Polygon:
        """Return a volume's plan."""
        key = volume[POSITION].tobytes(), id(sides)
        if key not in self.cache:
            self.cache[key] = draw_quad(volume, sides, self.plan, self.scene), sides
        return self.cache[key][0]

    def turn_planes(self, volume: np.ndarray, planes: Planes) -> tuple[np.ndarray, list[int]]:
        """Return a volume's planes (k, 3) over local x, y, 1, and their numbers."""
        key = "planes", id(planes)
        if key not in self.cache:
            numbers = np.flatnonzero(np.isfinite(planes.rows[:, 2]))
            turn = self.scene.turn[int(volume[DIRECTION])]
            rows = transform_planes(planes.rows[numbers], turn, self.plan)
            self.cache[key] = (rows, numbers.tolist()), planes
        return self.cache[key][0]

    def cut_quad(self, quad: shapely.Polygon) -> shapely.Geometry:
        """Return the part of a volume's plan inside the outline."""
        return self.recall(cut_to_outline, quad, self.outline)

    def cut_out(
        self, polygons: list[shapely.Polygon], hole: shapely.Polygon
    ) -> list[shapely.Polygon]:
        """Return the polygons without the `hole`."""
        return [
            remainder
            for polygon in polygons
            for remainder in self.recall(subtract_hole, polygon, hole)
        ]

    def cut_all_regions(
        self, regions: list[list[shapely.Polygon]], hole: shapely.Polygon
    ) -> list[list[shapely.Polygon]]:
        """Return the regions without the `hole`, which touches few of them."""
        places = [k for k, region in enumerate(regions) for _ in region]
        polygons = [polygon for region in regions for polygon in region]
        is_near = shapely.dwithin(polygons, hole, OVERLAY_GAP_M)
        near_regions = {places[n] for n in np.flatnonzero(is_near).tolist()}
        return [
            self.cut_out(region, hole) if k in near_regions else region
            for k, region in enumerate(regions)
        ]


def cut_regions(
    volumes: np.ndarray,
    sketch: list[list[shapely.Polygon]],
    sides: list[list[Side]],
    site: PlanSite,
) -> list[list[shapely.Polygon]]:
    """Return, for each volume, the polygons of the site's outline that it may roof.

    They are those of a `sketch` inside the outline. The volume beside a gap has it, too.
    """
    base_region = list(sketch[0])
    regions = [base_region]
    for quads in sketch[1:]:
        regions.append([p for quad in quads for p in list_polygons(site.cut_quad(quad))])
    for gap in find_gaps(volumes, sides, site):
        if any(gap is polygon for polygon in base_region):
            continue
        wide_gap = site.recall(widen_gap, gap)
        k, q = find_neighbour(wide_gap, [[], *regions[1:]], site)
        merged = site.recall(merge_inside, regions[k][q], wide_gap, site.outline) if k > 0 else []
        if len(merged) == 1:
            regions[k][q] = merged[0]
        else:
            base_region.append(gap)
    return regions


def sketch_regions(
    volumes: np.ndarray, planes: list[Planes], sides: list[list[Side]], site: PlanSite, base: bool
) -> list[list[shapely.Polygon]]:
    """Return, for each volume, the polygons that it may roof.

    They are in local coordinates, and overlap as volumes do. What a later volume replaces is cut
    out. With `base`, the base has gaps between the volumes, and what rises through others. Polygons
    of the others reach beyond the outline and leave gaps along it, both of which
    `compose.cells.arrange` takes care of. So hardly an overlay is necessary.
    """
    if len(volumes) == 1:
        return [list_polygons(site.outline)]
    pairs = zip(volumes[1:], sides[1:], strict=True)
    quads = [site.draw_quad(volume, volume_sides) for volume, volume_sides in pairs]
    lower = [
        base and is_base_above(volumes[0, OFFSET0 + LEVEL], volume, volume_planes, quad, site)
        for volume, volume_planes, quad in zip(volumes[1:], planes[1:], quads, strict=True)
    ]
    lower_quads = [quad for quad, is_lower in zip(quads, lower, strict=True) if is_lower]
    regions = [[p for quad in lower_quads for p in list_polygons(site.cut_quad(quad))]]
    for volume, quad, is_lower in zip(volumes[1:], quads, lower, strict=True):
        if volume[REPLACES]:
            regions = site.cut_all_regions(regions, quad)
        elif not is_lower:
            regions[0] = site.cut_out(regions[0], quad)
        regions.append([quad])
    for gap in find_gaps(volumes, sides, site) if base else ():
        k, _ = find_neighbour(site.recall(widen_gap, gap), [[], *regions[1:]], site)
        if k == 0 or is_base_gap(gap, volumes[0], volumes[k], planes[k], site):
            regions[0].append(gap)
    return regions


def find_gaps(
    volumes: np.ndarray, sides: list[list[Side]], site: PlanSite
) -> list[shapely.Polygon]:
    """Return the part of the outline that lies in no volume but the base."""
    gaps = [site.outline] if len(volumes) > 1 else []
    for volume, volume_sides in zip(volumes[1:], sides[1:], strict=True):
        gaps = site.cut_out(gaps, site.draw_quad(volume, volume_sides))
    return gaps


def list_part_polygons(
    regions: list[list[shapely.Polygon]], outline: shapely.Polygon, plan: Plan
) -> Iterator[tuple[int, list[shapely.Polygon]]]:
    """Yield which volume roofs which polygons, each to be one part.

    Places of the base that lie apart, such as two wings, are several parts.
    """
    places: list[list[shapely.Polygon]] = []
    for polygon in sorted(
        list_polygons(shapely.union_all(regions[0], grid_size=OVERLAY_GRID_M)),
        key=lambda p: -p.area,
    ):
        alike = (
            places
            if polygon.area < PLACE_M2
            else (group for group in places if is_continuous(group[0], polygon, outline, plan))
        )
        group = next(iter(alike), None)
        if group is None:
            places.append([polygon])
        else:
            group.append(polygon)
    yield from ((0, group) for group in places)
    yield from ((k, group) for k, group in enumerate(regions) if k > 0 and group)


def is_continuous(
    polygon: shapely.Polygon, other: shapely.Polygon, outline: shapely.Polygon, plan: Plan
) -> bool:
    """Return whether a roof may continue between two places under what stands there.

    Neither a yard nor a house in a row with them stands there.
    """
    joint = with_area(shapely.union(polygon, other, grid_size=OVERLAY_GRID_M))
    gap = shapely.difference(shapely.convex_hull(joint), joint)
    if shapely.intersection(gap, outline).area <= ROOFED_SHARE * gap.area:
        return False
    whole, *places = (
        shapely.transform(p, lambda xy: xy @ plan.frame.rotation.T)
        for p in (outline, polygon, other)
    )
    lowers, uppers = (shapely.bounds(places)[:, ends] for ends in ([0, 1], [2, 3]))
    for axis in (0, 1):
        start, end = uppers[:, axis].min(), lowers[:, axis].max()
        if start < end:
            strip = [start, -FAR_M, end, FAR_M] if axis == 0 else [-FAR_M, start, FAR_M, end]
            hides = shapely.bounds(shapely.clip_by_rect(whole, *strip))[[1 - axis, 3 - axis]]
            deepest = (
                lowers[:, 1 - axis].min() - ROW_DEPTH_M,
                uppers[:, 1 - axis].max() + ROW_DEPTH_M,
            )
            return bool(hides[0] < deepest[0] or hides[1] > deepest[1])
    return True


def draw_quad(volume: np.ndarray, sides: list[Side], plan: Plan, scene: Scene) -> shapely.Polygon:
    """Draw a volume's plan in local coordinates, inside its sides.

    It is its rectangle where the sides cross within it.
    """
    c, s = scene.turn[int(volume[DIRECTION])]
    for quad_sides in (sides, [Side(float(x)) for x in volume[U0 : V1 + 1]]):
        ring = plan.frame.xy_local(find_corners(quad_sides) @ np.array([[c, s], [-s, c]]))
        quad = shapely.polygons(ring)
        if is_convex(ring.tolist()) or (quad.is_valid and quad.exterior.is_ccw):
            return quad
    return quad


def is_convex(ring: list[list[float]]) -> bool:
    """Return whether four corners clearly turn to the left one after another."""
    ways = [(x - u, y - v) for (u, v), (x, y) in pairwise([*ring, ring[0]])]
    turns = [a * d - b * c for (a, b), (c, d) in pairwise([*ways, ways[0]])]
    return min(turns) > TURN_M2


def is_base_above(
    base: float, volume: np.ndarray, planes: Planes, quad: shapely.Polygon, site: PlanSite
) -> bool:
    """Return whether the level base is noticeably above the volume in its plan.

    It must be no worse for the points there.
    """
    corners = shapely.get_coordinates(quad)  # No place between them is lower.
    if not (compute_volume_heights(volume, planes, corners, site) < base - SHOWS_M).any():
        return False
    region = site.cut_quad(quad)
    corners = shapely.get_coordinates(region)
    if not (compute_volume_heights(volume, planes, corners, site) < base - SHOWS_M).any():
        return False
    xy, z = select_points_in(region, site)
    height = compute_volume_heights(volume, planes, xy, site)
    is_below = height < base
    at_base, at_volume = (
        compute_misfits(z[is_below], base, site.scene),
        compute_misfits(z[is_below], height[is_below], site.scene),
    )
    return bool(at_base.sum() <= at_volume.sum())


def select_points_in(region: shapely.Geometry, site: PlanSite) -> tuple[np.ndarray, np.ndarray]:
    """Return the points inside a region: local x, y (n, 2) and the plan's z (n,)."""
    xy = site.recall(locate_points, site.scene, site.plan)
    inside = find_inside(region, xy[:, 0], xy[:, 1])
    return xy[inside], site.scene.z[: site.scene.n][inside]


def locate_points(scene: Scene, plan: Plan) -> np.ndarray:
    """Return local x, y (n, 2) of a scene's points."""
    return plan.frame.xy_local(np.column_stack([scene.U[0, : scene.n], scene.V[0, : scene.n]]))


def compute_volume_heights(
    volume: np.ndarray, planes: Planes, xy: np.ndarray, site: PlanSite
) -> np.ndarray:
    """Return heights (n,) of a volume, in the plan's z, at local `xy` (n, 2)."""
    uv = transform_places(xy, volume, site)
    rows = planes.rows[np.isfinite(planes.rows[:, 2])]
    return (uv @ rows[:, :2].T + rows[:, 2]).min(axis=1)


def transform_places(xy: np.ndarray, volume: np.ndarray, site: PlanSite) -> np.ndarray:
    """Return local places (n, 2) in a volume's axes."""
    frame, (c, s) = site.plan.frame, site.scene.turn[int(volume[DIRECTION])]
    return (xy - frame.origin[:2]) @ frame.rotation.T @ np.array([[c, -s], [s, c]])


def transform_planes(rows: np.ndarray, turn: np.ndarray, plan: Plan) -> np.ndarray:
    """Return planes (k, 3) over local x, y, 1 from those in a volume's axes.

    `turn` has cosine and sine of the angle.
    """
    c, s = turn
    gradients = rows[:, :2] @ np.array([[c, s], [-s, c]]) @ plan.frame.rotation
    return np.column_stack([gradients, rows[:, 2] - gradients @ plan.frame.origin[:2]])


def list_polygons(geometry: shapely.Geometry) -> list[shapely.Polygon]:
    parts = getattr(geometry, "geoms", (geometry,))
    return [part for part in parts if part.geom_type == "Polygon" and part.area > 1e-9]


def cut_to_outline(quad: shapely.Polygon, outline: shapely.Polygon) -> shapely.Geometry:
    """Return the part of a volume's plan inside the outline."""
    return shapely.intersection(quad, outline, grid_size=OVERLAY_GRID_M)


def subtract_hole(polygon: shapely.Polygon, hole: shapely.Polygon) -> list[shapely.Polygon]:
    """Return a polygon without a hole."""
    if not shapely.dwithin(polygon, hole, OVERLAY_GAP_M):
        return [polygon]
    if polygon.area < hole.area and shapely.contains_properly(hole, polygon):
        return []
    return list_polygons(shapely.difference(polygon, hole, grid_size=OVERLAY_GRID_M))


def unite_outlines(parts: Iterable[Part]) -> shapely.Geometry:
    """Return what parts cover together.

    Lines to which slivers shrink on the grid are left out.
    """
    return with_area(
        shapely.union_all(
            [piece.outline for part in parts for piece in part.pieces], grid_size=OVERLAY_GRID_M
        )
    )


def select_touching(parts: Iterable[Part], area: shapely.Geometry) -> list[Part]:
    """Select the parts that touch an area."""
    return [part for part in parts if shapely.dwithin(area, part.outlines, OVERLAY_GAP_M).any()]


def exclude_parts(parts: Iterable[Part], excluded: Iterable[Part]) -> list[Part]:
    """Return the parts that are none of `excluded`."""
    return [part for part in parts if not any(part is item for item in excluded)]


def widen_gap(gap: shapely.Polygon) -> shapely.Polygon:
    """Return the `gap` a millimetre wider."""
    return shapely.buffer(gap, 1e-3, quad_segs=1)


def merge_inside(
    polygon: shapely.Polygon, wide_gap: shapely.Polygon, outline: shapely.Polygon
) -> list[shapely.Polygon]:
    """Return what two polygons cover together of an outline."""
    wider = with_area(shapely.union_all([polygon, wide_gap], grid_size=OVERLAY_GRID_M))
    return list_polygons(shapely.intersection(wider, outline, grid_size=OVERLAY_GRID_M))


def measure_shared_area(polygon: shapely.Polygon, other: shapely.Polygon) -> float:
    return shapely.intersection(polygon, other, grid_size=OVERLAY_GRID_M).area


def find_neighbour(
    wide_gap: shapely.Polygon, polygons: list[list[shapely.Polygon]], site: PlanSite | None = None
) -> tuple[int, int]:
    """Return the two indices of the polygon that shares most area with a gap.

    Without any, these are zeros. The `site` keeps the areas.
    """
    places = [(k, q) for k, group in enumerate(polygons) for q in range(len(group))]
    if not places:
        return 0, 0
    touch = shapely.intersects(wide_gap, [p for group in polygons for p in group])
    neighbours = [
        place for place, is_touching in zip(places, touch.tolist(), strict=True) if is_touching
    ]
    if len(neighbours) > 1:
        area = partial(site.recall, measure_shared_area) if site else measure_shared_area
        areas = [area(wide_gap, polygons[k][q]) for k, q in neighbours]
        neighbours = [max(zip(areas, neighbours, strict=True))[1]]
    return neighbours[0] if neighbours else (0, 0)


def is_base_gap(
    gap: shapely.Polygon, base: np.ndarray, volume: np.ndarray, planes: Planes, site: PlanSite
) -> bool:
    """Return whether a gap is wide enough to be drawn and its points lie on the base.

    The alternative is its neighbour, continued.
    """
    if gap.area < THICK_M2 or shapely.buffer(gap, -THICK_M).is_empty:
        return False
    xy, z = select_points_in(gap, site)
    continued = compute_misfits(
        z, compute_volume_heights(volume, planes, xy, site), site.scene
    ).sum()
    gain = continued - compute_misfits(z, base[OFFSET0 + LEVEL], site.scene).sum()
    return not len(z) or bool(gain > SHAPE_UNITS * site.scene.evidence)
