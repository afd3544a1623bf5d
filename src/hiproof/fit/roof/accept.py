"""Improve a roof by moves: one place that judges, and one loop.

`try_move` applies a move to a copy, fits the unknowns that it touches, and prices the box that it
can change. The loop tries all moves that concern changed volumes and takes those that save, the
best first, each judged again on the roof as it then is.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ...compiled import compiled
from .draw import meets
from .moves import MOVE_COLUMNS, SHARE, TO_POINTS, apply_move, list_moves
from .price import (
    fit_unknowns,
    list_points,
    list_unknowns,
    list_view,
    price_drawing,
    price_misfit,
    price_roof,
    price_tables,
)
from .tables import VOLUME_COUNT, copy_tables, has_room, pack, place_planes

CHANGE_MARGIN_M = 0.5  # Distance (m) beyond what a move touches in which corners may change.
BOX_STEP_M = 0.5  # Boxes end at multiples of this (m), so that many moves have one box.
FIT_ROUNDS = 2  # Rounds of fitting and choosing points again.
LEAST_UNITS = 0.05  # What a move must save: fitting again alone saves less.
HOPE_UNITS = 2.0  # What fitting may still save of a move that does not pay before it.
LOOP_ROUNDS = 30  # Most rounds of the loop.
MOST_MOVES = 20_000  # Most moves in a round.
FIRST_JUDGES = 400  # Most points of a box that judge a move first. Of more, every k-th does.
# What they say errs by so much (units): more than what a move saves that changes little.
SMALL_UNITS = 1.5
KEPT_BOXES = 32  # Boxes whose price is kept.

Known = namedtuple("Known", "boxes samples sizes weights misfits units next")
"""What is known of boxes (q, 4) of the roof as it is.

Of each: the points and cells that judge it first, `samples` (q, FIRST_JUDGES) of `sizes` (q,), each
for `weights` (q,) points, its misfit (points, by these), and its units with those of the tables.
`next` (1,) is the place that is used next.
"""


@compiled
def make_known():
    """Return room for what is known of boxes."""
    return Known(
        np.full((KEPT_BOXES, 4), np.nan),
        np.zeros((KEPT_BOXES, FIRST_JUDGES), np.int64),
        np.zeros(KEPT_BOXES, np.int64),
        np.zeros(KEPT_BOXES),
        np.zeros(KEPT_BOXES),
        np.zeros(KEPT_BOXES),
        np.zeros(1, np.int64),
    )


@compiled
def measure_change(roof, trial, changed, site, box):
    """Set `box` to what the `changed` volumes take up before and after a move."""
    box[0], box[1], box[2], box[3] = np.inf, -np.inf, np.inf, -np.inf
    for k in range(trial.counts[VOLUME_COUNT]):
        if not changed[k]:
            continue
        if k < roof.counts[VOLUME_COUNT] and roof.n_planes[k] > 0:
            widen_box(box, roof.boxes[k])
        if trial.n_planes[k] > 0:
            widen_box(box, trial.boxes[k])
    for axis in range(2):
        low, high = 2 * axis, 2 * axis + 1
        least = max(box[low], site.bounds[low]) - CHANGE_MARGIN_M
        most = min(box[high], site.bounds[high]) + CHANGE_MARGIN_M
        box[low], box[high] = (
            np.floor(least / BOX_STEP_M) * BOX_STEP_M,
            np.ceil(most / BOX_STEP_M) * BOX_STEP_M,
        )


@compiled
def widen_box(box, other):
    box[0], box[1] = min(box[0], other[0]), max(box[1], other[1])
    box[2], box[3] = min(box[2], other[2]), max(box[3], other[3])


@compiled
def know_box(roof, drawing, site, box, known):
    """Return the place in `known` of a box of the roof as it is."""
    for q in range(KEPT_BOXES):
        if (
            known.boxes[q, 0] == box[0]
            and known.boxes[q, 1] == box[1]
            and known.boxes[q, 2] == box[2]
            and known.boxes[q, 3] == box[3]
        ):
            return q
    q = known.next[0]
    known.next[0] = (q + 1) % KEPT_BOXES
    points = list_points(site, box)
    step = 1 + (len(points) - 1) // FIRST_JUDGES
    sample = points[::step]
    view = list_view(roof, box)
    known.boxes[q] = box
    known.samples[q, : len(sample)] = sample
    known.sizes[q], known.weights[q] = len(sample), len(points) / max(len(sample), 1)
    known.misfits[q] = known.weights[q] * price_misfit(roof, site, view, sample)
    known.units[q] = price_drawing(roof, drawing, view, site, box) + price_tables(roof)
    return q


@compiled
def try_move(roof, trial, move, site, drawing, known, changed, box, exact):
    """Apply a move to a copy of the roof, fit it, and return what it saves (points).

    `trial`, `changed` and `box` are set. A move that is not possible saves nothing. Unless it is to
    be `exact`, a sample of the points judges, and then all of them if they may say otherwise.
    """
    copy_tables(roof, trial)
    if not has_room(trial) or not apply_move(trial, move, site, changed):
        return 0.0
    measure_change(roof, trial, changed, site, box)
    q = know_box(roof, drawing, site, box, known)
    weight, misfit, units = known.weights[q], known.misfits[q], known.units[q]
    view = list_view(trial, box)
    if len(view) == 0:
        return 0.0
    if weight == 1.0 or not exact:
        points, values = known.samples[q, : known.sizes[q]], trial.values.copy()
        gain = judge(trial, site, drawing, view, box, points, weight, misfit, units)
        is_small = move[0] == SHARE or move[0] == TO_POINTS
        if weight == 1.0 or not is_small or abs(gain) >= SMALL_UNITS * site.unit:
            return gain
        trial.values[:] = values
        for m in range(len(view)):
            place_planes(trial, view[m])
    points = list_points(site, box)
    misfit = price_misfit(roof, site, list_view(roof, box), points)
    return judge(trial, site, drawing, view, box, points, 1.0, misfit, units)


@compiled
def judge(trial, site, drawing, view, box, points, weight, misfit, units):
    """Fit a trial in a box to points, each for `weight`, and return what it saves (points).

    `misfit` (points) and `units` are those of the roof as it is.
    """
    limit = misfit + site.unit * (units - price_tables(trial))
    hope = limit + HOPE_UNITS * site.unit
    if weight * price_misfit(trial, site, view, points) > hope:
        return 0.0
    places, count = list_unknowns(trial, site, box)
    fit_unknowns(trial, site, view, points, places, count, FIT_ROUNDS)
    new_misfit = weight * price_misfit(trial, site, view, points)
    if new_misfit >= limit:
        return 0.0
    return limit - new_misfit - site.unit * price_drawing(trial, drawing, view, site, box)


@compiled
def fit_roof(roof, site, rounds):
    """Fit all unknowns of a roof to all points, unless that costs more."""
    box = np.array([-np.inf, np.inf, -np.inf, np.inf])
    view, points = list_view(roof, box), list_points(site, box)
    values, misfit = roof.values.copy(), price_misfit(roof, site, view, points)
    places, count = list_unknowns(roof, site, box)
    fit_unknowns(roof, site, view, points, places, count, rounds)
    if price_misfit(roof, site, view, points) > misfit:
        roof.values[:] = values
        for m in range(len(view)):
            place_planes(roof, view[m])


@compiled
def improve(roof, trial, site, drawing, asked, rounds):
    """Improve a roof by moves that concern volumes `asked` (v,), until none saves.

    Returns its price (points).
    """
    known = make_known()
    size = len(roof.sides)
    changed, box = np.zeros(size, np.bool_), np.empty(4)
    touched = np.zeros(size, np.bool_)
    moves, gains = np.empty((MOST_MOVES, MOVE_COLUMNS), np.int64), np.empty(MOST_MOVES)
    for _ in range(rounds):
        fit_roof(roof, site, FIT_ROUNDS)
        known.boxes[:] = np.nan
        count = list_moves(roof, site, asked, moves)
        for m in range(count):
            gains[m] = try_move(roof, trial, moves[m], site, drawing, known, changed, box, False)
        order, has_improved = np.argsort(-gains[:count]), False
        touched[:] = False
        for q in range(count):
            m = order[q]
            if gains[m] <= LEAST_UNITS * site.unit:
                break
            gain = try_move(roof, trial, moves[m], site, drawing, known, changed, box, True)
            if gain <= LEAST_UNITS * site.unit:
                continue
            copy_tables(trial, roof)
            known.boxes[:] = np.nan
            has_improved = True
            for k in range(roof.counts[VOLUME_COUNT]):
                if roof.n_planes[k] > 0 and meets(roof.boxes[k], box[0], box[1], box[2], box[3]):
                    touched[k] = True
        if not has_improved:
            break
        place = 0
        for k in range(roof.counts[VOLUME_COUNT]):
            if roof.n_planes[k] > 0:
                asked[place] = touched[k]
                place += 1
        pack(roof)
    return price_roof(roof, drawing, site)
