"""The cost of an outline. Compiled.

It says how badly the outline explains the points, and with how many lines it is drawn.

Points of the roof are spread evenly over it, those of its walls lie on the outline. So an outline
of area A around roof points of `density` has the likelihood

    exp(-density A)  times the product over points of density (stray + (1 - stray) Phi(depth /
                     blur)) of the roof,
                                                       stray + (1 - stray) exp(-(depth / blur)^2 /
                                                       2) of walls

and costs minus its logarithm: empty ground inside costs by the area, points outside by the piece,
those of walls wherever the outline does not run through them. To this come the prices of lines (two
for a notch), of directions besides the main one, of lines that run in them, and of sharp corners.
All are in nats. A court is drawn in the same way: its ring runs clockwise, what lies in it is
outside.
"""

from __future__ import annotations

import functools
import math
from collections import namedtuple

import numpy as np

from ...compiled import compiled
from ...geometry.arrays import copy_row, find_place
from ...geometry.point_in_polygon import update_nearest
from .lines import SAME_RAD, compute_area, find_corners, quarter_gap
from .soft import SURE_BLURS, share_inside

# places a blur at which costs are kept; between them they are straight, to 5e-5 nats
TABLE_STEPS_PER_M = 100
QUARTER = 0.5 * math.pi  # rad; lines so far apart have one direction
# of the turn at a corner: sharper than 60 degrees inside or outside is sharp
SHARP = math.cos(math.radians(120.0))

# x, y (m): points of the roof and of outer walls, ascending in y; wall: which are a wall's;
# density: of roof points a square metre. court: whether the border is a court's, whose corners lie
# within box: x_low, x_high, y_low, y_high (m). blur (m): see above; costs: `costs_by_depth`. line,
# direction, skew, sharp: prices of a line, a further direction, a line in that, a sharp corner.
Border = namedtuple("Border", "x y wall density court box blur costs line direction skew sharp")

# lines (n, 2), kappa: azimuth of the main direction (rad), corners (n, 2), own (m): what each point
# costs, structure: the price of the lines, cost: all of it.
Drawing = namedtuple("Drawing", "lines kappa corners own structure cost")


@compiled
def make_drawing(lines, kappa, border):
    """Return the drawing of `lines`.

    Its cost is infinite where they are no polygon.
    """
    corners, costs = np.zeros((len(lines), 2)), np.zeros(len(border.x))
    if len(lines) < 3 or not find_corners(lines, corners, -1) or not is_allowed(corners, border):
        return Drawing(lines, kappa, corners, costs, np.inf, np.inf)
    squared, inside = nearest_sides(
        corners, border.x, border.y, border.court, SURE_BLURS * border.blur
    )
    for k in range(len(costs)):
        costs[k] = point_cost(squared[k], inside[k], border.wall[k], border)
    misfit, structure = (
        border.density * compute_area(corners) + costs.sum(),
        structure_cost(lines, kappa, border),
    )
    return Drawing(lines, kappa, corners, costs, structure, misfit + structure)


@compiled
def is_allowed(corners, border):
    """Return whether a ring runs as it has to, and lies where it may.

    A court's ring runs clockwise.
    """
    if not border.court:
        return compute_area(corners) > 0.0
    x_low, x_high, y_low, y_high = border.box
    for i in range(len(corners)):
        if not (x_low <= corners[i, 0] <= x_high and y_low <= corners[i, 1] <= y_high):
            return False
    return compute_area(corners) < 0.0


@compiled
def structure_cost(lines, kappa, border):
    """Return the price of the lines, of their directions and of sharp corners.

    Directions other than the main one cost, and lines in these.
    """
    cost, ways = border.line * len(lines), np.empty(len(lines))
    for i in range(len(lines)):
        ways[i] = quarter_gap(lines[i, 0] - kappa)
        if math.cos(lines[i, 0] - lines[i - 1, 0]) < SHARP:
            cost += border.sharp
        if abs(ways[i]) >= SAME_RAD:
            cost += border.skew if is_among(ways[i], ways[:i]) else border.skew + border.direction
    return cost


@compiled
def is_among(way, ways):
    """Return whether one of `ways` (n,) is the same as `way`.

    They are angles from -45 to 45 degrees; those at the ends are one.
    """
    result = False
    for other in ways:
        gap = abs(way - other)
        result |= (gap < SAME_RAD) | (gap > QUARTER - SAME_RAD)
    return result


@compiled
def nearest_sides(corners, x, y, court, reach):
    """Return squared distances (n,) to the nearest side, and what lies inside.

    Points at x, y (n,) ascend in y. A distance is at most that of `reach`.

    Side after side, without branches, so that a processor does several points at once.
    """
    squared, inside = np.full(len(x), reach * reach), np.full(len(x), court)
    if len(x) == 0:
        return squared, inside
    for i in range(len(corners)):
        k = i + 1 if i + 1 < len(corners) else 0
        x0, y0, x1, y1 = corners[i, 0], corners[i, 1], corners[k, 0], corners[k, 1]
        lower, upper = min(y0, y1) - reach, max(y0, y1) + reach
        if lower <= y[-1] and upper >= y[0]:
            nearby = slice(find_place(y, lower), find_place(y, upper))
            update_nearest(x0, y0, x1, y1, x[nearby], y[nearby], squared[nearby], inside[nearby])
    return squared, inside


@compiled
def point_cost(squared, inside, wall, border):
    """Return the cost of a point at a `squared` distance from a side.

    It is minus the logarithm of its likelihood, against one deep inside; a point of a `wall` is
    compared with one on the border.
    """
    depth = math.sqrt(squared) / border.blur
    return interpolate_cost(depth if inside else -depth, wall, border.costs)


@compiled
def interpolate_cost(depth, wall, costs):
    """Return `cost_at_depth` from its table `costs`, by linear interpolation."""
    place = (min(max(depth, -SURE_BLURS), SURE_BLURS) + SURE_BLURS) * TABLE_STEPS_PER_M
    k = min(int(place), costs.shape[1] - 2)
    table = costs[int(wall)]
    return table[k] + (place - k) * (table[k + 1] - table[k])


@functools.cache
def costs_by_depth(stray: float) -> np.ndarray:
    """Tabulate costs of roof and wall points by depth.

    The table is (2, 2 SURE_BLURS FINE + 1), from sure outside to sure inside.
    """
    depths = np.linspace(-SURE_BLURS, SURE_BLURS, round(2 * SURE_BLURS * TABLE_STEPS_PER_M) + 1)
    return np.array(
        [[cost_at_depth(depth, wall, stray) for depth in depths.tolist()] for wall in (False, True)]
    )


@compiled
def cost_at_depth(depth, wall, stray):
    """Return the cost of a point of the wall or the roof by its depth (blurs)."""
    if wall:
        return -math.log(stray + (1.0 - stray) * math.exp(-0.5 * depth * depth))
    if abs(depth) >= SURE_BLURS:
        return 0.0 if depth > 0.0 else -math.log(stray)
    return -math.log(stray + (1.0 - stray) * share_inside(depth))


@compiled
def apply_change(lines, drawing, i, count, new_items, border, limit):
    """Return the drawing of changed `lines`, whose cost is infinite once it is above `limit`.

    The first `new_items` corners replace the `count` + 1 of the drawing from `i` on. Points away
    from the corners that come and go cost what they did.
    """
    kappa, costs = drawing.kappa, drawing.own
    corners = compute_changed_corners(lines, drawing, i, count, new_items, border)
    none = Drawing(lines, kappa, corners, costs, np.inf, np.inf)
    if len(corners) == 0:
        return none
    nearby = select_points(drawing.corners, corners, i, count, new_items, border)
    structure = structure_cost(lines, kappa, border)
    growth = compute_area(corners) - compute_area(drawing.corners)
    cost = drawing.cost + border.density * growth + structure - drawing.structure
    for k in nearby:
        cost -= costs[k]
    if cost > limit:  # no point gains by being there
        return none
    squared, inside = nearest_sides(
        corners, border.x[nearby], border.y[nearby], border.court, SURE_BLURS * border.blur
    )
    new = np.empty(len(nearby))
    for k in range(len(nearby)):
        new[k] = point_cost(squared[k], inside[k], border.wall[nearby[k]], border)
        cost += new[k]
        if cost > limit:
            return none
    costs = costs.copy()
    costs[nearby] = new
    return Drawing(lines, kappa, corners, costs, structure, cost)


@compiled
def compute_changed_corners(lines, drawing, i, count, new_items, border):
    """Return the corners (n, 2) of changed lines, none for no polygon.

    The change is as for `apply_change`.
    """
    corners, old = np.empty((len(lines), 2)), drawing.corners
    for k in range(new_items, len(lines)):
        copy_row(corners[k], old[(i + count + 1 + k - new_items) % len(old)])
    if (
        len(lines) < 3
        or not find_corners(lines, corners, new_items)
        or not is_allowed(corners, border)
    ):
        return corners[:0]
    return corners


@compiled
def select_points(old, corners, i, count, new_items, border):
    """Return ascending points (m,) near the corners that come and go.

    Near is within a box around them.
    """
    x_low, y_low, x_high, y_high = np.inf, np.inf, -np.inf, -np.inf
    for k in range(count + 1 + new_items):
        ring, position = (old, (i + k) % len(old)) if k <= count else (corners, k - count - 1)
        x, y = ring[position, 0], ring[position, 1]
        x_low, x_high, y_low, y_high = min(x_low, x), max(x_high, x), min(y_low, y), max(y_high, y)
    reach = SURE_BLURS * border.blur
    first, last = (
        find_place(border.y, y_low - reach),
        find_place(border.y, y_high + reach),
    )
    nearby, m = np.empty(last - first, np.int64), 0
    for k in range(first, last):
        nearby[m] = k
        m += int(x_low - reach < border.x[k] < x_high + reach)
    return nearby[:m]
