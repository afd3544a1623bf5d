"""A closed solid between lids, its faces that are not upright.

Over each edge in plan, walls stand from every second edge of a lid to the next one above it. Lids
may have corners over each other's edges: walls beside each other along one edge of a lid are one
face, and lids get a corner only where a wall has one. Coordinates are whole tenths of a millimetre.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

import numpy as np
import shapely

from ..geometry.components import label_components
from ..model import GROUND, WALL, Face, Solid
from .arrangement import COLLINEAR_UNITS, GRID_M

Item = TypeVar("Item")

# Walls of a composed solid bend by that without a corner: corners of roofs lie so far off the edges
# of its ground.
ON_EDGE_UNITS = COLLINEAR_UNITS + 1.0
BESIDE_EDGE_UNITS = 2.0  # 0.2 mm; rounding moves a corner off its edge by less

Place = tuple[int, int]  # a place in plan, in units of the grid
Corner = tuple[int, int, int]  # a corner of a solid, in units of the grid
Edge = tuple[Corner, Corner]


class Lid(NamedTuple):
    """A face that is not upright: its rings run counter-clockwise, seen from outside the solid."""

    rings: list[list[Corner]]
    kind: str
    part: int = -1


def close_lids(lids: Sequence[Lid], reach: float = ON_EDGE_UNITS) -> Solid:
    """Return the solid under and over lids, open where no walls close it.

    Corners within the `reach` of an edge lie on it.
    """
    edges = [edge for lid in lids for ring in lid.rings for edge in list_edges(ring)]
    corners = {start for start, _ in edges}
    places = list_places(lids)
    chains = divide_edges(edges, places, reach)
    walls, labels = pair_edges(chains)
    over: dict[Place, set[int]] = {}
    for x, y, z in corners.union(*(edge for wall in walls for edge in wall)):
        over.setdefault((x, y), set()).add(z)
    levels = {place: sorted(heights) for place, heights in over.items()}
    rings: dict[int, list[Edge]] = {}
    for wall, label in zip(walls, labels, strict=True):
        rings.setdefault(label, []).extend(pairwise(draw_wall(wall, levels)))
    loops = [loop for ring in rings.values() for loop in trace_loops(ring)]
    for start, end in (edge for loop in loops for edge in list_edges(loop)):
        if start[:2] == end[:2]:
            corners |= {start, end}
    walls_drawn = [Lid([loop], WALL) for loop in loops]
    divided = [
        lid._replace(
            rings=[
                [corner for edge in list_edges(ring) for corner in chains[edge][:-1]]
                for ring in lid.rings
            ]
        )
        for lid in lids
    ]
    return number_corners(keep_corners(lid, corners) for lid in [*divided, *walls_drawn])


def keep_corners(lid: Lid, corners: set[Corner]) -> Lid:
    """Return a lid without all but the `corners`, and without spikes."""
    rings = [[corner for corner in ring if corner in corners] for ring in lid.rings]
    return lid._replace(rings=[loop for ring in rings for loop in trace_loops(list_edges(ring))])


def list_lids(solid: Solid, kind: str) -> list[Lid]:
    """Return the faces of one kind of a solid as lids."""
    grid = [(x, y, z) for x, y, z in np.rint(solid.vertices / GRID_M).astype(int).tolist()]
    return [
        Lid([[grid[vertex] for vertex in ring] for ring in face.rings], kind, face.part)
        for face in solid.select_faces(kind)
    ]


def draw_plan(lid: Lid) -> shapely.Polygon:
    """Return a lid in plan, on the grid."""
    outer, *holes = ([corner[:2] for corner in ring] for ring in lid.rings)
    return shapely.Polygon(outer, holes)


def draw_base(roofs: Sequence[Lid], z_base: int) -> Lid:
    """Return the level ground under `roofs`, with a corner under each of theirs on its border."""
    rings = trace_loops(
        (end[:2], start[:2])
        for lid in roofs
        for ring in lid.rings
        for start, end in list_edges(ring)
    )
    rings.sort(key=lambda ring: -shapely.Polygon(ring).area)
    return Lid([[(*place, z_base) for place in ring] for ring in rings], GROUND)


def join_straight_edges(base: Lid) -> Lid:
    """Return a level lid without the corners on straight stretches of its rings."""
    rings = []
    for ring in base.rings:
        first = ring.index(min(ring))  # which is no corner on a straight stretch
        line = shapely.linearrings([corner[:2] for corner in ring[first:] + ring[:first]])
        xy = shapely.get_coordinates(shapely.simplify(line, COLLINEAR_UNITS))[:-1]
        rings.append([(x, y, ring[0][2]) for x, y in xy.astype(int).tolist()])
    return base._replace(rings=rings)


def to_grid(area: shapely.Geometry) -> shapely.Geometry:
    """Return an area in units of the grid."""
    return shapely.transform(area, lambda xy: np.rint(xy / GRID_M))


def list_rings(polygon: shapely.Polygon) -> list[list[Place]]:
    """Return the rings of a polygon on the grid, its area on their left."""
    polygon = shapely.orient_polygons(polygon)
    return [
        [(x, y) for x, y in np.rint(shapely.get_coordinates(ring)[:-1]).astype(int).tolist()]
        for ring in (polygon.exterior, *polygon.interiors)
    ]


def list_places(lids: Iterable[Lid]) -> np.ndarray:
    """Return the places (n, 2) over which lids have corners."""
    return np.array(sorted({c[:2] for lid in lids for ring in lid.rings for c in ring}))


def list_edges(ring: Sequence[Item]) -> Iterable[tuple[Item, Item]]:
    """Pair every item of a ring with the next."""
    return zip(ring, (*ring[1:], ring[0]), strict=True)


def divide_edges(
    edges: Iterable[Edge], places: np.ndarray, reach: float = ON_EDGE_UNITS
) -> dict[Edge, list[Corner]]:
    """Return the corners along edges over all `places` (n, 2) on them, the same both ways.

    A place lies on the edges within the `reach` that are nearest to it.
    """
    edges = list(edges)
    risen = list(dict.fromkeys((min(edge), max(edge)) for edge in edges))
    low, high = np.array(risen, float).swapaxes(0, 1)
    lines = shapely.linestrings(np.stack([low, high], axis=1)[:, :, :2])
    tree = shapely.STRtree(shapely.points(places))
    number, place = tree.query(lines, predicate="dwithin", distance=reach)
    (dx, dy, rise), (x, y) = (high - low)[number].T, (places[place] - low[number, :2]).T
    length = np.maximum(np.hypot(dx, dy), 1.0)
    along, aside = (dx * x + dy * y) / length, np.abs(dx * y - dy * x) / length
    nearest = np.full(len(places), np.inf)
    is_inner = (along > 0.5) & (along < length - 0.5)
    np.minimum.at(nearest, place[is_inner], aside[is_inner])
    z = np.rint(low[number, 2] + rise / length * np.hypot(x, y))
    inner = list(map(tuple, np.column_stack([places[place], z]).astype(int).tolist()))
    is_on = is_inner & (aside <= nearest[place] + 1.0)
    chains: dict[Edge, list[Corner]] = {edge: [edge[0]] for edge in risen}
    for k in np.argsort(along, kind="stable").tolist():
        if is_on[k]:
            chains[risen[number[k]]].append(inner[k])
    for start, end in risen:
        chains[start, end].append(end)
        chains[end, start] = chains[start, end][::-1]
    return {edge: chains[edge] for edge in edges}


def list_open_edges(chains: dict[Edge, list[Corner]]) -> list[dict[Edge, Edge]]:
    """Return edges that lids do not share, by place and upwards, with those they are part of."""
    beside: dict[frozenset[Place], dict[Edge, Edge]] = {}
    for whole, chain in chains.items():
        for start, end in pairwise(chain):
            here = beside.setdefault(frozenset((start[:2], end[:2])), {})
            if here.pop((end, start), None) is None:
                here[start, end] = whole
    return [
        dict(sorted(here.items(), key=lambda item: item[0][0][2] + item[0][1][2]))
        for here in beside.values()
    ]


def pair_edges(chains: dict[Edge, list[Corner]]) -> tuple[list[tuple[Edge, ...]], list[int]]:
    """Return walls as pairs of edges, lower and upper, and which face each belongs to."""
    walls: list[tuple[Edge, ...]] = []
    links: list[tuple[int, int]] = []
    last: dict[tuple[int, Edge], int] = {}
    for here in list_open_edges(chains):
        for pair in zip(*[iter(here)] * 2, strict=False):
            for end, edge in enumerate(pair):
                links.append((last.get((end, here[edge]), len(walls)), len(walls)))
                last[end, here[edge]] = len(walls)
            walls.append(pair)
    labels = label_components(len(walls), np.array(links, np.int64).reshape(-1, 2).T)
    return walls, labels.tolist()


def draw_wall(wall: tuple[Edge, ...], levels: dict[Place, list[int]]) -> list[Corner]:
    """Return the closed ring of a wall by all levels, from the foot of its right end."""
    (right, left), (top_left, top_right) = wall
    up, down = (
        [(*start[:2], z) for z in levels[start[:2]] if start[2] <= z <= end[2]]
        for start, end in ((right, top_right), (left, top_left))
    )
    return [*up, *down[::-1], right]


def trace_loops(edges: Iterable[tuple[Any, Any]]) -> list[list[Any]]:
    """Return the loops that directed edges make; those that run both ways go."""
    rest: dict[tuple[Any, Any], None] = {}
    for start, end in edges:
        if (end, start) in rest:
            del rest[end, start]
        elif start != end:
            rest[start, end] = None
    follow: dict[Any, list[Any]] = {}
    for start, end in rest:
        follow.setdefault(start, []).append(end)
    loops = []
    for first, ends in follow.items():
        while ends:
            walk = [first]
            while following := follow[walk[-1]]:
                walk.append(following.pop())
            loops += [loop for loop in simple_loops(walk[:-1]) if len(loop) > 2]
    return loops


def simple_loops(ring: list[Item]) -> list[list[Item]]:
    """Cut a closed walk into loops that visit no vertex twice."""
    loops: list[list[Item]] = []
    path: list[Item] = []
    position: dict[Item, int] = {}
    for vertex in ring:
        if vertex in position:
            cut = position[vertex]
            loop = path[cut:]
            for dropped in loop:
                position.pop(dropped)
            path = path[:cut]
            loops.append(loop)
        position[vertex] = len(path)
        path.append(vertex)
    loops.append(path)
    return loops


def number_corners(lids: Iterable[Lid]) -> Solid:
    """Return the solid of faces given by their rings of corners."""
    numbers: dict[Corner, int] = {}
    faces = tuple(
        Face(
            tuple(tuple(numbers.setdefault(c, len(numbers)) for c in ring) for ring in lid.rings),
            lid.kind,
            lid.part,
        )
        for lid in lids
    )
    return Solid(np.round(np.array(list(numbers), float) * GRID_M, 4), faces)
