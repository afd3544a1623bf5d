"""Volumes worth trying: the planes and gables that explain rectangles of points, and where each would gain most."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...compiled import compiled
from .objective import ghost_cost, point_cost
from .plan import cells_of
from .planes import (
    Cloud,
    Grid,
    best_rectangle,
    gable_pool,
    hypotheses,
    kind_of,
    plane_pool,
    reach_of_rows,
)
from .scene import Scene
from .volumes import (
    ALL,
    COLUMNS,
    DIRECTION,
    FREE,
    LEAN,
    LEVEL,
    OFFSET,
    OPPOSITE,
    PLANES,
    SIDES,
    SLOPE,
    TIE,
    coefficients,
    equalise_slopes,
    is_allowed,
    lowest,
    volume_cost,
)

ALONG_AXIS = 0.12  # a plane that leans so little off an axis or a wall is taken along it
RIDGE_INSIDE_M = 0.4  # m that a ridge lies inside the rectangle; nearer to an edge it is a slope
MOST_TOPS, MOST_PAIRS = 2, 3  # level tops and pairs of slopes, strongest first, that make hips and mansards
SAME_SLOPE = 1e-6  # rise over run; numerically equal
WRONG_COVER = 0.02  # of a point: what covering one without explaining it costs
LEAST_ABOVE_M = 1e-9  # m by which a volume has to be the higher one: numerically none
NEW_EDGES = 0.5  # units: the least that the edges of a new volume cost


class Effort(NamedTuple):
    """How many candidates are looked for: limits on time, beyond which structure that explains less stays unseen.

    `pool_points` are those that candidates are found among, `seeds` those that planes are fitted around, `pairs` those
    of points whose planes are tried. At most `planes` are kept of all points, `new_planes` of those that a roof leaves
    unexplained, and `gables` of those that explain most. So many volumes, those that grew first, are grown anew: of 40
    that were better anew none had grown later.
    """

    pool_points: int
    seeds: int
    pairs: int
    planes: int
    new_planes: int
    gables: int
    regrown: int


HOUSE = Effort(pool_points=500, seeds=100, pairs=200, planes=16, new_planes=10, gables=6, regrown=3)


def candidates_of(scene: Scene, members: np.ndarray, most_planes: int, effort: Effort = HOUSE) -> np.ndarray:
    """Volumes (m, COLUMNS) without rectangles that the points `members` (k,) speak for, in every direction; of allowed shapes."""
    grids = enumerate(grids_of(scene))
    return np.concatenate(
        [candidates_in(scene, members, direction, grid, most_planes, effort) for direction, grid in grids]
    )


def grids_of(scene: Scene) -> list[Grid]:
    """The cells between the scene's lines, for each direction."""
    return [Grid(*(axis[np.isfinite(axis)] for axis in lines)) for lines in scene.lines]


def candidates_in(
    scene: Scene, members: np.ndarray, direction: int, grid: Grid, most_planes: int, effort: Effort
) -> np.ndarray:
    """Those (m, COLUMNS) in one direction: of every plane of the pool, along an axis if need be, the gables, all pairs that form a
    ridge, and larger groups of these."""
    count = min(len(members), effort.pool_points)
    every = members[np.arange(count) * len(members) // count]
    u, v, z = (np.ascontiguousarray(x[every]) for x in (scene.U[direction], scene.V[direction], scene.z))
    few = Cloud(u, v, z, cells_of(grid.u, u), cells_of(grid.v, v))
    evidence, tolerance = scene.evidence * len(every) / len(members), scene.dead + scene.width
    pool = plane_pool(few, grid, hypotheses(few, effort.seeds, effort.pairs), tolerance, evidence, most_planes)
    if len(pool) == 0:
        return np.empty((0, COLUMNS))
    gables, counts = gable_pool(few, grid, pool, tolerance, evidence, effort.gables)
    middle = np.array([np.sort(u)[len(u) // 2], np.sort(v)[len(v) // 2]])
    along = facings(pool, middle, scene.leans[direction])
    groups, sizes = groups_of(along, gables, counts, grid)
    return volumes_of(direction, groups, sizes, scene.allowed)


@compiled
def facings(pool, middle, leans):
    """Each plane of the pool (m, 3) facing along an axis, and square to the walls that lean by `leans` (2, n), where it very nearly does;
    as it is where it does neither.

    It is turned about the points' `middle`.
    """
    found, m = np.empty((len(pool) * (1 + leans.shape[1]), 3)), 0
    for plane in pool:
        axis, first = axis_of(plane), m
        for q in range(-1, leans.shape[1]):
            lean = 0.0 if q < 0 else leans[axis, q]
            if axis < 0 or lean == np.inf:
                break
            turn = plane[1 - axis] + lean * plane[axis]
            if abs(turn) < ALONG_AXIS * abs(plane[axis]):
                found[m] = plane
                found[m, 1 - axis] = -lean * plane[axis]
                found[m, 2] += turn * middle[1 - axis]
                m += 1
        if m == first:
            found[m] = plane
            m += 1
    return found[:m]


@compiled
def groups_of(planes, gables, counts, grid):
    """Groups of planes (g, PLANES, 3) that may be volumes, and their sizes (g,): each plane, the `gables` of `counts` planes, all pairs
    that form a ridge; hips of two pairs across each other, and pairs and hips with a level top, of the strongest few."""
    n = len(planes)
    most = n + len(gables) + n * (n - 1) // 2 + MOST_PAIRS**2 + MOST_TOPS * (2 * MOST_PAIRS + MOST_PAIRS**2)
    groups, sizes = np.empty((most, PLANES, 3)), np.empty(most, np.int64)
    groups[:n, 0], sizes[:n] = planes, 1
    groups[n : n + len(gables)], sizes[n : n + len(gables)] = gables, counts
    m = n + len(gables)
    for i in range(n):
        for j in range(i):
            if has_ridge(planes[i], planes[j], grid.u, grid.v):
                groups[m, 0], groups[m, 1], sizes[m] = planes[i], planes[j], 2
                m += 1
    pairs = m
    for one in strongest(groups, sizes, n, pairs, 0):
        for other in strongest(groups, sizes, n, pairs, 1):
            groups[m, :2], groups[m, 2:4], sizes[m] = groups[one, :2], groups[other, :2], 4
            m += 1
    last, tops = m, 0
    for i in range(n):
        if axis_of(planes[i]) >= 0 or tops == MOST_TOPS:
            continue
        tops += 1
        for axis in range(2):
            for pair in strongest(groups, sizes, n, pairs, axis):
                groups[m, :2], groups[m, 2], sizes[m] = groups[pair, :2], planes[i], 3
                m += 1
        for hip in range(pairs, last):
            groups[m, :4], groups[m, 4], sizes[m] = groups[hip, :4], planes[i], 5
            m += 1
    return groups[:m], sizes[:m]


@compiled
def strongest(groups, sizes, first, last, axis):
    """The first MOST_PAIRS of the groups from `first` to `last` that are two planes facing along an axis."""
    found, m = np.empty(MOST_PAIRS, np.int64), 0
    for q in range(first, last):
        if m < MOST_PAIRS and sizes[q] == 2 and axis_of(groups[q, 0]) == axis:
            found[m] = q
            m += 1
    return found[:m]


@compiled
def volumes_of(direction, groups, sizes, allowed):
    """Volumes (m, COLUMNS) of those groups of planes that are `allowed` shapes."""
    found, m = np.empty((len(groups), COLUMNS)), 0
    for q in range(len(groups)):
        volume, is_one = volume_of(direction, groups[q, : sizes[q]], allowed)
        if is_one:
            found[m] = volume
            m += 1
    return found[:m]


@compiled
def axis_of(plane):
    """The axis that an inclined plane faces most nearly along; -1 for a level one."""
    return int(abs(plane[1]) > abs(plane[0])) if kind_of(plane) else -1


@compiled
def has_ridge(one, other, u, v):
    """Whether two planes fall away from a ridge inside the plan, whose grid lines are `u`, `v`."""
    axis = axis_of(one)
    if axis < 0 or axis_of(other) != axis or one[axis] * other[axis] >= 0.0:
        return False
    rising, falling = (one, other) if one[axis] > 0.0 else (other, one)
    lines, across = (u, v) if axis == 0 else (v, u)
    y = 0.5 * (across[0] + across[-1])
    at = (falling[2] - rising[2] + (falling[1 - axis] - rising[1 - axis]) * y) / (rising[axis] - falling[axis])
    return lines[0] + RIDGE_INSIDE_M < at < lines[-1] - RIDGE_INSIDE_M


@compiled
def volume_of(direction, planes, allowed):
    """A volume of planes (m, 3), and whether it is one of the `allowed` shapes, if need be with opposite slopes equal; it is none
    where two planes face the same way."""
    volume = np.zeros(COLUMNS)
    volume[DIRECTION], volume[OFFSET : OFFSET + PLANES] = direction, np.inf
    for plane in planes:
        axis = axis_of(plane)
        place = LEVEL if axis < 0 else 2 * axis + int(plane[axis] < 0.0)
        if volume[OFFSET + place] < np.inf:
            return volume, False
        volume[OFFSET + place] = plane[2]
        if axis >= 0:
            volume[SLOPE + place] = abs(plane[axis])
            volume[LEAN + place] = plane[1 - axis] / abs(plane[axis])
    volume[TIE] = tie_of(volume)
    if not is_allowed(volume, allowed):
        volume[TIE] = OPPOSITE
        equalise_slopes(volume)
    return volume, is_allowed(volume, allowed)


@compiled
def tie_of(volume):
    """The tightest tie that holds of a volume's slopes."""
    offset, slope = volume[OFFSET : OFFSET + SIDES], volume[SLOPE : SLOPE + SIDES]
    low, high, count = np.inf, -np.inf, 0
    for k in range(SIDES):
        if offset[k] < np.inf:
            low, high, count = min(low, slope[k]), max(high, slope[k]), count + 1
    if count == SIDES and high - low < SAME_SLOPE:
        return ALL
    for k in (0, 2):
        if offset[k] < np.inf and offset[k + 1] < np.inf and abs(slope[k] - slope[k + 1]) >= SAME_SLOPE:
            return FREE
    return OPPOSITE if count > 1 else FREE


@compiled
def best_rectangles(scene, candidates, cell_u, cell_v, cost_now, z_now, replacing):
    """For each candidate the rectangle of cells (m, 4) in which it gains most, and that gain (m,) less its price.

    `cell_u`, `cell_v` (directions, n + g) are the cells of points and ghosts between the scene's lines. Joining the max a candidate only counts where it is above the roof `z_now`; `replacing` it counts everywhere. Candidates that
    cannot come near the best found are left out (minus infinity).
    """
    gains, rectangles = np.full(len(candidates), -np.inf), np.zeros((len(candidates), 4), np.int64)
    above, gain = np.full(len(z_now), -np.inf) if replacing else z_now + LEAST_ABOVE_M, np.empty(len(z_now))
    threshold, most, cell_counts = 0.0, cost_now.sum(), (scene.lines < np.inf).sum(axis=2) - 1
    for m in range(len(candidates)):
        direction = int(candidates[m, DIRECTION])
        price = scene.evidence * (volume_cost(candidates[m]) + NEW_EDGES)
        least = price + threshold
        if most <= least or gains_at_places(scene, candidates, m, cost_now, above, gain) <= least:
            continue
        nu, nv = cell_counts[direction]
        cells, reach, column = np.zeros((nu, nv)), np.empty(nu + 1), np.empty(nv)
        for i in range(len(gain)):
            cells[cell_u[direction, i], cell_v[direction, i]] += gain[i]
        reach_of_rows(cells, reach)
        if reach[0] <= least:
            continue
        score, i0, i1, j0, j1 = best_rectangle(cells, max(least, 1e-6), reach, column)
        if i1 > i0:
            gains[m] = score - price
            rectangles[m] = (i0, i1, j0, j1)
            threshold = max(threshold, 0.5 * gains[m])
    return gains, rectangles


@compiled
def gains_at_places(scene, candidates, m, cost_now, above, gain):
    """Fill `gain` (n + g,) with what candidate m saves at points and ghosts where it is higher than `above` (n + g,); returns the sum
    over those that gain.

    Loops without branches over arrays of their own: a processor does several places at once.
    """
    direction, n, c = int(candidates[m, DIRECTION]), scene.n, coefficients(candidates, m)
    u, v, z = scene.U[direction], scene.V[direction], scene.z
    dead, width = scene.dead, scene.width
    for i in range(n):
        h = lowest(c, u[i], v[i])
        cost = point_cost(z[i], h, dead, width)
        gain[i] = cost_now[i] - (cost if cost < 1.0 else 1.0 + WRONG_COVER) if h > above[i] else 0.0
    u, v, weight, shade = u[n:], v[n:], scene.weight[n:], scene.shade[n:]
    low, high = scene.low, scene.high
    before, above, saved = cost_now[n:], above[n:], gain[n:]
    for i in range(len(u)):
        h = lowest(c, u[i], v[i])
        saved[i] = before[i] - ghost_cost(h, weight[i], shade[i], low, high) if h > above[i] else 0.0
    return sum_of_gains(gain)


@compiled(fastmath=True)
def sum_of_gains(gain):
    total = 0.0
    for x in gain:
        total += max(x, 0.0)
    return total
