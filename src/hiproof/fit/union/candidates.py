"""Volumes worth trying: the planes and gables that explain rectangles of points, and where each would gain most."""

from __future__ import annotations

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

# points that candidates are found among; points planes are fitted around; pairs of points whose planes are tried
POOL_POINTS, SEEDS, PAIRS = 500, 100, 200
MOST_GABLES = 6  # gables kept of those that explain most
ALONG_AXIS = 0.12  # a plane that leans so little off an axis or a wall is taken along it
RIDGE_INSIDE_M = 0.4  # m that a ridge lies inside the rectangle; nearer to an edge it is a slope
MOST_TOPS, MOST_PAIRS = 2, 3  # level tops and pairs of slopes, strongest first, that make hips and mansards
SAME_SLOPE = 1e-6  # rise over run; numerically equal
WRONG_COVER = 0.02  # of a point: what covering one without explaining it costs
LEAST_ABOVE_M = 1e-9  # m by which a volume has to be the higher one: numerically none
NEW_EDGES = 0.5  # units: the least that the edges of a new volume cost


def candidates_of(scene: Scene, members: np.ndarray, most_planes: int) -> np.ndarray:
    """Volumes (m, COLUMNS) without rectangles that the points `members` (k,) speak for, in every direction; of allowed shapes."""
    found = [
        volume_of(direction, np.array(planes), scene.allowed)
        for direction, grid in enumerate(grids_of(scene))
        for planes in candidates_in(scene, members, direction, grid, most_planes)
    ]
    return np.array([volume for volume, allowed in found if allowed]).reshape(-1, COLUMNS)


def grids_of(scene: Scene) -> list[Grid]:
    """The cells between the scene's lines, for each direction."""
    return [Grid(*(axis[np.isfinite(axis)] for axis in lines)) for lines in scene.lines]


def candidates_in(
    scene: Scene, members: np.ndarray, direction: int, grid: Grid, most_planes: int
) -> list[list[np.ndarray]]:
    """The planes of each in one direction: every plane of the pool, along an axis if need be, the gables, all pairs that form a ridge."""
    every = members[np.arange(min(len(members), POOL_POINTS)) * len(members) // min(len(members), POOL_POINTS)]
    u, v, z = (np.ascontiguousarray(x[every]) for x in (scene.U[direction], scene.V[direction], scene.z))
    few = Cloud(u, v, z, cells_of(grid.u, u), cells_of(grid.v, v))
    evidence, tolerance = scene.evidence * len(every) / len(members), scene.dead + scene.width
    pool = plane_pool(few, grid, hypotheses(few, SEEDS, PAIRS), tolerance, evidence, most_planes)
    if len(pool) == 0:
        return []
    gables, counts = gable_pool(few, grid, pool, tolerance, evidence, MOST_GABLES)
    middle = np.array([np.sort(u)[len(u) // 2], np.sort(v)[len(v) // 2]])
    along = [facing for plane in pool for facing in facings(plane, middle, scene.leans[direction])]
    pairs = [list(g[:c]) for g, c in zip(gables, counts, strict=True)]
    pairs += [[p, q] for i, p in enumerate(along) for q in along[:i] if has_ridge(p, q, grid.u, grid.v)]
    return [[plane] for plane in along] + pairs + larger_groups(along, pairs)


def larger_groups(planes: list[np.ndarray], pairs: list[list[np.ndarray]]) -> list[list[np.ndarray]]:
    """Hips of two pairs across each other, and pairs and hips with a level top: those of the strongest few."""
    flats = [plane for plane in planes if axis_of(plane) < 0][:MOST_TOPS]
    across = [[pair for pair in pairs if len(pair) == 2 and axis_of(pair[0]) == axis][:MOST_PAIRS] for axis in (0, 1)]
    hips = [one + other for one in across[0] for other in across[1]]
    return hips + [group + [flat] for flat in flats for group in (*across[0], *across[1], *hips)]


def facings(plane: np.ndarray, middle: np.ndarray, leans: np.ndarray) -> list[np.ndarray]:
    """The plane facing along an axis, and square to the walls that lean by `leans` (2, m), where it very nearly does; as it is where it
    does neither.

    It is turned about the points' `middle`.
    """
    axis = axis_of(plane)
    if axis < 0:
        return [plane]
    found = []
    for lean in (0.0, *leans[axis][np.isfinite(leans[axis])]):
        turned = plane.copy()
        turned[1 - axis] = -lean * plane[axis]
        if abs(turned[1 - axis] - plane[1 - axis]) < ALONG_AXIS * abs(plane[axis]):
            turned[2] += (plane - turned)[:2] @ middle
            found.append(turned)
    return found or [plane]


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
