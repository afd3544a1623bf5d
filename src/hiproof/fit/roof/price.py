"""Price a roof in a box: the misfit of its points, and the structure that is drawn there.

A price is a sum over places, but for unknowns and volumes, of which each costs once. So the price
of a change is the difference in any box that holds all that it moves.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ...compiled import compiled
from ..misfit import compute_cell_cost, compute_point_cost
from ..prices import (
    CORNER_UNITS,
    GIVEN_UNITS,
    LACK_UNITS,
    NARROW_M,
    SKEW_UNITS,
    SPAN_UNITS,
    UNKNOWN_UNITS,
    VOLUME_UNITS,
)
from .draw import (
    RING_CORNERS,
    compute_heights,
    cut_part,
    draw,
    is_near,
    list_corners,
    measure_area,
    meets,
    widen_box,
)
from .steps import list_steps
from .tables import LINE_COUNT, N_SIDES, ONE_PLANE, UNKNOWN_COUNT, VOLUME_COUNT, place_planes

OVER_M = 0.03  # Points so far (m) beside a volume are over it.
MOST_SKEW = 0.4  # Sine of the angle from which on a plane is meant to face another way.
DAMPING = 0.05  # Points that hold an unknown at its value.

Site = namedtuple(
    "Site",
    "x y z weight shade n low high dead width unit parts part_sizes part_boxes lines bays "
    "bay_heights bounds area narrow keeps_shapes",
)
"""What the roof of a building has to explain.

- x, y, z, weight, shade (n + g,): points, then unobserved cells, each ascending by x.
- n: the number of points. low, high: the heights that a roof may have over cells.
- dead, width: a point costs min((max(|dz| - dead, 0) / width)^2, 1).
- unit: the points that a unit of structure must explain.
- parts (p, c, 2), part_sizes (p,), part_boxes (p, 4): convex parts of the outline.
- lines (m, 6): lines of the outline, as `site.list_outline_lines` says.
- bays (b, 4, 3), bay_heights (b,): sides and heights of places that a wall cuts off.
- bounds (4,): least and greatest x and y of the outline. area: its area (m2).
- narrow: a volume is narrow below this width (m).
- keeps_shapes: whether volumes keep their planes, because not all types may be built.
"""

Known = namedtuple("Known", "costs corners steps units extents")
"""What is known of a roof as it is.

What each point and cell costs (n + g,), where its corners (c, 2) are, its steps (s, 3) with the
units of each, the units of its tables, and those of how far each volume extends (v,).
"""


@compiled
def list_view(roof, boxes):
    """Return the numbers of volumes that reach into one of the boxes (n, 4), or to its points."""
    out, count = np.empty(roof.counts[VOLUME_COUNT], np.int64), 0
    for k in range(roof.counts[VOLUME_COUNT]):
        for box in boxes:
            if roof.n_planes[k] > 0 and is_near(roof.boxes[k], box, OVER_M):
                out[count] = k
                count += 1
                break
    return out[:count]


@compiled
def list_points(site, boxes):
    """Return the numbers of the points and cells in any of the boxes (n, 4)."""
    points = list_points_in_box(site, join_boxes(boxes))
    if len(boxes) == 1:
        return points
    is_inside = np.zeros(len(points), np.bool_)
    for x0, x1, y0, y1 in boxes:
        x, y = site.x[points], site.y[points]
        is_inside |= (x > x0) & (x < x1) & (y > y0) & (y < y1)
    return points[is_inside]


@compiled
def join_boxes(boxes):
    """Return the box around boxes (n, 4)."""
    box = boxes[0].copy()
    for other in boxes[1:]:
        widen_box(box, other)
    return box


@compiled
def list_points_in_box(site, box):
    first, last = np.searchsorted(site.x[: site.n], box[:2])
    first_cell, last_cell = site.n + np.searchsorted(site.x[site.n :], box[:2])
    out, count = np.empty(last - first + last_cell - first_cell, np.int64), 0
    y, y0, y1 = site.y, box[2], box[3]
    for start, end in ((first, last), (first_cell, last_cell)):
        for i in range(start, end):  # a number that does not count is overwritten by the next
            out[count] = i
            count += (y[i] > y0) & (y[i] < y1)
    return out[:count]


@compiled
def compute_judged_heights(roof, site, view, points):
    """Return the heights of the roof and its volumes over the points and cells of `points` (n,).

    Points come before cells. The last value is the number of points.
    """
    heights, volumes = np.empty(len(points)), np.empty(len(points), np.int64)
    n, x, y = np.searchsorted(points, site.n), site.x[points], site.y[points]
    compute_heights(roof, view, x[:n], y[:n], OVER_M, heights[:n], volumes[:n])
    compute_heights(roof, view, x[n:], y[n:], 0.0, heights[n:], volumes[n:])
    return heights, volumes, n


@compiled
def compute_costs(roof, site, view, points):
    """Return what each (n,) of the points and cells of the numbers `points` costs."""
    heights, _, n = compute_judged_heights(roof, site, view, points)
    costs = np.empty(len(points))
    for m in range(n):
        costs[m] = compute_point_cost(site.z[points[m]], heights[m], site.dead, site.width)
    for m in range(n, len(points)):
        i = points[m]
        costs[m] = compute_cell_cost(heights[m], site.weight[i], site.shade[i], site.low, site.high)
    return costs


@compiled
def price_misfit(roof, site, view, points):
    """Return what the points and cells of the numbers `points` cost."""
    return compute_costs(roof, site, view, points).sum()


@compiled
def price_drawing(roof, drawing, site, box, most):
    """Return the units of what is drawn in a box, without steps if corners cost `most`."""
    corners, steps = draw_structure(roof, drawing, site, box, most)
    return CORNER_UNITS * len(corners) + steps[:, 2].sum()


@compiled
def draw_structure(roof, drawing, site, box, most):
    """Draw a box. Returns its corners (c, 2), and its steps (s, 3) with what they cost (units).

    Steps are not drawn where corners cost `most` units or more.
    """
    draw(roof, drawing, list_view(roof, box.reshape(1, 4)), site, box)
    corners = list_corners(roof, drawing, box)
    if CORNER_UNITS * len(corners) >= most:
        return corners, np.empty((0, 3))
    view = list_view(roof, widen(box, NARROW_M).reshape(1, 4))
    return corners, list_steps(roof, drawing, view, site, box)


@compiled
def price_tables(roof):
    """Return the units of all volumes, lines and unknowns."""
    total, is_used = 0.0, np.zeros(roof.counts[UNKNOWN_COUNT], np.bool_)
    is_side = np.zeros(roof.counts[LINE_COUNT], np.bool_)
    for k in range(roof.counts[VOLUME_COUNT]):
        if roof.n_planes[k] == 0:
            continue
        total += VOLUME_UNITS
        for s in range(N_SIDES):
            line = abs(roof.sides[k, s]) - 1
            if not is_side[line]:
                is_side[line] = True
                total += roof.lines[line, 3]
        for p in range(roof.n_planes[k]):
            height, slope = roof.heights[k, p], roof.slopes[k, p]
            if not is_used[height]:
                is_used[height] = True
                total += UNKNOWN_UNITS
            if slope >= 0 and not is_used[slope]:
                is_used[slope] = True
                total += UNKNOWN_UNITS
        total += SKEW_UNITS * count_skew_planes(roof, k)
    return total


@compiled
def widen(box, reach):
    return np.array([box[0] - reach, box[1] + reach, box[2] - reach, box[3] + reach])


@compiled
def list_extents(roof, site):
    """Return the units (v,) of how far each volume extends."""
    extents = np.zeros(len(roof.sides))
    for k in range(roof.counts[VOLUME_COUNT]):
        extents[k] = price_extent(roof, k, site) if roof.n_planes[k] > 0 else 0.0
    return extents


@compiled
def compare_extents(roof, trial, extents, site):
    """Return the units that a trial saves by extending less than a roof of `extents` (v,)."""
    total = 0.0
    for k in range(trial.counts[VOLUME_COUNT]):
        is_same = k < roof.counts[VOLUME_COUNT] and trial.n_planes[k] > 0 and roof.n_planes[k] > 0
        for s in range(N_SIDES):
            is_same &= roof.sides[k, s] == trial.sides[k, s]
        if not is_same:
            total += extents[k]
            total -= price_extent(trial, k, site) if trial.n_planes[k] > 0 else 0.0
    return total


@compiled
def price_extent(roof, k, site):
    """Return the units of volume k's area inside the outline, and of what it lacks in width."""
    plan, room, area = np.empty((RING_CORNERS, 2)), np.empty((RING_CORNERS, 2)), 0.0
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for part in range(len(site.part_sizes)):
        box = site.part_boxes[part]
        if not meets(roof.boxes[k], box[0], box[1], box[2], box[3]):
            continue
        size = cut_part(roof, k, site, part, plan, room)
        area += measure_area(plan, size) if size > 0 else 0.0
        for i in range(size):
            for axis in range(2):
                half = roof.half_planes[k, 2 * axis]
                across = half[0] * plan[i, 0] + half[1] * plan[i, 1]
                low[axis], high[axis] = min(low[axis], across), max(high[axis], across)
    narrow = 0 if high[0] - low[0] < high[1] - low[1] else 1
    first, second = abs(roof.sides[k, 2 * narrow]) - 1, abs(roof.sides[k, 2 * narrow + 1]) - 1
    lack, units = site.narrow - (high[narrow] - low[narrow]), SPAN_UNITS * area / site.area
    if not 0.0 < lack < site.narrow:
        return units
    is_given = roof.lines[first, 3] + roof.lines[second, 3] == 0.0
    lack *= high[1 - narrow] - low[1 - narrow]
    return units + (GIVEN_UNITS if is_given else LACK_UNITS) * lack


@compiled
def count_skew_planes(roof, k):
    """Count the planes of volume k that are nearly, but not quite, square to the first."""
    count, is_first, a, b, lines = 0, True, 0.0, 0.0, roof.lines
    for p in range(roof.n_planes[k]):
        if roof.slopes[k, p] < 0:
            continue
        l = abs(roof.plane_lines[k, p]) - 1
        if is_first:
            a, b, is_first = lines[l, 0], lines[l, 1], False
        off = min(abs(a * lines[l, 0] + b * lines[l, 1]), abs(a * lines[l, 1] - b * lines[l, 0]))
        count += int(ONE_PLANE < off < MOST_SKEW)
    return count


@compiled
def know(roof, drawing, site):
    """Return what is known of a roof."""
    box = np.array([-np.inf, np.inf, -np.inf, np.inf])
    corners, steps = draw_structure(roof, drawing, site, box, np.inf)
    return Known(
        compute_costs(roof, site, list_view(roof, box.reshape(1, 4)), np.arange(len(site.x))),
        corners,
        steps,
        price_tables(roof),
        list_extents(roof, site),
    )


@compiled
def know_change(roof, drawing, site, boxes, reach, known):
    """Return what is known of a roof that has changed in boxes (n, 4).

    So far (m) beyond these, its steps may cost more or less.
    """
    points, corners, steps = list_points(site, boxes), known.corners, known.steps
    known.costs[points] = compute_costs(roof, site, list_view(roof, boxes), points)
    for box in boxes:
        wide = widen(box, reach)
        new_corners, new_steps = draw_structure(roof, drawing, site, wide, np.inf)
        corners = replace_inside(corners, new_corners, wide)
        steps = replace_inside(steps, new_steps, wide)
    return Known(known.costs, corners, steps, price_tables(roof), list_extents(roof, site))


@compiled
def replace_inside(rows, new, box):
    """Return rows of places, with new ones instead of those in a box."""
    is_kept = np.ones(len(rows), np.bool_)
    for m in range(len(rows)):
        is_kept[m] = not lies_in(rows, m, box)
    return np.concatenate((rows[is_kept], new))


@compiled
def lies_in(rows, m, box):
    return (
        (rows[m, 0] > box[0])
        & (rows[m, 0] < box[1])
        & (rows[m, 1] > box[2])
        & (rows[m, 1] < box[3])
    )


@compiled
def count_known_units(known, box):
    """Return the units of the known corners and steps in a box."""
    corners, steps = 0, 0.0
    for m in range(len(known.corners)):
        corners += lies_in(known.corners, m, box)
    for m in range(len(known.steps)):
        steps += known.steps[m, 2] if lies_in(known.steps, m, box) else 0.0
    return CORNER_UNITS * corners + steps


@compiled
def price_known(known, site):
    """Return the price (points) of the roof that is known."""
    everywhere = np.array([-np.inf, np.inf, -np.inf, np.inf])
    units = known.units + known.extents.sum() + count_known_units(known, everywhere)
    return known.costs.sum() + site.unit * units


@compiled
def sum_normal_equations(roof, site, view, points, places, matrix, vector):
    """Sum the normal equations of unknowns over the points that a roof explains.

    `places` (u,) are the unknowns' rows, -1 for those that keep their value. The sums go to
    `matrix` (m, m) and `vector` (m,). Returns the number of points and their sum of squares.
    """
    matrix[:], vector[:] = 0.0, 0.0
    count, squares = 0, 0.0
    points = points[: np.searchsorted(points, site.n)]
    heights, volumes, n = compute_judged_heights(roof, site, view, points)
    for m in range(n):
        i, k = points[m], volumes[m]
        x, y, residual = site.x[i], site.y[i], site.z[i] - heights[m]
        if k < 0 or abs(residual) > site.dead + site.width:
            continue
        lowest, p = np.inf, -1
        for q in range(roof.n_planes[k]):
            z = roof.planes[k, q, 0] * x + roof.planes[k, q, 1] * y + roof.planes[k, q, 2]
            if z < lowest:
                lowest, p = z, q
        count += 1
        squares += residual * residual
        first, second, d = roof.heights[k, p], roof.slopes[k, p], 0.0
        rest = site.z[i]
        if second >= 0:
            line = roof.plane_lines[k, p]
            l = abs(line) - 1
            d = roof.lines[l, 0] * x + roof.lines[l, 1] * y + roof.lines[l, 2]
            d = d if line > 0 else -d
            if places[second] < 0:
                rest -= roof.values[second] * d
        if places[first] < 0:
            rest -= roof.values[first]
        a, b = places[first], places[second] if second >= 0 else -1
        if a >= 0:
            matrix[a, a] += 1.0
            vector[a] += rest
        if b >= 0:
            matrix[b, b] += d * d
            vector[b] += d * rest
        if a >= 0 and b >= 0:
            matrix[a, b] += d
            matrix[b, a] += d
    return count, squares


@compiled
def fit_unknowns(roof, site, view, points, places, count, rounds):
    """Fit the unknowns that have `places` (u,) to points, and place the volumes again."""
    if count == 0:
        return
    matrix, vector = np.zeros((count, count)), np.zeros(count)
    for _ in range(rounds):
        sum_normal_equations(roof, site, view, points, places, matrix, vector)
        for u in range(len(places)):
            if places[u] >= 0:
                matrix[places[u], places[u]] += DAMPING
                vector[places[u]] += DAMPING * roof.values[u]
        solution = np.linalg.solve(matrix, vector)
        for u in range(len(places)):
            if places[u] >= 0:
                roof.values[u] = solution[places[u]]
        for m in range(len(view)):
            place_planes(roof, view[m])


@compiled
def list_unknowns(roof, site, boxes):
    """Return rows (u,) for unknowns whose volumes lie in the boxes (n, 4), and their number.

    The others get -1: they keep their value, because points outside the boxes hold them.
    """
    n_unknowns, bounds = roof.counts[UNKNOWN_COUNT], site.bounds
    places, count = np.zeros(n_unknowns, np.int64), 0
    is_used = np.zeros(n_unknowns, np.bool_)
    for k in range(roof.counts[VOLUME_COUNT]):
        if roof.n_planes[k] == 0:
            continue
        x0, x1 = max(roof.boxes[k, 0], bounds[0]), min(roof.boxes[k, 1], bounds[1])
        y0, y1 = max(roof.boxes[k, 2], bounds[2]), min(roof.boxes[k, 3], bounds[3])
        is_inside = False
        for box in boxes:
            is_inside |= x0 >= box[0] and x1 <= box[1] and y0 >= box[2] and y1 <= box[3]
        for p in range(roof.n_planes[k]):
            for u in (roof.heights[k, p], roof.slopes[k, p]):
                if u >= 0:
                    is_used[u] = True
                    if not is_inside:
                        places[u] = -1
    for u in range(n_unknowns):
        if places[u] == 0 and is_used[u]:
            places[u] = count
            count += 1
        else:
            places[u] = -1
    return places, count
