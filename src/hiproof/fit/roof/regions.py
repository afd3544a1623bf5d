"""Say which polygons each volume may roof: inside its sides and the outline, not replaced."""

from __future__ import annotations

from itertools import permutations
from typing import NamedTuple

import numpy as np
import shapely

from ...geometry.rings import intersect, subtract, unite
from ...primitives.contract import RECTANGLE
from ..shapes.regions import find_neighbour, list_polygons, widen_gap
from .draw import FRAGMENT_M2, RING_CORNERS, Drawing, cut, join_fragments
from .tables import FAR_M, N_SIDES, VOLUME_COUNT, Tables

HIGHER_M = 1e-6  # A volume no more than this (m) below another is not below it.


BELOW_M = 0.2  # Distance (m) by which a part reaches below what hides it.
LEAST_PLACE_M2 = 1.0  # Area (m2) of the smallest place that is a part by itself.


class Place(NamedTuple):
    """A volume, or a piece of one, that is a part: its number, polygons and planes.

    `is_cut` says whether it has other ends than its volume.
    """

    volume: int
    polygons: list[shapely.Polygon]
    planes: list[int]
    is_cut: bool


def list_places(roof: Tables, drawing: Drawing, outline: shapely.Polygon) -> list[Place]:
    """List the places of a drawn roof that are one part each.

    A volume is several parts where steps keep the places apart in which it is visible, and inside
    another, as dormers are: a person sees several. What crosses another is one, because it stands
    out of it on both sides. Level volumes at one height that touch are one part, of the largest.
    """
    regions = draw_regions(roof, outline)
    planes = [list(range(count)) for count in roof.n_planes[: len(regions)].tolist()]
    if len(regions) == 1:
        return [Place(0, regions[0], planes[0], len(regions[0]) > 1)]
    join_pieces(roof, drawing, regions, planes)
    ended = end_at_others(roof, drawing, regions, planes)
    visible: dict[int, shapely.Geometry] = {}
    groups: dict[tuple, dict[int, list[int]]] = {}
    first = join_fragments(roof, drawing)
    for f in range(drawing.count[0]):
        k, p = drawing.owners[f].tolist()
        is_level = roof.n_planes[k] == 1 and roof.slopes[k, p] < 0
        key = (-1, int(drawing.numbers[k, p])) if is_level else (k, 0)
        groups.setdefault(key, {}).setdefault(int(first[f]), []).append(f)
    places = []
    for places_of_one in groups.values():
        owners = sorted({int(drawing.owners[f, 0]) for of in places_of_one.values() for f in of})
        owner = max(owners, key=lambda k: sum(p.area for p in regions[k]))
        whole = [p for k in owners for p in regions[k]]
        if len(owners) > 1:
            whole = list_polygons(unite(whole))
        areas = [unite_fragments(drawing, fragments) for fragments in places_of_one.values()]
        apart = list_polygons(unite(areas) if len(areas) > 1 else areas[0])
        inside = max(len(areas), len(apart)) > 1
        if inside:
            visible = visible or draw_visible(drawing)
            inside = is_inside(visible, owner)
        large = [area for area in (apart if inside else areas) if area.area > LEAST_PLACE_M2]
        if len(large) < 2 or (not inside and crosses(visible, owner, large)):
            is_cut = owner in ended or len(owners) > 1 or len(large) > 1
            places += [Place(owner, whole, planes[owner], is_cut)] if whole else []
        else:
            split = split_region(whole, large, outline)
            places += [Place(owner, part, planes[owner], True) for part in split if part]
    return places


def end_at_others(
    roof: Tables,
    drawing: Drawing,
    regions: list[list[shapely.Polygon]],
    planes: list[list[int]],
) -> set[int]:
    """End volumes where a plane begins that is hidden, or that another volume shows as its own.

    A wing that ends in a roof may have that roof's plane as its end, but is a gable. Changes the
    `regions` and `planes` of volumes and the owners of fragments, and returns which volumes end so.
    """
    ended, owners = set(), drawing.owners[: drawing.count[0]]
    for k in range(len(regions)):
        for p in reversed(planes[k]):
            if len(planes[k]) == 1:
                break
            seen = np.flatnonzero((owners == (k, p)).all(axis=1))
            same = np.argwhere(drawing.numbers[: len(regions)] == drawing.numbers[k, p])
            others = [(j, q) for j, q in same.tolist() if j != k and q in planes[j]]
            if len(seen) and (taker := find_taker(roof, k, p, regions, planes, others)):
                j, wide = taker
                regions[j] = list_polygons(wide)
                regions[k] = list_polygons(subtract(unite(regions[k]), wide))
                planes[k].remove(p)
                ended |= {j, k}
                owners[seen] = j, planes[j][0]
                continue
            own = draw_lowest(roof, k, p, regions[k])
            is_of_side = abs(roof.plane_lines[k, p]) in np.abs(roof.sides[k])
            may_end = (others and not is_of_side) or (not len(seen) and len(planes[k]) > 2)
            if own and not may_end:
                continue
            shown = unite([area for j, q in others for area in draw_lowest(roof, j, q, regions[j])])
            if not own:
                planes[k].remove(p)
            elif subtract(unite_fragments(drawing, seen.tolist()), shown).area <= FRAGMENT_M2:
                other = np.flatnonzero((owners[:, 0] == k) & (owners[:, 1] != p)).tolist()
                visible = unite_fragments(drawing, other)
                regions[k] = cut_square(unite(regions[k]), unite(own), roof.planes[k, p], visible)
                planes[k].remove(p)
                ended.add(k)
                if len(seen):
                    owners[seen] = others[0]
    return ended


def join_pieces(
    roof: Tables,
    drawing: Drawing,
    regions: list[list[shapely.Polygon]],
    planes: list[list[int]],
) -> None:
    """Make volumes that show planes of another, where it would show them, pieces of that one.

    A volume that replaces others uncovers such pieces, as between dormers that are drawn as one.
    Changes the `regions` and `planes` of volumes and the owners of fragments.
    """
    owners = drawing.owners[: drawing.count[0]]
    for k, j in permutations(range(len(regions)), 2):
        number = {int(drawing.numbers[k, p]): p for p in planes[k]}
        twins = [number.get(int(drawing.numbers[j, q]), -1) for q in planes[j]]
        if not twins or min(twins) < 0:
            continue
        place = draw_convex(roof.half_planes[k])
        shown = unite([area for p in twins for area in draw_lowest(roof, k, p, regions[j])])
        if subtract(unite(regions[j]), intersect(shown, place)).area <= FRAGMENT_M2:
            regions[k] = list_polygons(unite([*regions[k], *regions[j]]))
            for p, q in zip(twins, planes[j], strict=True):
                owners[(owners == (j, q)).all(axis=1)] = k, p
            planes[j] = []


def find_taker(
    roof: Tables,
    k: int,
    p: int,
    regions: list[list[shapely.Polygon]],
    planes: list[list[int]],
    others: list[tuple[int, int]],
) -> tuple[int, shapely.Geometry] | None:
    """Return a volume of plane p alone that goes on where volume k shows it, and its region then.

    Two slopes back to back, with a step between them, may be drawn as a gable and what is left of
    one slope. The region is convex: else there is none.
    """
    for j, q in others:
        if planes[j] == [q]:
            wide = unite([*regions[j], *draw_lowest(roof, k, p, regions[k])])
            if shapely.convex_hull(wide).area - wide.area <= FRAGMENT_M2:
                return j, wide
    return None


def cut_square(
    region: shapely.Geometry, end: shapely.Geometry, plane: np.ndarray, visible: shapely.Geometry
) -> list[shapely.Polygon]:
    """Return a region without its `end`, cut square to the plane there if that hides nothing."""
    rise = plane[:2]
    place = float((shapely.get_coordinates(end) @ rise).max())
    cut_off = intersect(region, draw_convex(np.array([[*rise, -place]])))
    is_hidden = subtract(visible, cut_off).area <= FRAGMENT_M2
    return list_polygons(cut_off if is_hidden else subtract(region, end))


def draw_lowest(
    roof: Tables, k: int, p: int, region: list[shapely.Polygon]
) -> list[shapely.Polygon]:
    """Return where plane p is the lowest of volume k in its region."""
    others = np.delete(roof.planes[k, : roof.n_planes[k]], p, axis=0)
    quad = draw_convex(others - roof.planes[k, p])
    return list_polygons(intersect(unite(region), quad)) if region else []


def draw_visible(drawing: Drawing) -> dict[int, shapely.Geometry]:
    """Return where each volume is visible."""
    fragments: dict[int, list[int]] = {}
    for f in range(drawing.count[0]):
        fragments.setdefault(int(drawing.owners[f, 0]), []).append(f)
    return {k: unite_fragments(drawing, of_one) for k, of_one in fragments.items()}


def unite_fragments(drawing: Drawing, numbers: list[int]) -> shapely.Geometry:
    return unite([shapely.Polygon(drawing.rings[f, : drawing.sizes[f]]) for f in numbers])


def is_inside(visible: dict[int, shapely.Geometry], k: int) -> bool:
    """Return whether another volume is visible all around volume k, as around a dormer."""
    return any(
        j != k and shapely.convex_hull(area).contains(visible[k]) for j, area in visible.items()
    )


def crosses(visible: dict[int, shapely.Geometry], k: int, places: list[shapely.Geometry]) -> bool:
    """Return whether volume k and one that hides its middle stand out of each other on both sides.

    `places` are those in which volume k is visible.
    """
    hull = shapely.union_all(places).convex_hull
    return any(
        j != k and count_large(subtract(hull, area)) > 1 and count_large(subtract(area, hull)) > 1
        for j, area in visible.items()
    )


def count_large(area: shapely.Geometry) -> int:
    return sum(polygon.area > LEAST_PLACE_M2 for polygon in list_polygons(area))


def split_region(
    polygons: list[shapely.Polygon], places: list[shapely.Geometry], outline: shapely.Polygon
) -> list[list[shapely.Polygon]]:
    """Return what of the polygons belongs to each of the places in which they are visible.

    A polygon around several of them is cut around each, and reaches a little below what hides it.
    """
    parts: list[list[shapely.Polygon]] = [[] for _ in places]
    for polygon in polygons:
        shared = shapely.area(shapely.intersection(polygon, places))
        inside = np.flatnonzero(shared > 0.5 * LEAST_PLACE_M2).tolist()
        if len(inside) < 2:
            parts[int(np.argmax(shared))].append(polygon)
            continue
        for g in inside:
            others = shapely.union_all([places[h] for h in inside if h != g])
            reach = shapely.buffer(places[g], BELOW_M, join_style="mitre")
            parts[g] += list_polygons(subtract(intersect(polygon, reach), others))
    return parts


def draw_regions(roof: Tables, outline: shapely.Polygon) -> list[list[shapely.Polygon]]:
    """Return, for each volume, the polygons (plan coordinates) that it may roof.

    They overlap as volumes do. What a later volume replaces is cut out. A volume without sides
    roofs only where no other is higher. A place that no volume covers goes to the one beside it.
    """
    quads = [draw_quad(roof, k, outline) for k in range(roof.counts[VOLUME_COUNT])]
    regions: list[shapely.Geometry] = []
    for k, quad in enumerate(quads):
        if roof.replaces[k]:
            regions = [subtract(region, quad) for region in regions]
        regions.append(quad)
    for k, region in enumerate(regions):
        if is_endless(roof, k):
            for j, quad in enumerate(quads):
                if j != k and not is_endless(roof, j) and not is_below(roof, j, k, quad):
                    region = subtract(region, quad)
            regions[k] = region
    lists = [list_polygons(region) for region in regions]
    has_base = any(is_endless(roof, k) for k in range(len(quads)))
    bare = shapely.Polygon() if has_base else subtract(outline, unite(quads))
    gaps: dict[tuple[int, int], list[shapely.Polygon]] = {}
    for gap in map(widen_gap, list_polygons(bare)):
        gaps.setdefault(find_neighbour(gap, lists), []).append(gap)
    for k, q in sorted(gaps, reverse=True):  # the last polygon first: the others stay in place
        if lists[k]:
            wider = unite([lists[k][q], *gaps[k, q]])
            lists[k][q : q + 1] = list_polygons(intersect(wider, outline))
    return lists


def is_endless(roof: Tables, k: int) -> bool:
    return bool(roof.boxes[k, 1] - roof.boxes[k, 0] >= FAR_M)


def draw_quad(roof: Tables, k: int, outline: shapely.Polygon) -> shapely.Geometry:
    """Return the part of an outline inside the sides of volume k."""
    if is_endless(roof, k):
        return outline
    return intersect(draw_convex(roof.half_planes[k]), outline)


def draw_convex(halves: np.ndarray) -> shapely.Polygon:
    """Return the polygon inside all half planes (h, 3), but no further out than FAR_M."""
    rings, size = np.empty((2, RING_CORNERS, 2)), N_SIDES
    rings[0, :N_SIDES] = 2.0 * FAR_M * np.array(RECTANGLE)
    for half in halves.tolist():
        size = cut(rings[0], size, *half, rings[1]) if size else 0
    return shapely.Polygon(rings[0, :size])


def is_below(roof: Tables, j: int, k: int, quad: shapely.Geometry) -> bool:
    """Return whether volume j is below k somewhere in its quad, and does not replace it."""
    if roof.replaces[j] and j > k:
        return False
    corners = shapely.get_coordinates(quad)
    return bool(
        (compute_heights(roof, j, corners) < compute_heights(roof, k, corners) - HIGHER_M).any()
    )


def compute_heights(roof: Tables, k: int, xy: np.ndarray) -> np.ndarray:
    """Return the heights (n,) of volume k at places (n, 2), whatever its sides."""
    rows = roof.planes[k, : roof.n_planes[k]]
    return (xy @ rows[:, :2].T + rows[:, 2]).min(axis=1)
