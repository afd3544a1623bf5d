"""Building parts: a solid cut along the walls at which its roofs meet.

Each part has a solid of its own.

Roof faces that share an edge belong to one part: wings that run into each other, a dormer on its
slope. Where roofs meet at a wall alone, or one stands out of another, parts end. They stand side by
side over the plan, on its own vertices, so they cannot overlap and their volumes are the whole's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely

from ..geometry.components import label_components
from ..model import GROUND, ROOF, Solid
from .arrangement import GRID_M
from .check import check_solid
from .lids import Edge, Lid, Place, close_lids, draw_base, draw_plan, list_edges, list_lids

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


Borders = dict[tuple[Place, Place], tuple[int, Edge]]  # lid and its edge, by directed plan edge


def building_parts(solid: Solid) -> tuple[BuildingPart, ...]:
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
    roofs = list_lids(solid, ROOF)
    groups = group_roofs(roofs)
    if len(groups) < 2:
        return ()
    parts = [make_part([roofs[k] for k in sorted(group)], find_base(solid)) for group in groups]
    if any(check_solid(part.solid) for part in parts):
        return ()
    return tuple(sorted(parts, key=lambda part: min(part.members)))


def join_parts(parts: Solid) -> Solid:
    """Join `parts`, the shells into which a building was cut, into one solid.

    They have common vertices. Roof faces come first, in the order in which they stand in `parts`;
    walls are not joined along straight stretches.
    """
    return make_part(list_lids(parts, ROOF), find_base(parts)).solid


def find_base(solid: Solid) -> int:
    """Return the lowest height of the ground."""
    return min(z for lid in list_lids(solid, GROUND) for ring in lid.rings for *_, z in ring)


def group_roofs(roofs: list[Lid]) -> list[set[int]]:
    """Return which roofs are one part: those that share edges in space, or too little else."""
    borders: Borders = {
        (start[:2], end[:2]): (number, (start, end))
        for number, lid in enumerate(roofs)
        for ring in lid.rings
        for start, end in list_edges(ring)
    }
    links = [
        (number, borders[b, a][0])
        for (a, b), (number, (start, end)) in borders.items()
        if borders.get((b, a), (0, ()))[1] == (end, start)
    ]
    labels = label_components(len(roofs), np.array(links, np.int64).reshape(-1, 2).T)
    return merge_small(labels.tolist(), list(map(measure_area, roofs)), borders)


def measure_area(lid: Lid) -> float:
    """Return the area of a lid in plan, in square metres."""
    return draw_plan(lid).area * GRID_M**2


def merge_small(group_of: list[int], area: list[float], borders: Borders) -> list[set[int]]:
    """Merge groups below LEAST_PART_M2, smallest first, into that with most common border."""
    while True:
        groups: dict[int, set[int]] = {}
        for number, group in enumerate(group_of):
            groups.setdefault(group, set()).add(number)
        size = {group: sum(area[k] for k in members) for group, members in groups.items()}
        smallest = min(groups, key=lambda group: (size[group], min(groups[group])))
        shared: dict[int, float] = {}
        for (a, b), (number, _) in borders.items():
            there = group_of[borders[b, a][0]] if (b, a) in borders else smallest
            if group_of[number] == smallest and there != smallest:
                shared[there] = shared.get(there, 0.0) + math.dist(a, b)
        if size[smallest] >= LEAST_PART_M2 or not shared:
            return list(groups.values())
        heir = max(shared, key=lambda group: (shared[group], -min(groups[group])))
        group_of = [heir if group == smallest else group for group in group_of]


def make_part(roofs: list[Lid], z_base: int) -> BuildingPart:
    """Return the part under `roofs`, with steps, walls to the ground, and ground."""
    ground = draw_base(roofs, z_base)
    area: dict[int, float] = {}
    for lid in roofs:
        area[lid.part] = area.get(lid.part, 0.0) + measure_area(lid)
    members = tuple(sorted(area, key=lambda part: (-area[part], part)))
    outline = shapely.transform(draw_plan(ground), lambda xy: xy * GRID_M)
    return BuildingPart(close_lids([*roofs, ground]), outline, members)
