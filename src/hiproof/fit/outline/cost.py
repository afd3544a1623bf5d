"""What an outline costs: how badly it explains where points lie, and how many lines it is drawn with. Compiled.

Points of the roof are spread evenly over it, those of its walls lie on the outline. So an outline of area A around roof points of
`density` has the likelihood

    exp(-density A)  times the product over points of  density (stray + (1 - stray) Phi(depth / blur))  of the roof,
                                                       stray + (1 - stray) exp(-(depth / blur)^2 / 2)  of walls

and costs minus its logarithm: empty ground inside costs by the area, points outside by the piece, those of walls wherever the
outline does not run through them. To this come the prices of lines (two for a notch), of directions besides the main one, of
lines that run in them, and of sharp corners. All are in nats. A court is drawn in the same way: its ring runs clockwise, what lies in it
is outside.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from ...compiled import compiled
from ...parity import flips
from .lines import SAME_RAD, area_of, find_corners, quarter_gap, shares_direction
from .soft import SURE_BLURS, share_inside

SHARP = math.cos(math.radians(120.0))  # of the turn at a corner: sharper than 60 degrees inside or outside is sharp
TOGETHER = 16  # points next to each other in y for which sides are looked up once

# x, y (m): points of the roof and of outer walls, ascending in y; wall: which are a wall's; density: of roof points a square metre.
# court: whether the border is a court's, whose corners lie within box: x_low, x_high, y_low, y_high (m). blur (m), stray (share): see above.
# line, direction, skew, sharp: prices of a line, a further direction, a line in that, a sharp corner.
Border = namedtuple("Border", "x y wall density court box blur stray line direction skew sharp")

# lines (n, 2), kappa: azimuth of the main direction (rad), corners (n, 2), own (m): what each point costs, structure: the price of
# the lines, cost: all of it.
Drawing = namedtuple("Drawing", "lines kappa corners own structure cost")


@compiled
def drawing_of(lines, kappa, border):
    """The drawing of `lines`; its cost is infinite where they are no polygon."""
    corners, own = np.zeros((len(lines), 2)), np.zeros(len(border.x))
    if len(lines) < 3 or not find_corners(lines, corners) or not is_allowed(corners, border):
        return Drawing(lines, kappa, corners, own, np.inf, np.inf)
    reach = SURE_BLURS * border.blur
    for first in range(0, len(own), TOGETHER):
        last = min(first + TOGETHER, len(own))
        sides = sides_near(corners, border.y[first] - reach, border.y[last - 1] + reach)
        for k in range(first, last):
            x, y, wall = border.x[k], border.y[k], border.wall[k]
            own[k] = point_cost(x, y, corners, sides, border.court, wall, border.blur, border.stray)
    misfit, structure = border.density * area_of(corners) + own.sum(), structure_cost(lines, kappa, border)
    return Drawing(lines, kappa, corners, own, structure, misfit + structure)


@compiled
def is_allowed(corners, border):
    """Whether the ring runs as it has to, clockwise where it is a court's, and lies where it may."""
    if not border.court:
        return area_of(corners) > 0.0
    x_low, x_high, y_low, y_high = border.box
    for i in range(len(corners)):
        if not (x_low <= corners[i, 0] <= x_high and y_low <= corners[i, 1] <= y_high):
            return False
    return area_of(corners) < 0.0


@compiled
def structure_cost(lines, kappa, border):
    """Price of the lines, of directions other than the main one, of lines in these, and of sharp corners."""
    cost = border.line * len(lines)
    for i in range(len(lines)):
        if math.cos(lines[i, 0] - lines[i - 1, 0]) < SHARP:
            cost += border.sharp
        if abs(quarter_gap(lines[i, 0] - kappa)) < SAME_RAD:
            continue
        cost += border.skew if shares_direction(lines, i) else border.skew + border.direction
    return cost


@compiled
def point_cost(x, y, corners, sides, court, wall, blur, stray):
    """Minus the logarithm of how likely a point at x, y is, against one deep inside; `sides` are all that come near its y.

    That of a `wall` is compared with one on the border.
    """
    inside, reach = court, SURE_BLURS * blur
    nearest = reach * reach
    for i in sides:
        k = i + 1 if i + 1 < len(corners) else 0
        y0, y1 = corners[i, 1], corners[k, 1]
        if (y < y0 - reach and y < y1 - reach) or (y > y0 + reach and y > y1 + reach):  # neither near nor crossed
            continue
        x0, x1 = corners[i, 0], corners[k, 0]
        dx, dy = x1 - x0, y1 - y0
        if flips(x0, y0, x1, y1, x, y):
            inside = not inside
        if (x < x0 - reach and x < x1 - reach) or (x > x0 + reach and x > x1 + reach):
            continue
        t = min(max(((x - x0) * dx + (y - y0) * dy) / max(dx * dx + dy * dy, 1e-18), 0.0), 1.0)
        squared = (x0 + t * dx - x) ** 2 + (y0 + t * dy - y) ** 2
        nearest = min(nearest, squared)
    depth = math.sqrt(nearest) / blur
    return cost_at_depth(depth if inside else -depth, wall, stray)


@compiled
def cost_at_depth(depth, wall, stray):
    """What a point so deep inside (blurs) costs, of a wall or of the roof."""
    if wall:
        return -math.log(stray + (1.0 - stray) * math.exp(-0.5 * depth * depth))
    if abs(depth) >= SURE_BLURS:
        return 0.0 if depth > 0.0 else -math.log(stray)
    return -math.log(stray + (1.0 - stray) * share_inside(depth))


@compiled
def sides_near(corners, low, high):
    """Which sides (m,) of the polygon come between y = low and high."""
    found, m = np.empty(len(corners), np.int64), 0
    for i in range(len(corners)):
        k = i + 1 if i + 1 < len(corners) else 0
        if max(corners[i, 1], corners[k, 1]) >= low and min(corners[i, 1], corners[k, 1]) <= high:
            found[m] = i
            m += 1
    return found[:m]


@compiled
def cost_of_change(lines, drawing, i, count, fresh, border):
    """What `lines` cost that have the first `fresh` corners in place of the `count` + 1 of the drawing from `i` on."""
    return change_of(lines, drawing, i, count, fresh, border)[0].cost


@compiled
def changed(lines, drawing, i, count, fresh, border):
    """The drawing of `lines` that have the first `fresh` corners in place of the `count` + 1 of the drawing from `i` on."""
    new, first = change_of(lines, drawing, i, count, fresh, border)
    own = drawing.own.copy()
    own[first : first + len(new.own)] = new.own
    return Drawing(new.lines, new.kappa, new.corners, own, new.structure, new.cost)


@compiled
def change_of(lines, drawing, i, count, fresh, border):
    """The drawing of `changed` with the costs of some points alone, next to each other in y, and which is the first of them.

    Points away from the corners that come and go cost what they did.
    """
    corners, old = np.empty((len(lines), 2)), drawing.corners
    for k in range(fresh, len(lines)):
        corners[k] = old[(i + count + 1 + k - fresh) % len(old)]
    if len(lines) < 3 or not find_corners(lines, corners, fresh) or not is_allowed(corners, border):
        return Drawing(lines, drawing.kappa, corners, np.empty(0), np.inf, np.inf), 0
    x_low, y_low, x_high, y_high = np.inf, np.inf, -np.inf, -np.inf
    for k in range(count + 1 + fresh):
        ring, at = (old, (i + k) % len(old)) if k <= count else (corners, k - count - 1)
        x, y = ring[at, 0], ring[at, 1]
        x_low, x_high, y_low, y_high = min(x_low, x), max(x_high, x), min(y_low, y), max(y_high, y)
    reach = SURE_BLURS * border.blur
    sides = sides_near(corners, y_low - 2.0 * reach, y_high + 2.0 * reach)
    misfit = border.density * (area_of(corners) - area_of(old))
    first, last = np.searchsorted(border.y, np.array([y_low - reach, y_high + reach]))
    own = drawing.own[first:last].copy()
    for k in range(first, last):
        x, y, wall = border.x[k], border.y[k], border.wall[k]
        if x_low - reach < x < x_high + reach:
            own[k - first] = point_cost(x, y, corners, sides, border.court, wall, border.blur, border.stray)
            misfit += own[k - first] - drawing.own[k]
    structure = structure_cost(lines, drawing.kappa, border)
    cost = drawing.cost + misfit + structure - drawing.structure
    return Drawing(lines, drawing.kappa, corners, own, structure, cost), first
