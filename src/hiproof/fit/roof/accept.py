"""Improve a roof by moves: one place that judges, and one loop.

`try_move` applies a move to a copy, fits the unknowns that it touches, and prices the box that it
can change. The loop tries all moves that concern changed volumes and takes those that save, the
best first, each judged again on the roof as it then is.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from ..prices import NARROW_M
from .draw import is_near, widen_box
from .moves import (
    ALL_MOVES,
    MOVE_COLUMNS,
    NEW_MOVES,
    NO_MOVES,
    SHARE,
    SHARES_ONLY,
    TO_POINTS,
    apply_move,
    list_moves,
)
from .price import (
    Known,
    compare_extents,
    count_known_units,
    fit_unknowns,
    know_change,
    list_extents,
    list_points,
    list_unknowns,
    list_view,
    price_drawing,
    price_misfit,
    price_tables,
    widen,
)
from .tables import VOLUME_COUNT, copy_tables, has_room, pack, place_planes

CHANGE_MARGIN_M = 0.5  # Distance (m) beyond what a move touches in which corners may change.
# Distance (m) beyond these in which steps may cost more, with what their middles are off them.
BESIDE_M = NARROW_M - CHANGE_MARGIN_M + 0.02
FIT_ROUNDS = 2  # Rounds of fitting and choosing points again.
LEAST_UNITS = 0.05  # What a move must save: fitting again alone saves less.
HOPE_UNITS = 2.0  # What fitting may still save of a move that does not pay before it.
LOOP_ROUNDS = 30  # Most rounds of the loop.
MOST_MOVES = 20_000  # Most moves in a round.
FIRST_JUDGES = 400  # Most points of a box that judge a move first. Of more, every k-th does.


@compiled
def list_changes(roof, trial, changed, site, boxes):
    """Set `boxes` (v, 4) to what the `changed` volumes take up before and after a move.

    Those whose surroundings meet are one. Returns how many there are.
    """
    count = 0
    for k in range(trial.counts[VOLUME_COUNT]):
        if not changed[k]:
            continue
        box = boxes[count]
        box[0], box[1], box[2], box[3] = np.inf, -np.inf, np.inf, -np.inf
        if k < roof.counts[VOLUME_COUNT] and roof.n_planes[k] > 0:
            widen_box(box, roof.boxes[k])
        if trial.n_planes[k] > 0:
            widen_box(box, trial.boxes[k])
        for axis in range(2):
            low, high = 2 * axis, 2 * axis + 1
            box[low] = max(box[low], site.bounds[low]) - CHANGE_MARGIN_M
            box[high] = min(box[high], site.bounds[high]) + CHANGE_MARGIN_M
        count = join_last(boxes, count + 1)
    return count


@compiled
def join_last(boxes, count):
    """Join the last of `count` boxes with those near it. Returns how many are left."""
    j = 0
    while j < count - 1:
        last = boxes[count - 1]
        if is_near(boxes[j], last, 2.0 * BESIDE_M):
            widen_box(last, boxes[j])
            boxes[j] = boxes[count - 2]
            boxes[count - 2] = last
            count, j = count - 1, 0
        else:
            j += 1
    return count


@compiled
def try_move(roof, trial, move, site, drawing, known, changed, room, exact):
    """Apply a move to a copy of the roof, fit it, and return what it saves (points).

    `trial` and `changed` are set, and boxes (n, 4) in `room` (v, 4), which are returned: the move
    changes nothing beyond. One that is not possible saves nothing. Unless it is to be `exact`, a
    sample of the points judges, but not what saves as little as the sample errs.
    """
    copy_tables(roof, trial)
    if not has_room(trial) or not apply_move(trial, move, site, changed):
        return 0.0, room[:0]
    boxes = room[: list_changes(roof, trial, changed, site, room)]
    view, points = list_view(trial, boxes), list_points(site, boxes)
    if len(view) == 0:
        return 0.0, boxes
    units, weight = known.units, 1.0
    for box in boxes:
        units += count_known_units(known, widen(box, BESIDE_M))
    units += compare_extents(roof, trial, known.extents, site)
    if len(points) > FIRST_JUDGES and not exact and move[0] != SHARE and move[0] != TO_POINTS:
        step = 1 + (len(points) - 1) // FIRST_JUDGES
        weight, points = len(points) / len(points[::step]), points[::step].copy()
    gain = judge(trial, site, drawing, view, boxes, points, weight, known.costs, units)
    return gain, boxes


@compiled
def judge(trial, site, drawing, view, boxes, points, weight, costs, units):
    """Fit a trial in boxes to points, each for `weight`, and return what it saves (points).

    `costs` (n + g,) and `units` are those of the roof as it is.
    """
    limit = weight * costs[points].sum() + site.unit * (units - price_tables(trial))
    hope = limit + HOPE_UNITS * site.unit
    if weight * price_misfit(trial, site, view, points) > hope:
        return 0.0
    places, count = list_unknowns(trial, site, boxes)
    fit_unknowns(trial, site, view, points, places, count, FIT_ROUNDS)
    gain = limit - weight * price_misfit(trial, site, view, points)
    for box in boxes:
        if gain <= 0.0:
            return 0.0
        units = gain / site.unit
        gain -= site.unit * price_drawing(trial, drawing, site, widen(box, BESIDE_M), units)
    return gain


@compiled
def fit_roof(roof, site, rounds):
    """Fit all unknowns of a roof to all points, unless that costs more."""
    boxes = np.array([[-np.inf, np.inf, -np.inf, np.inf]])
    view, points = list_view(roof, boxes), list_points(site, boxes)
    values, misfit = roof.values.copy(), price_misfit(roof, site, view, points)
    places, count = list_unknowns(roof, site, boxes)
    fit_unknowns(roof, site, view, points, places, count, rounds)
    if price_misfit(roof, site, view, points) > misfit:
        roof.values[:] = values
        for m in range(len(view)):
            place_planes(roof, view[m])


@compiled
def note_touched(roof, trial, changed, is_share, touched):
    """Note in `touched` (v,) which moves to try again beside a move that was taken."""
    for k in range(trial.counts[VOLUME_COUNT]):
        if not changed[k]:
            continue
        touched[k] = max(touched[k], SHARES_ONLY if is_share else ALL_MOVES)
        if trial.n_planes[k] == 0:  # what is left out leaves its place to those around it
            for j in range(trial.counts[VOLUME_COUNT]):
                if is_near(trial.boxes[j], roof.boxes[k], CHANGE_MARGIN_M):
                    touched[j] = ALL_MOVES


@compiled
def make_moves(roof, trial, site, drawing, known, questions, touched):
    """Make the moves that save of those that `questions` (v,) ask for, the best first.

    Notes in `touched` (v,) which to try next. Returns what is then known of the roof.
    """
    changed, room = np.zeros(len(roof.sides), np.bool_), np.empty((len(roof.sides), 4))
    moves, gains = np.empty((MOST_MOVES, MOVE_COLUMNS), np.int64), np.empty(MOST_MOVES)
    count, least = list_moves(roof, site, questions, moves), LEAST_UNITS * site.unit
    extents = list_extents(roof, site)  # volumes may have other numbers now
    known = Known(known.costs, known.corners, known.steps, known.units, extents)
    for m in range(count):
        gains[m], _ = try_move(roof, trial, moves[m], site, drawing, known, changed, room, False)
    touched[:] = NO_MOVES
    for m in np.argsort(-gains[:count], kind="mergesort"):
        if gains[m] <= least:
            break
        move = moves[m]
        gain, boxes = try_move(roof, trial, move, site, drawing, known, changed, room, True)
        if gain <= least:
            continue
        note_touched(roof, trial, changed, move[0] == SHARE, touched)
        copy_tables(trial, roof)
        known = know_change(roof, drawing, site, boxes, BESIDE_M, known)
    return known


@compiled
def improve(roof, trial, site, drawing, known, asked, rounds):
    """Improve a roof by moves that concern volumes `asked` (v,), until none saves.

    Returns what is then known of it.
    """
    questions, touched = np.where(asked, ALL_MOVES, NO_MOVES), np.zeros(len(asked), np.int64)
    for _ in range(rounds):
        known = make_moves(roof, trial, site, drawing, known, questions, touched)
        if not touched.any():
            break
        place = 0
        for k in range(roof.counts[VOLUME_COUNT]):
            if roof.n_planes[k] > 0:
                questions[place] = touched[k]
                place += 1
        questions[place:] = NO_MOVES
        pack(roof)
    pack(roof)
    return known


@compiled
def add_new(roof, new, site, drawing, known, k):
    """Fit volume k, which is `new` to a roof that is `known`. Returns what is then known."""
    changed, room = np.zeros(len(roof.sides), np.bool_), np.empty((len(roof.sides), 4))
    changed[k] = True
    boxes = room[: list_changes(roof, new, changed, site, room)]
    places, count = list_unknowns(new, site, boxes)
    view, points = list_view(new, boxes), list_points(site, boxes)
    fit_unknowns(new, site, view, points, places, count, FIT_ROUNDS)
    return know_change(new, drawing, site, boxes, BESIDE_M, known)


@compiled
def improve_new(roof, trial, site, drawing, known, k):
    """Make the moves of volume k once. Returns what is then known."""
    questions = np.full(len(roof.sides), NO_MOVES)
    questions[k] = NEW_MOVES
    known = make_moves(roof, trial, site, drawing, known, questions, np.zeros_like(questions))
    pack(roof)
    return known
