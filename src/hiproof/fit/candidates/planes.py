"""Search for the planes of a roof. Compiled.

Everything is in the building's frame: u, v (m) along its two main directions, z (m) about the
median height. A plane is (a, b, c) with z = a u + b v + c. The cost of a point is min((dz / tau)^2,
1): a point that no plane explains costs one. A unit of structure costs `unit` points.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ...compiled import compiled
from ...geometry.arrays import compute_median, copy_row, copy_rows, list_distinct, sort_order
from ..prices import KIND_COST
from .volumes import SLOPE_LOW

MAX_SLOPE = 2.5  # Steepest slope (rise over run), 68 degrees.
PART_PLANES = 5  # Most planes of one part.
# Ridge that keeps the slope of a plane determined when its points lie on a line.
SLOPE_RIDGE = 2e-4
NEIGHBOUR_RADIUS_M = 2.5  # Points further away (m) are no neighbours.
LOCAL_POINTS = (9, 17)  # Numbers of points of a local plane.
RIDGE_STEP_M = 0.4  # Distance (m) between the ridges tried, and of any from the plan's border.
PLANE_BIN = 0.05  # Planes nearer to each other (rise over run, and m at the centre) are one.
PAIRS_A_SEED = 2  # Pairs of a seed and a point near it whose planes are tried.
MOST_GABLES = 6  # Most gables of a pool: a limit on time.
TEMPLATE_POINTS = 150  # Points that templates are fitted to: few are enough for a start.

Grid = namedtuple("Grid", "u v")  # Grid lines, ascending.


@compiled
def classify_plane(plane):
    """Return 0 for a level plane, 1 for one sloping along u, 2 along v, and 3 freely."""
    return (1 if abs(plane[0]) > 1e-9 else 0) + (2 if abs(plane[1]) > 1e-9 else 0)


@compiled
def truncate_cost(residual, tau):
    q = (residual / tau) ** 2
    return q if q < 1.0 else 1.0


@compiled
def find_lowest_row(rows, u, v):
    """Return the height at u, v of the lowest of planes (k, 3), and its index.

    Planes that are absent are NaN.
    """
    best, plane = np.inf, 0
    for k in range(len(rows)):
        h = rows[k, 0] * u + rows[k, 1] * v + rows[k, 2]
        if h < best:
            best, plane = h, k
    return best, plane


@compiled
def solve_three(xx, xy, x1, yy, y1, n, xz, yz, z1):
    """Solve a symmetric 3 x 3 system.

    Its upper rows are (xx, xy, x1), (yy, y1), and (n,). The right side is xz, yz, z1. Returns the
    three unknowns, and False if it is singular.
    """
    if abs(xx) < 1e-12:
        return 0.0, 0.0, 0.0, False
    f = xy / xx
    yy, upper, yz = yy - f * xy, y1 - f * x1, yz - f * xz
    f = x1 / xx
    lower, n, z1 = y1 - f * xy, n - f * x1, z1 - f * xz
    if abs(yy) < 1e-12:
        return 0.0, 0.0, 0.0, False
    f = lower / yy
    n, z1 = n - f * upper, z1 - f * yz
    if abs(n) < 1e-12:
        return 0.0, 0.0, 0.0, False
    c = z1 / n
    b = (yz - upper * c) / yy
    return (xz - xy * b - x1 * c) / xx, b, c, True


@compiled
def sum_plane_cost(cloud, members, plane, tau):
    total = 0.0
    for i in members:
        total += truncate_cost(
            cloud.z[i] - plane[0] * cloud.u[i] - plane[1] * cloud.v[i] - plane[2], tau
        )
    return total


@compiled
def step_biweight(cloud, members, plane, scale, mask, centre_u, centre_v):
    """Make one re-weighted least-squares step of `plane` on `members`.

    Also returns False if too little weight is left.
    """
    xx = xy = x1 = yy = y1 = weight = xz = yz = z1 = 0.0
    for i in members:
        r = (cloud.z[i] - plane[0] * cloud.u[i] - plane[1] * cloud.v[i] - plane[2]) / scale
        w = 1.0 - r * r
        if w <= 0.0:
            continue
        w *= w
        x, y, z = cloud.u[i] - centre_u, cloud.v[i] - centre_v, cloud.z[i]
        xx += w * x * x
        xy += w * x * y
        x1 += w * x
        yy += w * y * y
        y1 += w * y
        weight += w
        xz += w * x * z
        yz += w * y * z
        z1 += w * z
    if weight < 0.5 * (1 + mask[0] + mask[1]) + 1.0:
        return plane, False
    xx += SLOPE_RIDGE * weight
    yy += SLOPE_RIDGE * weight
    if not mask[0]:
        xx, xy, x1, xz = 1.0, 0.0, 0.0, 0.0
    if not mask[1]:
        xy, yy, y1, yz = 0.0, 1.0, 0.0, 0.0
    a, b, c, ok = solve_three(xx, xy, x1, yy, y1, weight, xz, yz, z1)
    return np.array([a, b, c - (a * centre_u + b * centre_v)]), ok


@compiled
def fit_plane(cloud, members, start, tau, unit):
    """Fit the best of a level, two axis-sloped and a free plane near `start`.

    It has the lowest truncated cost plus complexity.
    """
    n = len(members)
    centre_u, centre_v = 0.0, 0.0
    for i in members:
        centre_u += cloud.u[i] / n
        centre_v += cloud.v[i] / n
    start_kind = classify_plane(start)
    best = start.copy()
    best_cost = sum_plane_cost(cloud, members, start, tau) + unit * KIND_COST[start_kind]
    mask = np.ones(3, np.bool_)
    for kind in range(4):
        mask[0], mask[1] = kind == 1 or kind == 3, kind >= 2
        plane, ok = start.copy(), True
        for step in range(4):
            scale = tau * (2.0 if step == 0 else 1.5 if step == 1 else 1.0)
            if step == 0 and kind != start_kind:
                scale *= 2.0
            plane, ok = step_biweight(cloud, members, plane, scale, mask, centre_u, centre_v)
            if not ok:
                break
        if not ok or plane[0] ** 2 + plane[1] ** 2 > MAX_SLOPE**2:
            continue
        cost = sum_plane_cost(cloud, members, plane, tau) + unit * KIND_COST[kind]
        if cost < best_cost:
            best_cost, best = cost, plane
    return best, best_cost


@compiled
def fit_local_plane(cloud, nearest, count):
    """Fit a plane to the first `count` of `nearest` by least squares.

    Points are trimmed once, at twice the median residual.
    """
    a = b = c = 0.0
    limit, ok = np.inf, True
    u0, v0 = cloud.u[nearest[0]], cloud.v[nearest[0]]
    residuals = np.empty(count)
    for _ in range(2):
        xx = xy = x1 = yy = y1 = n_kept = xz = yz = z1 = 0.0
        for q in range(count):
            i = nearest[q]
            x, y, z = cloud.u[i] - u0, cloud.v[i] - v0, cloud.z[i]
            if abs(z - a * x - b * y - c) > limit:
                continue
            xx += x * x
            xy += x * y
            x1 += x
            yy += y * y
            y1 += y
            n_kept += 1.0
            xz += x * z
            yz += y * z
            z1 += z
        if n_kept < 4.0:
            break
        a, b, c, ok = solve_three(xx + 1e-6, xy, x1, yy + 1e-6, y1, n_kept, xz, yz, z1)
        if not ok:
            break
        for q in range(count):
            i = nearest[q]
            residuals[q] = abs(cloud.z[i] - a * (cloud.u[i] - u0) - b * (cloud.v[i] - v0) - c)
        limit = 2.0 * find_median(residuals) + 1e-3
    c -= a * u0 + b * v0
    return np.array([a, b, c]), ok and a**2 + b**2 < MAX_SLOPE**2


@compiled
def find_median(values):
    """Return the median of some ten `values`, which it sorts.

    Numba's np.median takes four times as long for so few.
    """
    for q in range(1, len(values)):
        x, place = values[q], q
        while place > 0 and values[place - 1] > x:
            values[place] = values[place - 1]
            place -= 1
        values[place] = x
    half = len(values) // 2
    return values[half] if len(values) % 2 == 1 else 0.5 * (values[half - 1] + values[half])


@compiled
def list_flat_planes(z, out):
    """List a level plane at every height (0.1 m apart) of a point, and count them."""
    steps = list_distinct(np.rint(z / 0.1))
    count = min(len(steps), len(out))
    for q in range(count):
        out[q, 2] = steps[q * len(steps) // count] * 0.1
    return count


@compiled
def find_neighbours(cloud, i, squares, near_points, distance2, nearest):
    """Find the points within NEIGHBOUR_RADIUS_M of point `i`, and the closest of them.

    They go into `near_points` and `nearest`, closest first. `squares` (n,) and `distance2` are room
    for squared distances of all and of the closest. Returns how many of each.
    """
    u, v = cloud.u, cloud.v
    for q in range(len(u)):  # no branches: a processor does several points at once
        squares[q] = (u[q] - u[i]) ** 2 + (v[q] - v[i]) ** 2
    count = n_nearest = 0
    for q in range(len(u)):
        near_points[count] = q
        count += int(squares[q] < NEIGHBOUR_RADIUS_M**2)
    for q in near_points[:count]:
        d2 = squares[q]
        if n_nearest == len(nearest) and d2 >= distance2[n_nearest - 1]:
            continue
        n_nearest = min(n_nearest + 1, len(nearest))
        place = n_nearest - 1
        while place > 0 and distance2[place - 1] > d2:
            distance2[place], nearest[place] = distance2[place - 1], nearest[place - 1]
            place -= 1
        distance2[place], nearest[place] = d2, q
    return count, n_nearest


@compiled
def list_hypotheses(cloud, most_seeds):
    """List candidate planes (m, 3): level, local, and through pairs of points.

    The last slope along the axes. Seeds and partners are spread evenly (golden-ratio sequence) over
    the sorted points, so nothing is random.
    """
    n = len(cloud.u)
    flats = min(n, 200)
    seeds = min(n, most_seeds)
    out = np.zeros((flats + seeds * (2 + 2 * PAIRS_A_SEED), 3))
    m = list_flat_planes(cloud.z, out[:flats])
    near_points, nearest = np.empty(n, np.int64), np.empty(max(LOCAL_POINTS), np.int64)
    squares, distance2 = np.empty(n), np.empty(len(nearest))
    fraction = 0.5
    for s in range(seeds):
        i = s * n // seeds
        count, n_nearest = find_neighbours(cloud, i, squares, near_points, distance2, nearest)
        for size in LOCAL_POINTS:
            if min(n_nearest, size) >= 5:
                plane, ok = fit_local_plane(cloud, nearest, min(n_nearest, size))
                if ok:
                    copy_row(out[m], plane)
                    m += 1
        for _ in range(PAIRS_A_SEED):
            fraction = (fraction + 0.6180339887498949) % 1.0
            m = append_pair_slopes(cloud, i, near_points[int(fraction * count)], out, m)
    return select_distinct(out[:m], np.mean(cloud.u), np.mean(cloud.v))


@compiled
def select_distinct(planes, centre_u, centre_v):
    """Select one of all `planes` (m, 3) in the same bins of PLANE_BIN.

    Bins are those of slopes and of height at the centre.
    """
    keys = np.empty(len(planes))
    for q in range(len(planes)):
        a, b, c = planes[q]
        height = a * centre_u + b * centre_v + c
        keys[q] = 0
        for value in (a, b, height):
            keys[q] = keys[q] * 100003 + np.floor(value / PLANE_BIN + 0.5)
    order = sort_order(keys)
    first = np.ones(len(planes), np.bool_)
    for q in range(1, len(planes)):
        first[order[q]] = keys[order[q]] != keys[order[q - 1]]
    return planes[first]


@compiled
def append_pair_slopes(cloud, i, j, out, m):
    """Append the planes along u and along v through points i and j.

    The points must be far enough apart.
    """
    dz = cloud.z[j] - cloud.z[i]
    for axis in range(2):
        x = cloud.u if axis == 0 else cloud.v
        dx = x[j] - x[i]
        if abs(dx) > 0.7 and SLOPE_LOW < abs(dz / dx) < MAX_SLOPE:
            out[m, axis] = dz / dx
            out[m, 2] = cloud.z[i] - dz / dx * x[i]
            m += 1
    return m


@compiled
def bound_rows(gain, reach):
    """Fill `reach` (nu + 1,) with bounds of the sums of `gain` from each row on.

    No rectangle within the rows from i on has a larger sum than reach[i].
    """
    reach[-1] = 0.0
    for i in range(len(gain) - 1, -1, -1):
        best_run = running = 0.0
        for j in range(gain.shape[1]):
            running = max(running + gain[i, j], 0.0)
            best_run = max(best_run, running)
        reach[i] = reach[i + 1] + best_run


@compiled
def find_best_rectangle(gain, least_sum, reach, column):
    """Find the rectangle of cells with the largest sum of `gain` above `least_sum`.

    Returns sum, i0, i1, j0, j1, half open. It is Kadane's method in 2D, without rows that cannot
    bring more than the best (`reach` of `bound_rows`). `column` (nv,) is room to work in. If
    nothing is above `least_sum`, that is the sum and the rectangle is empty.
    """
    nu, nv = gain.shape
    best, i0_best, i1_best, j0_best, j1_best = least_sum, 0, 0, 0, 0
    for i0 in range(nu):
        if reach[i0] <= best:
            break
        column[:] = 0.0
        for i1 in range(i0, nu):
            for j in range(nv):
                column[j] += gain[i1, j]
            highest = reach[i0] - reach[i1 + 1]
            if highest > best:
                highest, running, j0 = -np.inf, 0.0, 0
                for j in range(nv):
                    if running <= 0.0:
                        running, j0 = column[j], j
                    else:
                        running += column[j]
                    highest = max(highest, running)
                    if running > best:
                        best, i0_best, i1_best, j0_best, j1_best = running, i0, i1 + 1, j0, j + 1
            if max(highest, 0.0) + reach[i1 + 1] <= best:
                break
    return best, i0_best, i1_best, j0_best, j1_best


@compiled
def fill_point_gains(cloud, planes, count, current, tau, gain):
    """Fill `gain` (n,) with the drop of cost under the min of `planes`.

    Returns the sum over the points that gain.
    """
    a, b, c = planes[0]
    for q in range(len(gain)):
        gain[q] = a * cloud.u[q] + b * cloud.v[q] + c
    for k in range(1, count):
        a, b, c = planes[k]
        for q in range(len(gain)):
            gain[q] = min(gain[q], a * cloud.u[q] + b * cloud.v[q] + c)
    total = 0.0
    for q in range(len(gain)):
        r = (cloud.z[q] - gain[q]) / tau
        gain[q] = current[q] - min(r * r, 1.0)
        total += max(gain[q], 0.0)
    return total


@compiled
def fill_cell_gains(cloud, gain_of_point, gain):
    """Fill `gain` (nu, nv) with the sums over each cell's points.

    Returns the sum over the cells that gain.
    """
    gain[:] = 0.0
    for q in range(len(gain_of_point)):
        gain[cloud.i[q], cloud.j[q]] += gain_of_point[q]
    total = 0.0
    for i in range(gain.shape[0]):
        for j in range(gain.shape[1]):
            total += max(gain[i, j], 0.0)
    return total


@compiled
def find_best_candidate(cloud, candidates, counts, bounds, current, tau, least_gain, gain):
    """Find the candidate with the best rectangle.

    `bounds` are upper bounds of each candidate's gain, and costs only ever fall. Ever dearer bounds
    are tried in turn: the sum over the points that gain, over the cells that gain, and over the
    best run of every row. Returns gain, candidate or -1, and its rectangle, and tightens `bounds`
    in place.
    """
    gain_of_point = np.empty(len(cloud.u))
    for m in range(len(bounds)):
        if bounds[m] == np.inf:
            bounds[m] = fill_point_gains(
                cloud, candidates[m], counts[m], current, tau, gain_of_point
            )
    best, number, rectangle = least_gain, -1, (0, 0, 0, 0)
    reach, column = np.empty(len(gain) + 1), np.empty(gain.shape[1])
    promising = np.nonzero(bounds > least_gain)[0]
    for m in promising[sort_order(-bounds[promising])]:
        if bounds[m] <= best:
            break
        bounds[m] = fill_point_gains(cloud, candidates[m], counts[m], current, tau, gain_of_point)
        if bounds[m] <= best:
            continue
        bounds[m] = fill_cell_gains(cloud, gain_of_point, gain)
        if bounds[m] <= best:
            continue
        bound_rows(gain, reach)
        score, i0, i1, j0, j1 = find_best_rectangle(gain, best, reach, column)
        bounds[m] = min(reach[0], score)
        if score > best:
            best, number, rectangle = score, m, (i0, i1, j0, j1)
    return best, number, rectangle


@compiled
def select_members(cloud, rectangle):
    i0, i1, j0, j1 = rectangle
    return np.nonzero((cloud.i >= i0) & (cloud.i < i1) & (cloud.j >= j0) & (cloud.j < j1))[0]


@compiled
def lower_costs(cloud, members, planes, tau, current):
    """Lower `current` (n,) to the cost under the min of `planes` (k, 3) for `members`."""
    for i in members:
        z, _ = find_lowest_row(planes, cloud.u[i], cloud.v[i])
        current[i] = min(current[i], truncate_cost(cloud.z[i] - z, tau))


@compiled
def pool_planes(cloud, grid, candidates, tau, unit, most_planes):
    """Pool planes (k, 3) greedily, each refitted over its best rectangle.

    It ends when little is gained.
    """
    gain = np.empty((len(grid.u) - 1, len(grid.v) - 1))
    current = np.ones(len(cloud.u))
    bounds = np.full(len(candidates), np.inf)
    stacked = candidates.reshape((len(candidates), 1, 3))
    counts = np.ones(len(candidates), np.int64)
    pool = np.zeros((most_planes, 3))
    for k in range(most_planes):
        _, m, rectangle = find_best_candidate(
            cloud, stacked, counts, bounds, current, tau, 1.5 * unit, gain
        )
        if m < 0:
            return pool[:k]
        members = select_members(cloud, rectangle)
        plane, _ = fit_plane(cloud, members, candidates[m], tau, unit)
        copy_row(pool[k], plane)
        lower_costs(cloud, members, plane.reshape((1, 3)), tau, current)
        lower_costs(cloud, members, stacked[m], tau, current)
    return pool


@compiled
def mirror_gables(pool, grid):
    """Mirror every axis-sloped plane of the pool about ridges RIDGE_STEP_M apart.

    Returns candidates (m, PART_PLANES, 3).
    """
    steps_u = int((grid.u[-1] - grid.u[0]) / RIDGE_STEP_M) + 2
    steps_v = int((grid.v[-1] - grid.v[0]) / RIDGE_STEP_M) + 2
    out = np.zeros((len(pool) * (steps_u + steps_v), PART_PLANES, 3))
    m = 0
    for plane in pool:
        kind = classify_plane(plane)
        if kind != 1 and kind != 2:
            continue
        lines = grid.u if kind == 1 else grid.v
        slope = plane[kind - 1]
        if abs(slope) < 0.15:
            continue
        ridge = lines[0] + 0.5
        while ridge < lines[-1] - 0.4:
            copy_row(out[m, 0], plane)
            out[m, 1, kind - 1] = -slope
            out[m, 1, 2] = plane[2] + 2.0 * slope * ridge
            ridge += RIDGE_STEP_M
            m += 1
    return out[:m]


@compiled
def fill_symmetric_planes(height, slope_u, top_u, centre_u, slope_v, top_v, centre_v, out):
    """Fill `out` with planes of a roof symmetric about its centre, and count them.

    It is z = height - max(slope_u (|u - centre_u| - top_u), slope_v (...)). A slope of 0 leaves its
    pair out.
    """
    k = 0
    for axis in range(2):
        slope, top, centre = (slope_u, top_u, centre_u) if axis == 0 else (slope_v, top_v, centre_v)
        if slope > 0.0:
            for sign in (1.0, -1.0):
                out[k] = 0.0
                out[k, axis] = sign * slope
                out[k, 2] = height + slope * (top - sign * centre)
                k += 1
    return k


@compiled
def fit_template(z, drop, slope, tau):
    """Fit height and slope of z = height - slope * drop (n,) robustly.

    It begins with a start slope. The slope is 0 if it fails.
    """
    height, weights = compute_median(z + slope * drop), np.empty(len(drop))
    for step in range(5):
        scale = tau * (3.0 if step == 0 else 2.0 if step == 1 else 1.5)
        n = sx = sy = sxx = sxy = 0.0
        for i in range(len(drop)):  # no branches: a processor does several points at once
            r = (z[i] - height + slope * drop[i]) / scale
            w = 1.0 - r * r
            weights[i] = w * w if w > 0.0 else 0.0
        for i in range(len(drop)):
            w = weights[i]
            n += w
            sx += w * drop[i]
            sy += w * z[i]
            sxx += w * drop[i] * drop[i]
            sxy += w * drop[i] * z[i]
        determinant = n * sxx - sx * sx
        if n < 2.0 or determinant < 1e-6:
            return height, 0.0
        slope = -(n * sxy - sx * sy) / determinant
        height = (sy + slope * sx) / n
        if not SLOPE_LOW < slope < MAX_SLOPE:
            return height, 0.0
    return height, slope


@compiled
def fit_whole_roofs(cloud, grid, tau):
    """Fit gables, a pyramid and a hip over the whole plan from several start slopes.

    Returns candidates (m, PART_PLANES, 3) and counts. Few points are enough: at most twice
    TEMPLATE_POINTS of the cloud's are used.
    """
    stride = max(1, len(cloud.u) // TEMPLATE_POINTS)
    u, v, z = cloud.u[::stride].copy(), cloud.v[::stride].copy(), cloud.z[::stride].copy()
    out, counts, m = np.zeros((64, PART_PLANES, 3)), np.zeros(64, np.int64), 0
    half_u, half_v = 0.5 * (grid.u[-1] - grid.u[0]), 0.5 * (grid.v[-1] - grid.v[0])
    mid_u, mid_v = grid.u[0] + half_u, grid.v[0] + half_v
    long = 0 if half_u >= half_v else 1
    for shape in range(8):
        shift = (0.0, 0.25, -0.25)[shape % 3] if shape < 6 else 0.0
        centre_u, centre_v = (
            mid_u + shift * half_u * (shape < 3),
            mid_v + shift * half_v * (shape >= 3),
        )
        away_u, away_v = np.abs(u - centre_u), np.abs(v - centre_v)
        ratio, top = 1.0, 0.0
        if shape < 3:
            drop = away_u
        elif shape < 6:
            drop = away_v
        elif shape == 6:  # pyramid: drop in units of v
            ratio = half_v / half_u
            drop = np.maximum(away_u * ratio, away_v)
        else:  # hip with one slope
            top = abs(half_u - half_v)
            drop = np.maximum(away_u - top * (long == 0), away_v - top * (long == 1))
        for start in (0.2, 0.45, 0.8, 1.3):
            height, slope = fit_template(z, drop, start, tau)
            if slope == 0.0:
                continue
            slope_u = slope * ratio if shape < 3 or shape >= 6 else 0.0
            slope_v = slope if shape >= 3 else 0.0
            counts[m] = fill_symmetric_planes(
                height,
                slope_u,
                top * (long == 0),
                centre_u,
                slope_v,
                top * (long == 1),
                centre_v,
                out[m],
            )
            m += 1
    return out[:m], counts[:m]


@compiled
def pool_gables(cloud, grid, pool, tau, unit):
    """Pool symmetric gables, pyramids and hips (k, PART_PLANES, 3) greedily.

    Also returns their counts of planes.
    """
    gain = np.empty((len(grid.u) - 1, len(grid.v) - 1))
    mirrored = mirror_gables(pool, grid)
    whole, whole_counts = fit_whole_roofs(cloud, grid, tau)
    candidates = np.concatenate((mirrored, whole))
    counts = np.concatenate((np.full(len(mirrored), 2, np.int64), whole_counts))
    bounds = np.full(len(candidates), np.inf)
    current = np.ones(len(cloud.u))
    gables, gable_counts = np.zeros((MOST_GABLES, PART_PLANES, 3)), np.zeros(MOST_GABLES, np.int64)
    for k in range(MOST_GABLES):
        _, m, rectangle = find_best_candidate(
            cloud, candidates, counts, bounds, current, tau, 1.5 * unit, gain
        )
        if m < 0:
            return gables[:k], gable_counts[:k]
        members = select_members(cloud, rectangle)
        copy_rows(gables[k], candidates[m])
        gable_counts[k] = counts[m]
        lower_costs(cloud, members, candidates[m, : counts[m]], tau, current)
    return gables, gable_counts
