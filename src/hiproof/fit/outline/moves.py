"""An outline redrawn while a change of few lines pays. Compiled.

Changes: a line goes; one, two or three in a row become one (three are a step); one turns into a
direction that others have; lines move; all lines of a direction turn together.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled import compiled
from ...geometry.arrays import copy_row
from .cost import Drawing, apply_change, make_drawing
from .lines import SAME_RAD, drop_line, quarter_gap, replace_lines, shares_direction

LONGEST_RUN = 3  # lines that become one
TURN_RAD = math.radians(35.0)  # of a line, at most
# turns by which the first and last of so many lines may differ to become one
APART = (0.0, 1.0, 1.5, 0.7)
# m and rad that lines are moved and turned by, coarse to fine
STEPS_M, TURNS_RAD = (0.3, 0.1, 0.05), (0.03, 0.01, 0.003)
# of all moves; of shifts by one step; changes of one kind at most, which ends what would go in
# circles
ROUNDS, SHIFT_ROUNDS, MOST_CHANGES = 3, 3, 400
REACHED = LONGEST_RUN  # lines on either side of a change whose own changes it concerns
GAIN = 1e-6  # nats; numerically none


@compiled
def redraw(drawing, border, step_m):
    """Redraw until no change pays.

    Lines that replace others are moved by `step_m` at first.
    """
    drawing = simplify_drawing(drawing, border, step_m)
    for _ in range(ROUNDS):
        cost = drawing.cost
        for step in STEPS_M:
            drawing = shift_lines(drawing, border, step)
        for turn in TURNS_RAD:
            drawing = turn_lines(drawing, border, turn)
        if drawing.cost < cost:
            drawing = simplify_drawing(drawing, border, step_m)
        if drawing.cost > cost - 0.1:
            break
    return drawing


@compiled
def simplify_drawing(drawing, border, step_m):
    """Make the change that gains most, again and again.

    After each only the gains of lines beside it are computed anew.
    """
    gains = np.full(len(drawing.lines), np.inf)
    for _ in range(MOST_CHANGES):
        for i in range(len(gains)):
            if gains[i] == np.inf:
                gains[i] = drawing.cost - best_change(drawing, i, border)[0].cost
        i = int(np.argmax(gains))
        if gains[i] <= GAIN:
            break
        new, shift = best_change(drawing, i, border)
        gains[i] = drawing.cost - new.cost  # those of lines far off may be of an earlier drawing
        if gains[i] <= GAIN:
            continue
        old_gains, gains = gains, np.full(len(new.lines), np.inf)
        for k in range(REACHED + 1, len(gains) - REACHED):
            gains[k] = old_gains[(i + shift + k) % len(old_gains)]
        drawing = shift_first_line(new, border, step_m)
    return drawing


@compiled
def best_change(drawing, i, border):
    """Return the cheapest drawing by a change that begins at line `i`, or the drawing as it is.

    Line k of the new drawing is line i + `shift` + k of the old one, if both are away from the
    change.
    """
    n = len(drawing.lines)
    best, shift = drawing, 0
    if n > 3:
        new = apply_change(drop_line(drawing.lines, i), drawing, i, 1, 1, border, best.cost)
        if new.cost < best.cost:
            best, shift = new, 1
    for count in range(1, min(LONGEST_RUN, n - 2) + 1):
        for azimuth, distance in joint_lines(drawing, i, count):
            lines = replace_lines(drawing.lines, i, count, azimuth, distance)
            new = apply_change(lines, drawing, i, count, 2, border, best.cost)
            if new.cost < best.cost:
                best, shift = new, count - 1
    return best, shift


@compiled
def joint_lines(drawing, i, count):
    """Return lines (m, 2) that may replace `count` lines from `i` on.

    They run through the middle of these, or of the first and last of three, which are a step and
    may also go on as one of them; along the main direction, the chord, the first or the last; a
    single line also along that of any longer one.
    """
    lines, corners, n = drawing.lines, drawing.corners, len(drawing.lines)
    result, m = np.empty((n + 8, 2)), 0
    first, last = lines[i], lines[(i + count - 1) % n]
    if count > 1 and math.cos(first[0] - last[0]) < math.cos(TURN_RAD * APART[count]):
        return result[:0]
    start, end = corners[i], corners[(i + count) % n]
    chord = math.atan2(start[0] - end[0], end[1] - start[1])
    middle = compute_middle(corners, i, count)
    ways = list_azimuths(drawing, i, count, chord)
    for way in ways:
        unchanged = count == 1 and abs(math.sin(way - first[0])) < SAME_RAD
        if not unchanged and math.cos(way - chord) > math.cos(TURN_RAD):
            result[m, 0] = way
            result[m, 1] = middle[0] * math.cos(way) + middle[1] * math.sin(way)
            m += 1
    if count == LONGEST_RUN:
        copy_row(result[m], first)
        copy_row(result[m + 1], last)
        m += 2
    return result[:m]


@compiled
def list_azimuths(drawing, i, count, chord):
    """Return azimuths (m,) for one line in place of `count` from `i` on.

    They are nearest to the `chord` of all that are common.
    """
    lines, n = drawing.lines, len(drawing.lines)
    main = chord - quarter_gap(chord - drawing.kappa)
    if count > 1:
        return np.array([main, chord, lines[i, 0], lines[(i + count - 1) % n, 0]])
    ways, m = np.empty(n + 1), 1
    ways[0], length = main, side_length(drawing.corners, i)
    for j in range(n):
        if (
            side_length(drawing.corners, j) > length
            and abs(quarter_gap(lines[j, 0] - drawing.kappa)) > SAME_RAD
        ):
            ways[m] = chord - quarter_gap(chord - lines[j, 0])
            m += 1
    return ways[:m]


@compiled
def side_length(corners, i):
    a, b = corners[i], corners[(i + 1) % len(corners)]
    return math.hypot(b[0] - a[0], b[1] - a[1])


@compiled
def compute_middle(corners, i, count):
    """Return the middle (2,) of `count` sides from `i` on.

    It is weighted by their lengths; of a run of three the second does not count.
    """
    n, total, x, y = len(corners), 1e-9, 0.0, 0.0
    for k in range(0, count, 2 if count == LONGEST_RUN else 1):
        a, b = corners[(i + k) % n], corners[(i + k + 1) % n]
        length = side_length(corners, (i + k) % n) + 1e-9
        total += length
        x += 0.5 * length * (a[0] + b[0])
        y += 0.5 * length * (a[1] + b[1])
    return x / total, y / total


@compiled
def shift_lines(drawing, border, step):
    """Move each line by multiples of `step` (m) while that is cheaper."""
    for _ in range(SHIFT_ROUNDS):
        cost = drawing.cost
        for _ in range(len(drawing.lines)):
            drawing = shift_first_line(drawing, border, step)
            lines = np.concatenate((drawing.lines[1:], drawing.lines[:1]))  # a line on
            corners = np.concatenate((drawing.corners[1:], drawing.corners[:1]))
            drawing = Drawing(
                lines, drawing.kappa, corners, drawing.own, drawing.structure, drawing.cost
            )
        if drawing.cost >= cost - GAIN:
            break
    return drawing


@compiled
def shift_first_line(drawing, border, step):
    """Move the first line by multiples of `step` (m) while that is cheaper."""
    for sign in (1.0, -1.0):
        moved = False
        while True:
            lines = drawing.lines.copy()
            lines[0, 1] += sign * step
            is_enough = drawing.cost - GAIN
            new = apply_change(lines, drawing, 0, 1, 2, border, is_enough)
            if not new.cost < is_enough:
                break
            drawing, moved = new, True
        if moved:
            break
    return drawing


@compiled
def turn_lines(drawing, border, step):
    """Turn the lines of each direction while that is cheaper.

    They turn about their middles by multiples of `step` (rad).
    """
    for i in range(len(drawing.lines)):
        if shares_direction(drawing.lines, i):  # turned already
            continue
        for sign in (1.0, -1.0):
            moved = False
            while True:
                lines, main = (
                    drawing.lines.copy(),
                    abs(quarter_gap(drawing.lines[i, 0] - drawing.kappa)) < SAME_RAD,
                )
                for j in range(len(lines)):
                    if abs(quarter_gap(lines[j, 0] - drawing.lines[i, 0])) < SAME_RAD:
                        x, y = compute_middle(drawing.corners, j, 1)
                        lines[j, 0] += sign * step
                        lines[j, 1] = x * math.cos(lines[j, 0]) + y * math.sin(lines[j, 0])
                new = make_drawing(lines, drawing.kappa + (sign * step if main else 0.0), border)
                if not new.cost < drawing.cost - GAIN:
                    break
                drawing, moved = new, True
            if moved:
                break
    return drawing
