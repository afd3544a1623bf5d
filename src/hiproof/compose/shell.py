"""From plan cells to a closed shell: roof faces over the cells, walls where levels part, one ground face below."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..errors import CompositionError
from ..model import GROUND, ROOF, WALL, Face, Solid
from .arrangement import COLLINEAR_UNITS, GRID_M, OUTSIDE
from .cells import PlanCells, PlanProblem
from .levels import first_saddle, split_at_crossings, stack_levels

SETBACK_M = 0.01
MIN_SETBACK_M = 0.003


class Saddle(Exception):
    """The levels around a plan vertex rise and fall twice; `patch` (soup, label) cuts one tip off and cures it."""

    def __init__(self, patch: tuple[np.ndarray, int]):
        super().__init__("the roof's levels form a checkerboard around a vertex")
        self.patch = patch


def raise_shell(cells: PlanCells, problem: PlanProblem, z_ground: float, clearance_m: float, reach_m: float) -> Solid:
    """Solid over the plan cells. Raises Saddle where the problem needs a patch first, CompositionError when none helps.

    The ground is lowered where needed to stay `clearance_m` under the lowest roof vertex.
    """
    planes = problem.planes
    xy, edges, side, ties = split_at_crossings(cells.xy, cells.edges, cells.side, planes, reach_m / GRID_M)
    if len(edges) == 0:
        raise CompositionError(
            "expected an outline with an area, got one thinner than a millimetre; repair or remove the footprint"
        )
    z_low = lowest_roof(xy, edges, side, planes) - clearance_m / GRID_M
    z_base = np.floor(min(z_ground / GRID_M, z_low))
    order, start, follow, face, level, vertices = stack_levels(xy, edges, side, planes, z_base, ties)
    saddle = first_saddle(order, start, level)
    if saddle >= 0:
        raise Saddle(tip_patch(xy, edges, side, order[start[saddle] : start[saddle + 1]], level))
    follow, face, level, label = follow.tolist(), face.tolist(), level.tolist(), side.ravel().tolist()
    faces = roof_faces(follow, face, level, label, vertices, problem.part)
    rises = wall_rises(follow, level)
    runs = wall_runs(rises, follow, label, vertices)
    skip = {rises[h][0] for run in runs for h in run[1:]}
    faces += [Face((tuple(v for v in wall_ring(run, rises) if v not in skip),), WALL) for run in runs]
    faces.append(ground_face(follow, level, label, skip, vertices))
    return compacted(vertices, faces)


def lowest_roof(xy: np.ndarray, edges: np.ndarray, side: np.ndarray, planes: np.ndarray) -> float:
    """Lowest roof height at any vertex of any cell, in grid units."""
    label = np.repeat(side.ravel(), 2)
    corners = xy[np.repeat(edges, 2, axis=0)].reshape(-1, 2)[label != OUTSIDE]
    a, b, c = planes[label[label != OUTSIDE]].T
    return float((a * corners[:, 0] + b * corners[:, 1] + c).min())


def walks(follow: list[int], chosen: list[bool]) -> list[list[int]]:
    """Closed walks of the chosen half-edges, each as a list of half-edges."""
    seen = [False] * len(follow)
    found = []
    for first in range(len(follow)):
        if seen[first] or not chosen[first]:
            continue
        walk, h = [], first
        while not seen[h]:
            seen[h] = True
            walk.append(h)
            h = follow[h]
        found.append(walk)
    return found


def simple_loops(ring: list[int]) -> list[list[int]]:
    """A closed walk over vertices cut into loops that visit none of them twice."""
    loops, path, position = [], [], {}
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


def signed_area(ring: list[int], vertices: np.ndarray) -> float:
    """Plan area of a ring of vertex indices, positive counter-clockwise."""
    x, y = vertices[ring, 0] - vertices[ring[0], 0], vertices[ring, 1] - vertices[ring[0], 1]
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def roof_faces(
    follow: list[int], face: list[int], level: list[int], label: list[int], vertices: np.ndarray, part: np.ndarray
) -> list[Face]:
    """A RoofSurface a cell: its outer walk counter-clockwise from above, then its holes."""
    rings_of: dict[int, list[list[int]]] = {}
    label_of = {}
    for walk in walks(follow, [here != OUTSIDE for here in label]):
        label_of[face[walk[0]]] = label[walk[0]]
        rings_of.setdefault(face[walk[0]], []).extend(simple_loops([level[h] for h in walk]))
    faces = []
    for cell, rings in rings_of.items():
        if len(rings) > 1:
            rings.sort(key=lambda ring: -signed_area(ring, vertices))
        faces.append(Face(tuple(map(tuple, rings)), ROOF, int(part[label_of[cell]])))
    return faces


def ground_face(follow: list[int], level: list[int], label: list[int], skip: set[int], vertices: np.ndarray) -> Face:
    """The GroundSurface: the walks around the outside, which run counter-clockwise seen from below.

    `skip` are ground vertices in the middle of a straight wall, which nothing else needs.
    """
    rings = []
    for walk in walks(follow, [here == OUTSIDE for here in label]):
        rings += simple_loops([level[h] for h in walk if level[h] not in skip])
    rings.sort(key=lambda ring: signed_area(ring, vertices))
    return Face(tuple(map(tuple, rings)), GROUND)


def wall_rises(follow: list[int], level: list[int]) -> dict[int, tuple[int, int, int, int]]:
    """Half-edges whose left cell stands above the right one, with their levels (low, high at origin, low, high at end)."""
    rises = {}
    for h in range(len(follow)):
        low_u, high_u, low_v, high_v = level[follow[h ^ 1]], level[h], level[h ^ 1], level[follow[h]]
        if high_u > low_u or high_v > low_v:
            rises[h] = (low_u, high_u, low_v, high_v)
    return rises


def wall_runs(
    rises: dict[int, tuple[int, int, int, int]], follow: list[int], label: list[int], vertices: np.ndarray
) -> list[list[int]]:
    """Half-edges with walls, grouped: consecutive ones on a straight stretch of the outline make one wall."""
    outer = {follow[h ^ 1] ^ 1: h for h in rises if label[h ^ 1] == OUTSIDE}
    after = {before: h for before, h in outer.items() if is_straight([before, h], rises, vertices)}
    runs = [[h] for h in rises if label[h ^ 1] != OUTSIDE]
    starts = set(outer.values()) - set(after.values())
    for first in sorted(starts):
        run = [first]
        while run[-1] in after:
            following = after[run[-1]]
            if is_straight([*run, following], rises, vertices):
                run.append(following)
            else:
                runs.append(run)
                run = [following]
        runs.append(run)
    return runs


def is_straight(run: list[int], rises: dict[int, tuple[int, int, int, int]], vertices: np.ndarray) -> bool:
    """Whether all ground vertices inside a run lie on the line between its ends."""
    ax, ay = vertices[rises[run[0]][0], :2].tolist()
    bx, by = vertices[rises[run[-1]][2], :2].tolist()
    length = max(math.hypot(bx - ax, by - ay), 1.0)
    for h in run[1:]:
        x, y = vertices[rises[h][0], :2].tolist()
        along = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length
        across = abs((x - ax) * (by - ay) - (y - ay) * (bx - ax)) / length
        if across > COLLINEAR_UNITS or not 0 < along < length:
            return False
    return True


def wall_ring(run: list[int], rises: dict[int, tuple[int, int, int, int]]) -> list[int]:
    """Ring of the wall over a run of plan edges, counter-clockwise seen from its right, through every level on the way."""
    low_u, high_u, _, _ = rises[run[0]]
    _, _, low_v, high_v = rises[run[-1]]
    ring = [low_u, *range(low_v, high_v)]
    for h, before in zip(reversed(run), [*reversed(run[:-1]), None], strict=True):
        ring.append(rises[h][3])
        if before is not None:
            start, end = rises[h][1], rises[before][3]
            ring += range(start, end, 1 if end > start else -1)
    ring += range(high_u, low_u, -1)
    return list(dict.fromkeys(ring))


def compacted(vertices: np.ndarray, faces: list[Face]) -> Solid:
    """Solid with the vertices that faces use, in metres."""
    used = np.unique([v for face in faces for ring in face.rings for v in ring])
    number = np.empty(len(vertices), np.int64)
    number[used] = np.arange(len(used))
    renumber = number.tolist()
    faces = [replace(face, rings=tuple(tuple(renumber[v] for v in ring) for ring in face.rings)) for face in faces]
    return Solid(np.round(vertices[used] * GRID_M, 4), tuple(faces))


def tip_patch(xy: np.ndarray, edges: np.ndarray, side: np.ndarray, around: np.ndarray, level: np.ndarray):
    """Patch (soup, label) that gives the tip of the narrowest peak around a plan vertex to its higher neighbour.

    `around` are the half-edges out of the vertex, counter-clockwise.
    """
    size = len(around)
    levels = [int(level[h]) for h in around]
    ends = np.array([xy[edges[h >> 1, 1 - (h & 1)]] for h in around], float)
    corner = xy[edges[around[0] >> 1, around[0] & 1]].astype(float)
    arms = ends - corner
    length = np.hypot(*arms.T)
    angle = np.arctan2(arms[:, 1], arms[:, 0])
    opening = np.mod(np.roll(angle, -1) - angle, 2 * np.pi)
    labels = side.ravel()[around]
    best = None
    for k in range(size):
        if levels[k - 1] >= levels[k]:
            continue
        last = k
        while levels[(last + 1) % size] == levels[k]:
            last += 1
        if levels[(last + 1) % size] > levels[k]:
            continue
        width = sum(opening[j % size] for j in range(k, last + 1))
        if best is None or width < best[0]:
            before, after = k - 1, (last + 1) % size
            lower = labels[before] if levels[before] >= levels[after] else labels[after]
            best = (width, k, last, int(lower))
    width, first, _, lower = best
    radius = min(SETBACK_M / GRID_M, 0.4 * length.min())
    if radius < MIN_SETBACK_M / GRID_M:
        raise CompositionError(
            "expected room to set back a corner where roof levels meet crosswise, got edges too short"
        )
    steps = np.linspace(0, width, max(2, int(np.ceil(width / (np.pi / 3))) + 1)) + angle[first]
    tips = np.rint(corner + radius * np.column_stack((np.cos(steps), np.sin(steps))))
    polygon = np.vstack((corner, tips))
    return np.hstack((polygon, np.roll(polygon, -1, axis=0))), lower
