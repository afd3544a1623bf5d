"""Volumes worth trying: the planes and gables that explain rectangles of points, and where each would gain most."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...compiled import compiled
from .objective import compute_cell_cost, compute_point_cost
from .plan import find_cells
from .planes import (
    Cloud,
    Grid,
    bound_rows,
    classify_plane,
    find_best_rectangle,
    list_hypotheses,
    pool_gables,
    pool_planes,
)
from .scene import Scene
from .volumes import (
    ALL_EQUAL,
    COLUMNS,
    DIRECTION,
    FREE,
    LEAN0,
    LEVEL,
    N_PLANES,
    N_SIDES,
    OFFSET0,
    OPPOSITE,
    SLOPE0,
    TIE,
    equalise_slopes,
    find_lowest,
    is_allowed,
    price_volume,
    read_coefficients,
)

ALONG_AXIS = 0.12  # a plane that leans so little off an axis or a wall is taken along it
RIDGE_INSIDE_M = 0.4  # m that a ridge lies inside the rectangle; nearer to an edge it is a slope
MOST_TOPS, MOST_PAIRS = (
    2,
    3,
)  # level tops and pairs of slopes, strongest first, that make hips and mansards
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


def list_candidates(
    scene: Scene, members: np.ndarray, most_planes: int, effort: Effort = HOUSE
) -> np.ndarray:
    """Volumes (m, COLUMNS) without rectangles that the points `members` (k,) speak for, in every direction; of allowed shapes."""
    grids = enumerate(make_grids(scene))
    return np.concatenate(
        [
            list_candidates_along(scene, members, direction, grid, most_planes, effort)
            for direction, grid in grids
        ]
    )


def make_grids(scene: Scene) -> list[Grid]:
    """The cells between the scene's lines, for each direction."""
    return [Grid(*(axis[np.isfinite(axis)] for axis in lines)) for lines in scene.lines]


def list_candidates_along(
    scene: Scene, members: np.ndarray, direction: int, grid: Grid, most_planes: int, effort: Effort
) -> np.ndarray:
    """Those (m, COLUMNS) in one direction: of every plane of the pool, along an axis if need be, the gables, all pairs that form a
    ridge, and larger groups of these."""
    count = min(len(members), effort.pool_points)
    numbers = members[np.arange(count) * len(members) // count]
    u, v, z = (
        np.ascontiguousarray(x[numbers]) for x in (scene.U[direction], scene.V[direction], scene.z)
    )
    cloud = Cloud(u, v, z, find_cells(grid.u, u), find_cells(grid.v, v))
    evidence, tolerance = scene.evidence * len(numbers) / len(members), scene.dead + scene.width
    pool = pool_planes(
        cloud,
        grid,
        list_hypotheses(cloud, effort.seeds, effort.pairs),
        tolerance,
        evidence,
        most_planes,
    )
    if len(pool) == 0:
        return np.empty((0, COLUMNS))
    gables, counts = pool_gables(cloud, grid, pool, tolerance, evidence, effort.gables)
    middle = np.array([np.sort(u)[len(u) // 2], np.sort(v)[len(v) // 2]])
    along = turn_to_walls(pool, middle, scene.leans[direction])
    groups, sizes = group_planes(along, gables, counts, grid)
    return make_volumes(direction, groups, sizes, scene.allowed)


@compiled
def turn_to_walls(pool, middle, leans):
    """Each plane of the pool (m, 3) facing along an axis, and square to the walls that lean by `leans` (2, n), where it very nearly does;
    as it is where it does neither.

    It is turned about the points' `middle`.
    """
    turned_planes, m = np.empty((len(pool) * (1 + leans.shape[1]), 3)), 0
    for plane in pool:
        axis, first = find_axis(plane), m
        for q in range(-1, leans.shape[1]):
            lean = 0.0 if q < 0 else leans[axis, q]
            if axis < 0 or lean == np.inf:
                break
            turn = plane[1 - axis] + lean * plane[axis]
            if abs(turn) < ALONG_AXIS * abs(plane[axis]):
                turned_planes[m] = plane
                turned_planes[m, 1 - axis] = -lean * plane[axis]
                turned_planes[m, 2] += turn * middle[1 - axis]
                m += 1
        if m == first:
            turned_planes[m] = plane
            m += 1
    return turned_planes[:m]


@compiled
def group_planes(planes, gables, counts, grid):
    """Groups of planes (g, PLANES, 3) that may be volumes, and their sizes (g,): each plane, the `gables` of `counts` planes, all pairs
    that form a ridge; hips of two pairs across each other, and pairs and hips with a level top, of the strongest few."""
    n = len(planes)
    most_groups = (
        n
        + len(gables)
        + n * (n - 1) // 2
        + MOST_PAIRS**2
        + MOST_TOPS * (2 * MOST_PAIRS + MOST_PAIRS**2)
    )
    groups, sizes = np.empty((most_groups, N_PLANES, 3)), np.empty(most_groups, np.int64)
    groups[:n, 0], sizes[:n] = planes, 1
    groups[n : n + len(gables)], sizes[n : n + len(gables)] = gables, counts
    m = n + len(gables)
    for i in range(n):
        for j in range(i):
            if has_ridge(planes[i], planes[j], grid.u, grid.v):
                groups[m, 0], groups[m, 1], sizes[m] = planes[i], planes[j], 2
                m += 1
    pairs = m
    for first_pair in select_strongest(groups, sizes, n, pairs, 0):
        for second_pair in select_strongest(groups, sizes, n, pairs, 1):
            groups[m, :2], groups[m, 2:4], sizes[m] = (
                groups[first_pair, :2],
                groups[second_pair, :2],
                4,
            )
            m += 1
    last, tops = m, 0
    for i in range(n):
        if find_axis(planes[i]) >= 0 or tops == MOST_TOPS:
            continue
        tops += 1
        for axis in range(2):
            for pair in select_strongest(groups, sizes, n, pairs, axis):
                groups[m, :2], groups[m, 2], sizes[m] = groups[pair, :2], planes[i], 3
                m += 1
        for hip in range(pairs, last):
            groups[m, :4], groups[m, 4], sizes[m] = groups[hip, :4], planes[i], 5
            m += 1
    return groups[:m], sizes[:m]


@compiled
def select_strongest(groups, sizes, first, last, axis):
    """The first MOST_PAIRS of the groups from `first` to `last` that are two planes facing along an axis."""
    numbers, m = np.empty(MOST_PAIRS, np.int64), 0
    for q in range(first, last):
        if m < MOST_PAIRS and sizes[q] == 2 and find_axis(groups[q, 0]) == axis:
            numbers[m] = q
            m += 1
    return numbers[:m]


@compiled
def make_volumes(direction, groups, sizes, allowed):
    """Volumes (m, COLUMNS) of those groups of planes that are `allowed` shapes."""
    volumes, m = np.empty((len(groups), COLUMNS)), 0
    for q in range(len(groups)):
        volume, is_one = make_volume(direction, groups[q, : sizes[q]], allowed)
        if is_one:
            volumes[m] = volume
            m += 1
    return volumes[:m]


@compiled
def find_axis(plane):
    """The axis that an inclined plane faces most nearly along; -1 for a level one."""
    return int(abs(plane[1]) > abs(plane[0])) if classify_plane(plane) else -1


@compiled
def has_ridge(plane, other, u, v):
    """Whether two planes fall away from a ridge inside the plan, whose grid lines are `u`, `v`."""
    axis = find_axis(plane)
    if axis < 0 or find_axis(other) != axis or plane[axis] * other[axis] >= 0.0:
        return False
    rising, falling = (plane, other) if plane[axis] > 0.0 else (other, plane)
    lines, across = (u, v) if axis == 0 else (v, u)
    y = 0.5 * (across[0] + across[-1])
    ridge = (falling[2] - rising[2] + (falling[1 - axis] - rising[1 - axis]) * y) / (
        rising[axis] - falling[axis]
    )
    return lines[0] + RIDGE_INSIDE_M < ridge < lines[-1] - RIDGE_INSIDE_M


@compiled
def make_volume(direction, planes, allowed):
    """A volume of planes (m, 3), and whether it is one of the `allowed` shapes, if need be with opposite slopes equal; it is none
    where two planes face the same way."""
    volume = np.zeros(COLUMNS)
    volume[DIRECTION], volume[OFFSET0 : OFFSET0 + N_PLANES] = direction, np.inf
    for plane in planes:
        axis = find_axis(plane)
        place = LEVEL if axis < 0 else 2 * axis + int(plane[axis] < 0.0)
        if volume[OFFSET0 + place] < np.inf:
            return volume, False
        volume[OFFSET0 + place] = plane[2]
        if axis >= 0:
            volume[SLOPE0 + place] = abs(plane[axis])
            volume[LEAN0 + place] = plane[1 - axis] / abs(plane[axis])
    volume[TIE] = find_tie(volume)
    if not is_allowed(volume, allowed):
        volume[TIE] = OPPOSITE
        equalise_slopes(volume)
    return volume, is_allowed(volume, allowed)


@compiled
def find_tie(volume):
    """The tightest tie that holds of a volume's slopes."""
    offset, slope = volume[OFFSET0 : OFFSET0 + N_SIDES], volume[SLOPE0 : SLOPE0 + N_SIDES]
    flattest, steepest, count = np.inf, -np.inf, 0
    for k in range(N_SIDES):
        if offset[k] < np.inf:
            flattest, steepest, count = min(flattest, slope[k]), max(steepest, slope[k]), count + 1
    if count == N_SIDES and steepest - flattest < SAME_SLOPE:
        return ALL_EQUAL
    for k in (0, 2):
        if (
            offset[k] < np.inf
            and offset[k + 1] < np.inf
            and abs(slope[k] - slope[k + 1]) >= SAME_SLOPE
        ):
            return FREE
    return OPPOSITE if count > 1 else FREE


@compiled
def find_best_rectangles(scene, candidates, cell_u, cell_v, cost_now, z_now, replacing):
    """For each candidate the rectangle of cells (m, 4) in which it gains most, and that gain (m,) less its price.

    `cell_u`, `cell_v` (directions, n + g) are the cells of points and ghosts between the scene's lines. Joining the max a candidate only counts where it is above the roof `z_now`; `replacing` it counts everywhere. Candidates that
    cannot come near the best found are left out (minus infinity).
    """
    gains, rectangles = np.full(len(candidates), -np.inf), np.zeros((len(candidates), 4), np.int64)
    floor, gain = (
        np.full(len(z_now), -np.inf) if replacing else z_now + LEAST_ABOVE_M,
        np.empty(len(z_now)),
    )
    threshold, most_gain, cell_counts = 0.0, cost_now.sum(), (scene.lines < np.inf).sum(axis=2) - 1
    for m in range(len(candidates)):
        direction = int(candidates[m, DIRECTION])
        price = scene.evidence * (price_volume(candidates[m]) + NEW_EDGES)
        least_gain = price + threshold
        if (
            most_gain <= least_gain
            or fill_gains(scene, candidates, m, cost_now, floor, gain) <= least_gain
        ):
            continue
        nu, nv = cell_counts[direction]
        cells, reach, column = np.zeros((nu, nv)), np.empty(nu + 1), np.empty(nv)
        for i in range(len(gain)):
            cells[cell_u[direction, i], cell_v[direction, i]] += gain[i]
        bound_rows(cells, reach)
        if reach[0] <= least_gain:
            continue
        score, i0, i1, j0, j1 = find_best_rectangle(cells, max(least_gain, 1e-6), reach, column)
        if i1 > i0:
            gains[m] = score - price
            rectangles[m] = (i0, i1, j0, j1)
            threshold = max(threshold, 0.5 * gains[m])
    return gains, rectangles


@compiled
def fill_gains(scene, candidates, m, cost_now, floor, gain):
    """Fill `gain` (n + g,) with what candidate m saves at points and ghosts where it is higher than `floor` (n + g,); returns the sum
    over those that gain.

    Loops without branches over arrays of their own: a processor does several places at once.
    """
    direction, n, c = int(candidates[m, DIRECTION]), scene.n, read_coefficients(candidates, m)
    u, v, z = scene.U[direction], scene.V[direction], scene.z
    dead, width = scene.dead, scene.width
    for i in range(n):
        h = find_lowest(c, u[i], v[i])
        cost = compute_point_cost(z[i], h, dead, width)
        gain[i] = cost_now[i] - (cost if cost < 1.0 else 1.0 + WRONG_COVER) if h > floor[i] else 0.0
    u, v, weight, shade = u[n:], v[n:], scene.weight[n:], scene.shade[n:]
    z_low, z_high = scene.low, scene.high
    cost_before, floor, saved = cost_now[n:], floor[n:], gain[n:]
    for i in range(len(u)):
        h = find_lowest(c, u[i], v[i])
        saved[i] = (
            cost_before[i] - compute_cell_cost(h, weight[i], shade[i], z_low, z_high)
            if h > floor[i]
            else 0.0
        )
    return sum_gains(gain)


@compiled(fastmath=True)
def sum_gains(gain):
    total = 0.0
    for x in gain:
        total += max(x, 0.0)
    return total
