"""Find volumes worth trying, and where each would gain most.

They are made of the planes and gables that explain rectangles of points.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from ...geometry.arrays import copy_row, copy_rows, sort_values
from ..layout.plan import Cloud
from ..layout.scene import Scene
from ..misfit import compute_cell_cost, compute_point_cost
from .planes import (
    RIDGE_STEP_M,
    Grid,
    bound_rows,
    classify_plane,
    find_best_rectangle,
    list_hypotheses,
    pool_gables,
    pool_planes,
)
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

ALONG_AXIS = 0.12  # A plane that leans less off an axis or a wall is turned along it.
MOST_TOPS = 2  # Most level tops that make hips and mansards, strongest first.
MOST_PAIRS = 3  # Most pairs of slopes that make hips and mansards, strongest first.
SAME_SLOPE = 1e-6  # Slopes (rise over run) and leans that differ less are numerically equal.
WRONG_COVER = 0.02  # Price (points) of covering a point without explaining it.
# Most planes that are found among the points that a roof leaves unexplained. What explains less
# stays unseen.
MOST_PLANES = 10
# Least points among which candidates are found, and around which planes are fitted: limits on time.
# Of many points they are three in four, and one in eight.
LEAST_POOL, LEAST_SEEDS = 500, 100


def list_candidates(scene: Scene, members: np.ndarray) -> np.ndarray:
    """List volumes (m, COLUMNS) without rectangles that points suggest.

    They have allowed shapes, in every direction. The points are `members` (k,).
    """
    return np.concatenate(
        [list_candidates_along(scene, members, direction) for direction in range(len(scene.turn))]
    )


def list_candidates_along(scene: Scene, members: np.ndarray, direction: int) -> np.ndarray:
    """List the candidates (m, COLUMNS) in one direction.

    They are made of every plane of the pool, turned along an axis if necessary, of gables, of all
    pairs that form a ridge, and of larger groups of these.
    """
    count = min(len(members), max(LEAST_POOL, 3 * scene.n // 4))
    numbers = members[np.arange(count) * len(members) // count]
    grid = Grid(*(axis[np.isfinite(axis)] for axis in scene.lines[direction]))
    places = (scene.U, scene.V, scene.cell_u, scene.cell_v)
    u, v, i, j = (x[direction][numbers] for x in places)
    cloud = Cloud(u, v, scene.z[numbers], i, j)
    unit, tolerance = scene.unit * len(numbers) / len(members), scene.dead + scene.width
    pool = pool_planes(
        cloud,
        grid,
        list_hypotheses(cloud, max(LEAST_SEEDS, scene.n // 8)),
        tolerance,
        unit,
        MOST_PLANES,
    )
    if len(pool) == 0:
        return np.empty((0, COLUMNS))
    gables, counts = pool_gables(cloud, grid, pool, tolerance, unit)
    middle = np.array([sort_values(u)[len(u) // 2], sort_values(v)[len(v) // 2]])
    along = turn_to_walls(pool, middle, scene.leans[direction])
    groups, sizes = group_planes(along, gables, counts, grid)
    return make_volumes(direction, groups, sizes, scene.allowed)


@compiled
def turn_to_walls(pool, middle, leans):
    """Turn planes to the axis or the wall that they very nearly face.

    Each plane of the pool (m, 3) faces along an axis, and square to the walls that lean by `leans`
    (2, n), if it nearly does. Otherwise it stays as it is. It turns about the points' `middle`.
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
                copy_row(turned_planes[m], plane)
                turned_planes[m, 1 - axis] = -lean * plane[axis]
                turned_planes[m, 2] += turn * middle[1 - axis]
                m += 1
        if m == first:
            copy_row(turned_planes[m], plane)
            m += 1
    return turned_planes[:m]


@compiled
def group_planes(planes, gables, counts, grid):
    """Return groups of planes (g, N_PLANES, 3) that may be volumes, and their sizes.

    These are each plane, the `gables` of `counts` planes, and all pairs that form a ridge. The
    strongest pairs also make hips of two pairs across each other, and pairs and hips with a level
    top.
    """
    n = len(planes)
    most_groups = (
        n
        + len(gables)
        + n * (n - 1) // 2
        + MOST_PAIRS**2
        + MOST_TOPS * (2 * MOST_PAIRS + MOST_PAIRS**2)
    )
    groups, sizes = np.empty((most_groups, N_PLANES, 3)), np.empty(most_groups, np.int64)
    for m in range(n):
        copy_row(groups[m, 0], planes[m])
        sizes[m] = 1
    for m in range(n, n + len(gables)):
        copy_rows(groups[m], gables[m - n])
        sizes[m] = counts[m - n]
    m = n + len(gables)
    for i in range(n):
        for j in range(i):
            if has_ridge(planes[i], planes[j], grid.u, grid.v):
                copy_row(groups[m, 0], planes[i])
                copy_row(groups[m, 1], planes[j])
                sizes[m] = 2
                m += 1
    pairs = m
    for first_pair in select_strongest(groups, sizes, n, pairs, 0):
        for second_pair in select_strongest(groups, sizes, n, pairs, 1):
            copy_rows(groups[m], groups[first_pair, :2])
            copy_rows(groups[m, 2:], groups[second_pair, :2])
            sizes[m] = 4
            m += 1
    last, tops = m, 0
    for i in range(n):
        if find_axis(planes[i]) >= 0 or tops == MOST_TOPS:
            continue
        tops += 1
        for axis in range(2):
            for pair in select_strongest(groups, sizes, n, pairs, axis):
                copy_rows(groups[m], groups[pair, :2])
                copy_row(groups[m, 2], planes[i])
                sizes[m] = 3
                m += 1
        for hip in range(pairs, last):
            copy_rows(groups[m], groups[hip, :4])
            copy_row(groups[m, 4], planes[i])
            sizes[m] = 5
            m += 1
    return groups[:m], sizes[:m]


@compiled
def select_strongest(groups, sizes, first, last, axis):
    """Return the first MOST_PAIRS pairs of planes that face along an axis.

    They are numbers of groups from `first` to `last`.
    """
    numbers, m = np.empty(MOST_PAIRS, np.int64), 0
    for q in range(first, last):
        if m < MOST_PAIRS and sizes[q] == 2 and find_axis(groups[q, 0]) == axis:
            numbers[m] = q
            m += 1
    return numbers[:m]


@compiled
def make_volumes(direction, groups, sizes, allowed):
    """Return volumes (m, COLUMNS) of the groups of planes that are `allowed` shapes."""
    volumes, m = np.empty((len(groups), COLUMNS)), 0
    for q in range(len(groups)):
        volume, is_one = make_volume(direction, groups[q, : sizes[q]], allowed)
        if is_one:
            copy_row(volumes[m], volume)
            m += 1
    return volumes[:m]


@compiled
def find_axis(plane):
    """Return the axis that an inclined plane most nearly faces, -1 for a level one."""
    return int(abs(plane[1]) > abs(plane[0])) if classify_plane(plane) else -1


@compiled
def has_ridge(plane, other, u, v):
    """Return whether two planes fall away from a ridge inside the plan.

    The plan's grid lines are `u`, `v`.
    """
    axis = find_axis(plane)
    if axis < 0 or find_axis(other) != axis or plane[axis] * other[axis] >= 0.0:
        return False
    rising, falling = (plane, other) if plane[axis] > 0.0 else (other, plane)
    lines, across = (u, v) if axis == 0 else (v, u)
    y = 0.5 * (across[0] + across[-1])
    ridge = (falling[2] - rising[2] + (falling[1 - axis] - rising[1 - axis]) * y) / (
        rising[axis] - falling[axis]
    )
    return lines[0] + RIDGE_STEP_M < ridge < lines[-1] - RIDGE_STEP_M


@compiled
def make_volume(direction, planes, allowed):
    """Make a volume of planes (m, 3), and return whether its shape is `allowed`.

    If necessary, opposite slopes become equal. It is no volume where two planes face the same way.
    """
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
    """Return the tightest tie that holds between a volume's slopes."""
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
def count_cells(lines):
    """Count the cells between `lines`, which are infinite where there are none."""
    count = -1
    for line in lines:
        count += line < np.inf
    return count


@compiled
def find_best_rectangles(scene, candidates, cost_now, z_now, replacing):
    """Find, for each candidate, the rectangle of cells (m, 4) in which it gains most.

    Also returns that gain (m,) less the candidate's price. A candidate counts where it is above the
    roof `z_now`, and everywhere if it is `replacing`. Candidates that cannot come near the best are
    left out (minus infinity).
    """
    gains, rectangles = np.full(len(candidates), -np.inf), np.zeros((len(candidates), 4), np.int64)
    floor, gain = (
        np.full(len(z_now), -np.inf) if replacing else z_now,
        np.empty(len(z_now)),
    )
    threshold, most_gain = 0.0, cost_now.sum()
    for m in range(len(candidates)):
        direction = int(candidates[m, DIRECTION])
        price = scene.unit * price_volume(candidates[m])
        least_gain = price + threshold
        if (
            most_gain <= least_gain
            or fill_gains(scene, candidates, m, cost_now, floor, gain) <= least_gain
        ):
            continue
        nu, nv = count_cells(scene.lines[direction, 0]), count_cells(scene.lines[direction, 1])
        cells, reach, column = np.zeros((nu, nv)), np.empty(nu + 1), np.empty(nv)
        for i in range(len(gain)):
            cells[scene.cell_u[direction, i], scene.cell_v[direction, i]] += gain[i]
        bound_rows(cells, reach)
        if reach[0] <= least_gain:
            continue
        score, i0, i1, j0, j1 = find_best_rectangle(cells, max(least_gain, 1e-6), reach, column)
        if i1 > i0:
            gains[m] = score - price
            rectangles[m, 0], rectangles[m, 1] = i0, i1
            rectangles[m, 2], rectangles[m, 3] = j0, j1
            threshold = max(threshold, 0.5 * gains[m])
    return gains, rectangles


@compiled
def fill_gains(scene, candidates, m, cost_now, floor, gain):
    """Fill `gain` (n + g,) with what candidate m saves where it is above `floor`.

    Returns the sum over the points and unobserved cells that gain. The loops have no branches and
    use arrays of their own, so a processor computes several places at once.
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


@compiled
def sum_gains(gain):
    total = 0.0
    for i in range(len(gain)):  # twice as fast as a loop over the values
        total += max(gain[i], 0.0)
    return total
