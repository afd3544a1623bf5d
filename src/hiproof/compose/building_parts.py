"""Building parts: a solid cut along the walls at which its roofs meet.

Each part has a solid of its own.

Roof faces that share an edge belong to one part: wings that run into each other, a dormer on its
slope. Where roofs meet at a wall alone, or one stands out of another, parts end. They stand side by
side over the plan, on its own vertices, so they cannot overlap and their volumes are the whole's.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
import shapely

from ..geometry.components import label_components
from ..model import GROUND, ROOF, WALL, Face, Solid
from .arrangement import GRID_M
from .check import check_solid

Item = TypeVar("Item")

# Of a part in plan; a smaller one (a chimney, a box on a roof) stays with the neighbour it borders
# most.
LEAST_PART_M2 = 4.0


@dataclass(frozen=True)
class BuildingPart:
    """A part of a building.

    It has its `solid`, in the frame of the whole, the plan polygon `outline` on which it stands,
    and its roof parts `members` (indices into `Roof.parts`), the largest first.
    """

    solid: Solid
    outline: shapely.Polygon
    members: tuple[int, ...]


class Border(NamedTuple):
    """A plan edge of a roof face, which lies left of it: the `face`, its vertices at the ends."""

    face: int
    start: int
    end: int


Place = tuple[int, int]  # a plan vertex, in tenths of a millimetre

Borders = dict[tuple[Place, Place], Border]  # by directed plan edge


def building_parts(solid: Solid, planarity_m: float = 0.001) -> tuple[BuildingPart, ...]:
    """Return the parts of a valid `solid`, that of the lowest member first.

    Its roof faces name their roof parts. A solid of one part has none. There are none either where
    a part would not be valid by itself, as where it touches itself at a corner.

    >>> from hiproof.frames import LocalFrame
    >>> from hiproof.model import Part, Piece, Roof
    >>> from hiproof.compose import compose
    >>> low, high = (Piece(shapely.box(x, 0, x + 5, 4), np.array([[0.0, 0.0, z]])) for x, z in ((0,
    ...     3.0), (5, 6.0)))
    >>> roof = Roof((Part("flat", (low,)), Part("flat", (high,))), shapely.box(0, 0, 10, 4),
    ...     LocalFrame(np.zeros(3)))
    >>> [(part.members, part.solid.volume) for part in building_parts(compose(roof, 0.0))]
    [((0,), 60.0), ((1,), 120.0)]
    """
    place_of = place_vertices(solid)
    roofs = [index for index, face in enumerate(solid.faces) if face.kind == ROOF]
    borders = plan_borders(solid, roofs, place_of)
    groups = merge_small(join_at_edges(roofs, borders), solid, borders)
    if len(groups) < 2:
        return ()
    parts = sorted(
        (cut_part(solid, group, borders, place_of) for group in groups),
        key=lambda part: min(part.members),
    )
    return () if any(check_solid(part.solid, planarity_m) for part in parts) else tuple(parts)


def join_parts(parts: Solid) -> Solid:
    """Join `parts`, building parts over common vertices, into one solid.

    They are the shells into which it was cut. Its roof faces come first, in the order in which they
    stand in `parts`; its walls are not joined along straight stretches.
    """
    place_of = place_vertices(parts)
    roofs = [index for index, face in enumerate(parts.faces) if face.kind == ROOF]
    return cut_part(parts, set(roofs), plan_borders(parts, roofs, place_of), place_of).solid


def place_vertices(solid: Solid) -> list[Place]:
    """Return the place of every vertex."""
    return [(round(x / GRID_M), round(y / GRID_M)) for x, y in solid.vertices[:, :2].tolist()]


def plan_borders(solid: Solid, roofs: list[int], place_of: list[Place]) -> Borders:
    """Return the border over each directed plan edge; its neighbour is over the reversed one."""
    return {
        (place_of[start], place_of[end]): Border(index, start, end)
        for index in roofs
        for ring in solid.faces[index].rings
        for start, end in list_edges(ring)
    }


def list_edges(ring: Sequence[Item]) -> Iterable[tuple[Item, Item]]:
    """Pair every item of a ring with the next."""
    return zip(ring, (*ring[1:], ring[0]), strict=True)


def join_at_edges(roofs: list[int], borders: Borders) -> dict[int, int]:
    """Return the group of each roof face: faces that share edges in space are of one."""
    numbers = {face: k for k, face in enumerate(roofs)}
    links = [
        (numbers[current.face], numbers[there.face])
        for (a, b), current in borders.items()
        if (there := borders.get((b, a)))
        and (current.start, current.end) == (there.end, there.start)
    ]
    labels = label_components(len(roofs), np.array(links, np.int64).reshape(-1, 2).T)
    return dict(zip(roofs, labels.tolist(), strict=True))


def merge_small(group_of: dict[int, int], solid: Solid, borders: Borders) -> list[set[int]]:
    """Merge groups below LEAST_PART_M2, smallest first, into that with most common border."""
    area = {index: solid.project_face(solid.faces[index]).area for index in group_of}
    while True:
        groups: dict[int, set[int]] = {}
        for index, number in group_of.items():
            groups.setdefault(number, set()).add(index)
        smallest = min(
            groups.values(), key=lambda group: (sum(area[index] for index in group), min(group))
        )
        shared: dict[int, float] = {}
        for (a, b), current in borders.items():
            there = borders.get((b, a))
            if current.face in smallest and there and there.face not in smallest:
                key = group_of[there.face]
                shared[key] = shared.get(key, 0.0) + float(np.hypot(b[0] - a[0], b[1] - a[1]))
        if sum(area[index] for index in smallest) >= LEAST_PART_M2 or not shared:
            return list(groups.values())
        heir = max(shared, key=lambda key: (shared[key], -min(groups[key])))
        group_of |= dict.fromkeys(smallest, heir)


def cut_part(
    solid: Solid, group: set[int], borders: Borders, place_of: list[Place]
) -> BuildingPart:
    """Return the part under roof faces `group`, with steps, walls to the ground, and ground."""
    part_borders = {edge: border for edge, border in borders.items() if border.face in group}
    vertices, levels = with_base(
        solid, {border.start for border in part_borders.values()}, place_of
    )
    rings = closed_rings([(b, a) for a, b in part_borders if (b, a) not in part_borders])
    walls = [
        Face((ring,), WALL)
        for edge in part_borders
        if (ring := make_wall_ring(edge, part_borders, levels))
    ]
    ground = Face(tuple(tuple(levels[place][0] for place in ring) for ring in rings), GROUND)
    faces = [*(solid.faces[index] for index in sorted(group)), *walls, ground]
    outer, *holes = (np.array(ring) * GRID_M for ring in rings)
    return BuildingPart(
        Solid(vertices, tuple(faces)).drop_unused_vertices(),
        shapely.Polygon(outer, holes),
        list_members(solid, group),
    )


def with_base(
    solid: Solid, in_use: set[int], place_of: list[Place]
) -> tuple[np.ndarray, dict[Place, list[int]]]:
    """Add ground vertices below `in_use`; returns all (n, 3), and those over each place."""
    z_base = min(
        solid.vertices[index, 2]
        for face in solid.select_faces(GROUND)
        for ring in face.rings
        for index in ring
    )
    levels: dict[Place, list[int]] = {}
    for vertex in sorted(in_use, key=lambda vertex: solid.vertices[vertex, 2]):
        levels.setdefault(place_of[vertex], []).append(vertex)
    below = [[*solid.vertices[over[0], :2], z_base] for over in levels.values()]
    for number, over in enumerate(levels.values(), len(solid.vertices)):
        over.insert(0, number)
    return np.concatenate([solid.vertices, np.array(below)]), levels


def make_wall_ring(
    edge: tuple[Place, Place], part_borders: Borders, levels: dict[Place, list[int]]
) -> tuple[int, ...]:
    """Return the wall below a border to its neighbour or the ground, by all levels, or none."""
    a, b = edge
    current, there = part_borders[edge], part_borders.get((b, a))
    low_a, low_b = (levels[a][0], levels[b][0]) if there is None else (there.end, there.start)
    at_a = select_between(levels[a], low_a, current.start)
    at_b = select_between(levels[b], low_b, current.end)
    return (*at_b, *reversed(at_a)) if len(at_a) + len(at_b) > 2 and at_a and at_b else ()


def select_between(levels: list[int], lower: int, upper: int) -> list[int]:
    """Return the vertices of a place from one to another that lies no lower."""
    return levels[levels.index(lower) : levels.index(upper) + 1]


def closed_rings(edges: list[tuple[Place, Place]]) -> list[list[Place]]:
    """Join directed plan edges to closed rings, the outermost first."""
    follow = dict(edges)
    rings = []
    while follow:
        ring = [next(iter(follow))]
        while (place := follow.pop(ring[-1])) != ring[0]:
            ring.append(place)
        rings.append(ring)
    return sorted(rings, key=lambda ring: -shapely.Polygon(ring).area if len(ring) > 2 else 0.0)


def list_members(solid: Solid, group: set[int]) -> tuple[int, ...]:
    """Return the roof parts of the faces `group`, the largest in plan first."""
    area: dict[int, float] = {}
    for index in sorted(group):
        face = solid.faces[index]
        area[face.part] = area.get(face.part, 0.0) + solid.project_face(face).area
    return tuple(sorted(area, key=lambda part: (-area[part], part)))
