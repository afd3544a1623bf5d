"""From plan cells to a closed shell: roof faces, walls where levels part, a ground face."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..errors import CompositionError
from ..model import GROUND, ROOF, WALL, Face, Solid
from .arrangement import COLLINEAR_UNITS, GRID_M, OUTSIDE, heights
from .cells import PlanCells, PlanProblem
from .levels import Levels, find_saddles, split_at_crossings, stack_levels

SETBACK_M = 0.01  # m that a crosswise corner is cut back by; ten times what makes two points one


class Saddles(Exception):
    """Plan vertices around which the solid is no manifold.

    Levels rise and fall twice around each, or a cell meets itself there. `patches` (soup, label)
    are the cures.
    """

    def __init__(self, patches: list[tuple[np.ndarray, int]]):
        super().__init__("the roof's levels form a checkerboard around a vertex")
        self.patches = patches


def raise_shell(
    cells: PlanCells,
    problem: PlanProblem,
    z_ground: float,
    clearance_m: float,
    merges_walls: bool,
    reach: float,
    widening: float,
) -> Solid:
    """Raise the solid over the plan cells.

    Raises Saddles where the problem needs a patch first, CompositionError where none helps. The
    ground is lowered where needed to stay `clearance_m` under the lowest roof vertex. With
    `merges_walls`, consecutive walls along a straight stretch of the outline become one. Vertices
    keep the `reach` (grid units). Patches are wider by the factor `widening`.
    """
    planes = problem.planes
    xy, edges, side, ties = split_at_crossings(cells.xy, cells.edges, cells.side, planes, reach)
    if len(edges) == 0:
        raise CompositionError(
            "expected an outline with an area, got one thinner than a millimetre; repair or remove "
            "the footprint"
        )
    z_low = lowest_roof(xy, edges, side, planes) - clearance_m / GRID_M
    z_base = np.floor(min(z_ground / GRID_M, z_low))
    levels = stack_levels(xy, edges, side, planes, z_base, ties)
    saddles = find_saddles(edges, levels, side.ravel())
    if len(saddles):
        radius = max(SETBACK_M / GRID_M, 4 * reach) * widening
        raise Saddles([cure(sectors_at(v, xy, edges, side, levels), radius) for v in saddles])
    # from here on numbers of a few dozen edges: plain lists are faster than arrays
    label, xyz = side.ravel().tolist(), levels.vertices.tolist()
    follow, face, level = levels.follow.tolist(), levels.face.tolist(), levels.level.tolist()
    faces = roof_faces(follow, face, level, label, xyz, problem.part)
    rises = wall_rises(follow, level)
    runs = wall_runs(rises, follow, label, xyz) if merges_walls else [[h] for h in rises]
    skip = {rises[h][0] for run in runs for h in run[1:]}
    faces += [
        Face((tuple([v for v in make_wall_ring(run, rises) if v not in skip]),), WALL)
        for run in runs
    ]
    faces.append(ground_face(follow, level, label, skip, xyz))
    return Solid(np.round(levels.vertices * GRID_M, 4), tuple(faces)).drop_unused_vertices()


def lowest_roof(xy: np.ndarray, edges: np.ndarray, side: np.ndarray, planes: np.ndarray) -> float:
    """Return the lowest roof height at any vertex of any cell, in grid units."""
    label = side.ravel()
    x, y = np.moveaxis(xy[np.repeat(edges, 2, axis=0)], -1, 0)
    return float(heights(planes[label, None], x, y)[label != OUTSIDE].min())


def walks(follow: list[int], selection: list[bool]) -> list[list[int]]:
    """Return closed walks of the selected half-edges, as lists of half-edges."""
    visited = [False] * len(follow)
    result = []
    for first in range(len(follow)):
        if visited[first] or not selection[first]:
            continue
        walk, h = [], first
        while not visited[h]:
            visited[h] = True
            walk.append(h)
            h = follow[h]
        result.append(walk)
    return result


def signed_area(ring: list[int], xyz: list[list[float]]) -> float:
    """Plan area of a ring of vertex indices, positive counter-clockwise."""
    x0, y0, _ = xyz[ring[0]]
    plan = [(xyz[vertex][0] - x0, xyz[vertex][1] - y0) for vertex in ring]
    return 0.5 * sum(ax * by - ay * bx for (ax, ay), (bx, by) in pairwise(plan))


def roof_faces(
    follow: list[int],
    face: list[int],
    level: list[int],
    label: list[int],
    xyz: list[list[float]],
    part: np.ndarray,
) -> list[Face]:
    """Return a RoofSurface a cell: its outer walk counter-clockwise from above, then holes."""
    rings_of: dict[int, list[list[int]]] = {}
    label_of = {}
    for walk in walks(follow, [current != OUTSIDE for current in label]):
        label_of[face[walk[0]]] = label[walk[0]]
        rings_of.setdefault(face[walk[0]], []).append([level[h] for h in walk])
    faces = []
    for cell, rings in rings_of.items():
        if len(rings) > 1:
            rings.sort(key=lambda ring: -signed_area(ring, xyz))
        faces.append(Face(tuple(map(tuple, rings)), ROOF, int(part[label_of[cell]])))
    return faces


def ground_face(
    follow: list[int], level: list[int], label: list[int], skip: set[int], xyz: list[list[float]]
) -> Face:
    """Return the GroundSurface.

    It has the walks around the outside, which run counter-clockwise seen from below. `skip` are
    ground vertices in the middle of a straight wall, which nothing else needs.
    """
    rings = [
        [level[h] for h in walk if level[h] not in skip]
        for walk in walks(follow, [current == OUTSIDE for current in label])
    ]
    if len(rings) > 1:
        rings.sort(key=lambda ring: signed_area(ring, xyz))
    return Face(tuple(map(tuple, rings)), GROUND)


def wall_rises(follow: list[int], level: list[int]) -> dict[int, tuple[int, int, int, int]]:
    """Return half-edges whose left cell is higher, with low, high at the origin and the end."""
    rises = {}
    for h in range(len(follow)):
        low_u = level[follow[h ^ 1]]
        high_u = level[h]
        low_v = level[h ^ 1]
        high_v = level[follow[h]]
        if high_u > low_u or high_v > low_v:
            rises[h] = (low_u, high_u, low_v, high_v)
    return rises


def wall_runs(
    rises: dict[int, tuple[int, int, int, int]],
    follow: list[int],
    label: list[int],
    xyz: list[list[float]],
) -> list[list[int]]:
    """Group half-edges with walls into runs along straight stretches of the outline."""
    outer = {follow[h ^ 1] ^ 1: h for h in rises if label[h ^ 1] == OUTSIDE}
    next_edges = {
        previous: h for previous, h in outer.items() if is_straight([previous, h], rises, xyz)
    }
    runs = [[h] for h in rises if label[h ^ 1] != OUTSIDE]
    starts = set(outer.values()) - set(next_edges.values())
    for first in sorted(starts):
        run = [first]
        while run[-1] in next_edges:
            following = next_edges[run[-1]]
            if is_straight([*run, following], rises, xyz):
                run.append(following)
            else:
                runs.append(run)
                run = [following]
        runs.append(run)
    return runs


def is_straight(
    run: list[int], rises: dict[int, tuple[int, int, int, int]], xyz: list[list[float]]
) -> bool:
    """Return whether all ground vertices inside a run lie on the line between its ends."""
    ax, ay, _ = xyz[rises[run[0]][0]]
    bx, by, _ = xyz[rises[run[-1]][2]]
    length = max(math.hypot(bx - ax, by - ay), 1.0)
    for h in run[1:]:
        x, y, _ = xyz[rises[h][0]]
        along = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length
        across = abs((x - ax) * (by - ay) - (y - ay) * (bx - ax)) / length
        if across > COLLINEAR_UNITS or not 0 < along < length:
            return False
    return True


def make_wall_ring(run: list[int], rises: dict[int, tuple[int, int, int, int]]) -> list[int]:
    """Return a wall's ring by every level, counter-clockwise from the right of its run."""
    low_u, high_u, _, _ = rises[run[0]]
    _, _, low_v, high_v = rises[run[-1]]
    ring = [low_u, *range(low_v, high_v)]
    for h, previous in zip(reversed(run), [*reversed(run[:-1]), None], strict=True):
        ring.append(rises[h][3])
        if previous is not None:
            start, end = rises[h][1], rises[previous][3]
            ring += range(start, end, 1 if end > start else -1)
    ring += range(high_u, low_u, -1)
    return list(dict.fromkeys(ring))


@dataclass(frozen=True)
class Sectors:
    """The cells around a plan vertex, counter-clockwise; sector k begins at arm k."""

    corner: np.ndarray
    angle: list[float]
    opening: list[float]
    level: list[int]
    face: list[int]
    label: list[int]

    def runs(self, same: list[int]) -> list[tuple[int, int]]:
        """Return (first sector, number) of the runs of equal values."""
        size = len(same)
        first = [k for k in range(size) if same[k] != same[k - 1]]
        return [(k, (first[(i + 1) % len(first)] - k - 1) % size + 1) for i, k in enumerate(first)]

    def width(self, run: tuple[int, int]) -> float:
        return sum(self.opening[(run[0] + j) % len(self.opening)] for j in range(run[1]))

    def tip(self, run: tuple[int, int], radius: float) -> np.ndarray:
        """Return the edges (m, 4) of the wedge, `radius` grid units long, over sectors of a run."""
        width = self.width(run)
        steps = (
            np.linspace(0, width, max(2, math.ceil(width / (np.pi / 3)) + 1)) + self.angle[run[0]]
        )
        tips = np.rint(self.corner + radius * np.column_stack((np.cos(steps), np.sin(steps))))
        polygon = np.vstack((self.corner, tips))
        return np.hstack((polygon, np.roll(polygon, -1, axis=0)))


def sectors_at(
    v: int, xy: np.ndarray, edges: np.ndarray, side: np.ndarray, levels: Levels
) -> Sectors:
    """Return the sectors around plan vertex v."""
    surroundings = levels.order[edges.ravel()[levels.order] == v]
    arms = (xy[edges[surroundings >> 1, 1 - (surroundings & 1)]] - xy[v]).astype(float)
    angle = np.arctan2(arms[:, 1], arms[:, 0])
    opening = np.mod(np.roll(angle, -1) - angle, 2 * np.pi)
    label = side.ravel()[surroundings]
    return Sectors(
        xy[v].astype(float),
        angle.tolist(),
        opening.tolist(),
        levels.level[surroundings].tolist(),
        levels.face[surroundings].tolist(),
        label.tolist(),
    )


def cure(sectors: Sectors, radius: float) -> tuple[np.ndarray, int]:
    """Return a patch (soup, label) for a vertex that is no manifold.

    It gives the tip of the narrowest peak to the higher neighbour. Raises CompositionError if none
    mends it. Where no levels cross but a cell meets itself, the tip of what lies between its two
    arms goes to that cell.
    """
    size = len(sectors.level)
    peaks = []
    for first, count in sectors.runs(sectors.level):
        previous, following = first - 1, (first + count) % size
        if max(sectors.level[previous], sectors.level[following]) < sectors.level[first]:
            higher = previous if sectors.level[previous] >= sectors.level[following] else following
            peaks.append((sectors.width((first, count)), (first, count), sectors.label[higher]))
    if len(peaks) < 2:
        peaks = pinches(sectors)
    if not peaks:
        raise CompositionError(
            "expected levels that can be told apart around every corner, got a corner that has none"
        )
    _, run, label = min(peaks)
    return sectors.tip(run, radius), label


def pinches(sectors: Sectors) -> list[tuple[float, tuple[int, int], int]]:
    """Return (width, run, label) of what a cell that meets itself encloses, where roofed."""
    result = []
    for cell in {
        face for face, label in zip(sectors.face, sectors.label, strict=True) if label != OUTSIDE
    }:
        runs = sectors.runs([int(face == cell) for face in sectors.face])
        selected_runs = [run for run in runs if sectors.face[run[0]] != cell]
        if len(selected_runs) < 2:
            continue
        label = sectors.label[sectors.face.index(cell)]
        for first, count in selected_runs:
            roofed = all(
                sectors.label[(first + j) % len(sectors.label)] != OUTSIDE for j in range(count)
            )
            if roofed:
                result.append((sectors.width((first, count)), (first, count), label))
    return result
