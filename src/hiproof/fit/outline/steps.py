"""Sides that become flights of steps, where points pay for it. Compiled.

Flights make bays, notches and porches.

A run of sides is made one straight side at first. This is cut into columns, and each is given a
level outwards or inwards, such that points and prices of lines together cost least: two lines a
step. What a column's points say of a level does not depend on other columns, so the best levels are
found exactly, column by column (Potts' model by dynamic programming).
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled import compiled
from ...geometry.arrays import find_place
from .cost import apply_change, interpolate_cost
from .lines import quarter_gap, replace_lines, replaced_by
from .moves import GAIN, TURN_RAD
from .soft import SURE_BLURS

# m; along the side, across it: lines are moved more finely afterwards
COLUMN_M, STEP_LEVEL_M = 0.25, 0.1
# levels inwards and outwards of the side; larger bays are the rough outline's
DEEPEST_STEP_M, FARTHEST_LEVEL_M = 2.0, 1.5
LEVELS = round((DEEPEST_STEP_M + FARTHEST_LEVEL_M) / STEP_LEVEL_M) + 1
RUN = 5  # sides that become one flight, at most
INSIDE = math.log(2.0)  # a point of the roof that costs less is inside


@compiled
def add_steps(drawing, border, longest):
    """Add flights of steps where they are cheaper.

    They replace sides, and runs of up to `longest` of them.
    """
    i = 0
    while i < len(drawing.lines):
        best = step_side(drawing, i, border)
        if not best.cost < drawing.cost - GAIN:
            best = drawing
        for count in range(1, min(longest, len(drawing.lines) - 2) + 1):
            new = step_run(drawing, i, count, border)
            if new.cost < best.cost - GAIN:
                best = new
        i = 0 if best.cost < drawing.cost else i + 1
        drawing = best
    return drawing


@compiled
def step_side(drawing, i, border):
    """Draw side `i` as a flight of steps along its own direction."""
    flight = make_flight(drawing, i, border)
    lines = replaced_by(drawing.lines, i, 1, flight)
    return apply_change(lines, drawing, i, 1, len(flight) + 1, border, np.inf)


@compiled
def step_run(drawing, i, count, border):
    """Draw `count` sides from `i` on as one flight.

    It runs along the main direction nearest to their chord. The drawing stays where they make no
    such side to begin with.
    """
    start, end = drawing.corners[i], drawing.corners[(i + count) % len(drawing.lines)]
    chord = math.atan2(start[0] - end[0], end[1] - start[1])
    way = chord - quarter_gap(chord - drawing.kappa)
    if math.cos(way - chord) < math.cos(TURN_RAD):
        return drawing
    x, y = 0.5 * (start + end)
    joint = replace_lines(drawing.lines, i, count, way, x * math.cos(way) + y * math.sin(way))
    joined = apply_change(joint, drawing, i, count, 2, border, np.inf)
    return drawing if joined.cost == np.inf else step_side(joined, 0, border)


@compiled
def make_flight(drawing, i, border):
    """Return the lines (m, 2) of a flight in place of side `i`.

    They run along it at one level or another, joined at right angles.
    """
    azimuth, distance = drawing.lines[i]
    lower, upper = (
        along(azimuth, drawing.corners[i]),
        along(azimuth, drawing.corners[(i + 1) % len(drawing.lines)]),
    )
    columns = max(int((upper - lower) / COLUMN_M), 1)
    width = (upper - lower) / columns
    levels = best_levels(
        column_costs(drawing, border, azimuth, distance, lower, width, columns), 2.0 * border.line
    )
    flight, m = np.empty((2 * columns, 2)), 0
    for k in range(columns):
        if k > 0 and levels[k] == levels[k - 1]:
            continue
        if k > 0:
            turn = -1.0 if levels[k] > levels[k - 1] else 1.0
            flight[m, 0], flight[m, 1] = azimuth + turn * 0.5 * math.pi, turn * (lower + k * width)
            m += 1
        flight[m, 0], flight[m, 1] = azimuth, distance + STEP_LEVEL_M * levels[k] - DEEPEST_STEP_M
        m += 1
    return flight[:m]


@compiled
def along(azimuth, place):
    """Return how far (m) `place` (2,) lies along lines of an azimuth.

    `azimuth` is that of their normal.
    """
    return place[1] * math.cos(azimuth) - place[0] * math.sin(azimuth)


@compiled
def column_costs(drawing, border, azimuth, distance, lower, width, columns):
    """Return the costs (columns, LEVELS) of columns along a line at each level."""
    costs, far_out = np.empty((columns, LEVELS)), border.costs[0, 0]
    for level in range(LEVELS):
        costs[:, level] = border.density * width * (STEP_LEVEL_M * level - DEEPEST_STEP_M)
    c, s, sure = math.cos(azimuth), math.sin(azimuth), SURE_BLURS * border.blur
    first, last = find_band(border.y, azimuth, distance, lower, lower + columns * width)
    for k in range(first, last):
        x, y, wall = border.x[k], border.y[k], border.wall[k]
        depth, column = distance - (x * c + y * s), math.floor((y * c - x * s - lower) / width)
        if not 0 <= column < columns or not -FARTHEST_LEVEL_M < depth < DEEPEST_STEP_M:
            continue
        if depth < 0.0 and not wall and drawing.own[k] < INSIDE:  # beyond another side
            continue
        inner = (
            0
            if wall
            else min(max(math.ceil((DEEPEST_STEP_M - depth - sure) / STEP_LEVEL_M), 0), LEVELS)
        )
        outer = (
            LEVELS
            if wall
            else min(max(math.floor((DEEPEST_STEP_M - depth + sure) / STEP_LEVEL_M) + 1, 0), LEVELS)
        )
        for level in range(inner):
            costs[column, level] += far_out
        for level in range(inner, outer):
            deep = (depth + STEP_LEVEL_M * level - DEEPEST_STEP_M) / border.blur
            costs[column, level] += interpolate_cost(deep, wall, border.costs)
    return costs


@compiled
def find_band(y, azimuth, distance, lower, upper):
    """Return the first and last of the points that may lie beside a line.

    Points ascend in `y` (n,). The line runs from `lower` to `upper`.
    """
    c, s = math.cos(azimuth), math.sin(azimuth)
    minimum, limit = np.inf, -np.inf
    for out in (distance - DEEPEST_STEP_M, distance + FARTHEST_LEVEL_M):
        for position in (lower, upper):
            minimum, limit = (
                min(minimum, out * s + position * c),
                max(limit, out * s + position * c),
            )
    return find_place(y, minimum), find_place(y, limit)


@compiled
def best_levels(costs, step):
    """Return the cheapest level of each column (n,).

    `costs` are (n, levels), and `step` is the price of each change along them.
    """
    n, levels = costs.shape
    came, total = np.empty((n, levels), np.int64), costs[0].copy()
    for k in range(1, n):
        cheapest = int(np.argmin(total))
        for level in range(levels):
            came[k, level] = cheapest if total[cheapest] + step < total[level] else level
        total = np.minimum(total, total[cheapest] + step) + costs[k]
    best = np.empty(n, np.int64)
    best[n - 1] = int(np.argmin(total))
    for k in range(n - 1, 0, -1):
        best[k - 1] = came[k, best[k]]
    return best
