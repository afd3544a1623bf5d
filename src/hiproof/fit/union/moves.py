"""Change one volume's structure where that lowers the objective. Compiled.

    refit one volume, move its edges      after every other move
    drop a volume, a plane                what does not pay is dropped
    tie, untie                            equal slopes
    let it join again                     a volume that replaces becomes part of the max
    add an end, a level top               a gable becomes a hip, a hip a mansard

All functions take volumes (k, COLUMNS) and the objective's value, and return the better of these
and of what they find. Those of volume k alone take its `context`, which does not change. Moves that
turn planes are in facings.py, and all moves in turn in improve.py.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from ..prices import BEGIN_SHARE, BEGIN_UNITS, UNKNOWN_UNITS
from .around import compute_roof_everywhere, compute_roof_with, measure_context
from .edges import BEYOND_OUTLINE_M, NO_GAIN, move_edges
from .objective import compute_objective, compute_objective_with, compute_point_cost
from .refit import refit
from .volumes import (
    DIRECTION,
    LEAN0,
    LEVEL,
    N_PLANES,
    N_SIDES,
    OFFSET0,
    REPLACES,
    SLOPE0,
    TIE,
    U0,
    count_planes,
    count_slopes,
    equalise_slopes,
    find_lowest,
    is_within,
    read_coefficients,
    read_rectangle,
)

# Most slopes tried for new ends and ties besides the volume's own. They cover those of the
# candidates.
MOST_TYPICAL_SLOPES = 5
MOST_TRIED_SLOPES = N_SIDES + MOST_TYPICAL_SLOPES  # Most slopes at which a plane is tried.
SLOPES_APART = 0.02  # Least difference (rise over run) between two of them.
END_SEEDS = 16  # Points through which a new plane is tried.
FEWEST_SEEDS = 3  # Fewest points through which a new plane may pass for any to be tried.
POINTS_AT_ONCE = 64  # Points between two checks whether a new plane can still be the best.


@compiled
def settle_move(trial, scene, k, value, context):
    """Refit volume k of `trial`, move its edges, and refit it again.

    Also returns the objective, infinite if it is not below `value`.
    """
    refit(trial, scene, k, context)
    trial_value = compute_objective_with(trial, scene, k, context)
    if trial_value > value + BEGIN_UNITS * scene.unit + BEGIN_SHARE * scene.n:
        return trial, np.inf
    trial_value = move_edges(trial, scene, k, trial_value, context)
    trial, trial_value = refit_volume(trial, scene, trial_value, k, context)
    return (trial, trial_value) if trial_value < value - NO_GAIN else (trial, np.inf)


@compiled
def remove_volume(volumes, k):
    """Return the volumes without the k-th."""
    return np.concatenate((volumes[:k], volumes[k + 1 :]))


@compiled
def refit_volume(volumes, scene, value, k, context):
    """Refit volume k, if that helps."""
    trial = volumes.copy()
    refit(trial, scene, k, context)
    trial_value = compute_objective_with(trial, scene, k, context)
    return (trial, trial_value) if trial_value < value - NO_GAIN else (volumes, value)


@compiled
def move_all_edges(volumes, scene, value):
    """Move the edges of every volume, in place."""
    for k in range(1, len(volumes)):
        context = measure_context(volumes, scene.U, scene.V, k)
        value = move_edges(volumes, scene, k, value, context)
    return value


@compiled
def drop_volumes(volumes, scene, value):
    """Drop volumes that do not pay."""
    k = 1
    while k < len(volumes):
        trial = remove_volume(volumes, k)
        trial_value = compute_objective(trial, scene)
        if trial_value < value - NO_GAIN:
            volumes, value = trial, trial_value
        else:
            k += 1
    return volumes, value


@compiled
def drop_planes(volumes, scene, value, k, context):
    """Drop planes of volume k that do not pay."""
    for plane in range(N_PLANES):
        if volumes[k, OFFSET0 + plane] == np.inf or count_planes(volumes[k]) < 2:
            continue
        trial = volumes.copy()
        trial[k, OFFSET0 + plane] = np.inf
        if plane < LEVEL:
            trial[k, SLOPE0 + plane] = trial[k, LEAN0 + plane] = 0.0
        trial, trial_value = settle_move(trial, scene, k, value, context)
        if trial_value < np.inf:
            volumes, value = trial, trial_value
    return volumes, value


@compiled
def change_ties(volumes, scene, value, k, context):
    """Tie other slopes of volume k, and let it join the max instead of replacing."""
    if volumes[k, REPLACES] > 0.0:
        trial = volumes.copy()
        trial[k, REPLACES] = 0.0
        trial, trial_value = settle_move(trial, scene, k, value, context)
        if trial_value < np.inf:
            volumes, value = trial, trial_value
    for tie in range(3):
        if tie == volumes[k, TIE]:
            continue
        trial = volumes.copy()
        trial[k, TIE] = tie
        if count_slopes(trial[k]) == count_slopes(volumes[k]):
            continue
        equalise_slopes(trial[k])
        trial, trial_value = settle_move(trial, scene, k, value, context)
        if trial_value < np.inf:
            volumes, value = trial, trial_value
    return volumes, value


@compiled
def add_planes(volumes, scene, value, k, slopes, context):
    """Add planes to volume k: an end, a side or a level top.

    Its rectangle may reach beyond the outline there.
    """
    z_now = compute_roof_with(volumes, scene.U, scene.V, k, context)
    everywhere = compute_roof_everywhere(volumes, scene.U, scene.V, k, context)
    seeds = count_seeds(volumes, scene, k, z_now, everywhere, context.roof_without)
    for plane in range(N_PLANES):
        if volumes[k, OFFSET0 + plane] < np.inf or seeds[plane] < FEWEST_SEEDS:
            continue
        trial_slopes = list_trial_slopes(volumes[k], plane, slopes)
        least_gain = 0.6 * scene.unit * UNKNOWN_UNITS
        gain, slope, offset = find_best_plane(
            volumes,
            scene,
            k,
            plane,
            trial_slopes,
            z_now,
            everywhere,
            context.roof_without,
            least_gain,
        )
        wide = volumes.copy()
        if plane < LEVEL:
            wide[k, U0 + plane] = place_outside(scene, int(volumes[k, DIRECTION]), plane)
            wide_gain, other_slope, other_offset = find_best_plane(
                wide, scene, k, plane, trial_slopes, z_now, everywhere, context.roof_without, gain
            )
            if wide_gain > gain + NO_GAIN:
                gain, slope, offset = wide_gain, other_slope, other_offset
            else:
                wide = volumes.copy()
        if gain <= least_gain:
            continue
        for tie in range(int(volumes[k, TIE]), 3):
            trial = wide.copy()
            trial[k, OFFSET0 + plane] = offset
            if plane < LEVEL:
                trial[k, SLOPE0 + plane] = slope
            trial[k, TIE] = tie
            equalise_slopes(trial[k])
            trial, trial_value = settle_move(trial, scene, k, value, context)
            if trial_value < np.inf:
                volumes, value = trial, trial_value
                z_now = compute_roof_with(volumes, scene.U, scene.V, k, context)
                everywhere = compute_roof_everywhere(volumes, scene.U, scene.V, k, context)
                seeds = count_seeds(volumes, scene, k, z_now, everywhere, context.roof_without)
                break
    return volumes, value


@compiled
def count_seeds(volumes, scene, k, z_now, everywhere, beneath):
    """Count, for each plane (N_PLANES,), the points through which it may pass at most.

    They are those well below volume k, also where its edge at the plane is drawn out.
    """
    direction, seeds = int(volumes[k, DIRECTION]), np.zeros(N_PLANES, np.int64)
    u, v = scene.U[direction], scene.V[direction]
    c, ends, replaces = (
        read_coefficients(volumes, k),
        read_rectangle(volumes, k),
        volumes[k, REPLACES] > 0.0,
    )
    for i in range(scene.n):
        h, z = find_lowest(c, u[i], v[i]), scene.z[i]
        if everywhere[i] == h and is_seed(
            h, z, z_now[i], -np.inf if replaces else beneath[i], scene.dead, scene.width
        ):
            out = u[i] < ends[0], u[i] > ends[1], v[i] < ends[2], v[i] > ends[3]
            n_out = out[0] + out[1] + out[2] + out[3]
            for plane in range(N_SIDES):
                seeds[plane] += n_out == 0 or (n_out == 1 and out[plane])
            seeds[LEVEL] += n_out == 0
    return seeds


@compiled
def is_seed(height, z, z_now, floor, dead, width):
    """Return whether a new plane may pass through the point `z`, well below a volume."""
    r = min(max(abs(z_now - z) - dead, 0.0) / width, 1.0)
    return height - z > 0.5 * (dead + width) and (r > 0.5 or z > floor - dead - width)


@compiled
def place_outside(scene, direction, edge):
    """Return a place outside the outline for an edge."""
    lines = scene.lines[direction, edge // 2]
    if edge % 2 == 0:
        return lines[0] - BEYOND_OUTLINE_M
    last = lines[0]
    for x in lines:
        if x < np.inf:
            last = x
    return last + BEYOND_OUTLINE_M


@compiled
def list_trial_slopes(row, plane, slopes):
    """Return distinct slopes of the volume and of `slopes`, none for a level plane."""
    trial_slopes = np.zeros(MOST_TRIED_SLOPES)
    if plane == LEVEL:
        return trial_slopes[:1]
    count = 0
    for q in range(N_SIDES + len(slopes)):
        if q < N_SIDES and row[OFFSET0 + q] == np.inf:
            continue
        slope = row[SLOPE0 + q] if q < N_SIDES else slopes[q - N_SIDES]
        is_new = count < MOST_TRIED_SLOPES
        for p in range(count):
            is_new = is_new and abs(trial_slopes[p] - slope) >= SLOPES_APART
        if is_new:
            trial_slopes[count] = slope
            count += 1
    return trial_slopes[:count]


@compiled
def find_best_plane(volumes, scene, k, plane, slopes, z_now, everywhere, beneath, least_gain):
    """Find the plane in place `plane` of volume k that lowers the misfit most.

    It lowers it by more than `least_gain`, and passes through one of the points well below the
    volume. Returns gain, slope and offset.
    """
    direction, n = int(volumes[k, DIRECTION]), scene.n
    u, v = scene.U[direction], scene.V[direction]
    c, ends, replaces = (
        read_coefficients(volumes, k),
        read_rectangle(volumes, k),
        volumes[k, REPLACES] > 0.0,
    )
    dead, width, z_points = scene.dead, scene.width, scene.z
    z, x, own_heights, floors = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    seeds = np.empty(n, np.int64)
    m = count = 0
    unchanged = 0.0
    for i in range(n):
        inside = is_within(ends, u[i], v[i])
        h = find_lowest(c, u[i], v[i])
        if not inside or everywhere[i] != h:  # or another volume is visible there
            continue
        t = 0.0 if plane == LEVEL else u[i] if plane < 2 else v[i]
        z[m], x[m], own_heights[m] = z_points[i], -t if plane % 2 == 1 else t, h
        floors[m] = -np.inf if replaces else beneath[i]
        r = min(max(abs(z_now[i] - z[m]) - dead, 0.0) / width, 1.0)
        unchanged += r * r
        if is_seed(h, z[m], z_now[i], floors[m], dead, width):
            seeds[count] = m
            count += 1
        m += 1
    best, best_slope, best_offset = least_gain, 0.0, 0.0
    if count < FEWEST_SEEDS:
        return best, best_slope, best_offset
    for slope in slopes:
        for g in range(0, count, max(1, count // END_SEEDS)):
            offset = z[seeds[g]] - slope * x[seeds[g]]
            gain = unchanged
            for first in range(0, m, POINTS_AT_ONCE):
                last = min(first + POINTS_AT_ONCE, m)
                gain -= sum_plane_misfit(
                    slope, offset, z, x, own_heights, floors, first, last, dead, width
                )
                if gain < best:
                    break
            if gain > best:
                best, best_slope, best_offset = gain, slope, offset
    return best, best_slope, best_offset


@compiled
def sum_plane_misfit(slope, offset, z, x, own_heights, floors, first, last, dead, width):
    """Sum up the cost of the points z from `first` to `last` with a further plane.

    The volume is `own_heights` high without it, and the roof nowhere below `floors`.
    """
    total = 0.0
    for p in range(np.uint64(first), np.uint64(last)):  # unsigned: no place is negative
        h = max(min(own_heights[p], offset + slope * x[p]), floors[p])
        total += compute_point_cost(z[p], h, dead, width)
    return total
