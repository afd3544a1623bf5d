"""Moves that change one volume's structure, each taken where it lowers the objective. Compiled.

    refit one volume, move its edges      after every other move
    drop a volume, a plane                what does not pay goes
    flatten                               slopes next to level become a level top
    tie, untie                            equal slopes
    let it join again                     a volume that replaces becomes part of the max
    add an end, a level top               a gable becomes a hip, a hip a mansard

All functions take volumes (k, COLUMNS) and the objective's value, and return the better of what they got and what they found.
Those of volume k alone take what is `around` it, which they leave as it is.
Which ways planes face is facings.py, several volumes at once joins.py, all moves in turn improve.py.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from .around import look_around, roof_everywhere, roof_with
from .edges import BEYOND_M, EVERYWHERE, LEAST_GAIN, move_edges
from .objective import objective, objective_with, point_cost
from .prices import BEGIN_SHARE, BEGIN_UNITS, PARAMETER_COST
from .refit import refit
from .volumes import (
    DIRECTION,
    LEAN,
    LEVEL,
    OFFSET,
    PLANES,
    REPLACES,
    SIDES,
    SLOPE,
    TIE,
    U0,
    U1,
    V0,
    V1,
    coefficients,
    distance_up,
    equalise_slopes,
    is_fixed,
    is_within,
    lowest,
    plane_count,
    rectangle,
    slope_count,
)

MOST_SLOPES, SLOPES_APART = 9, 0.02  # slopes a plane is tried at, and rise over run between two of them
END_SEEDS = 16  # points through which a new plane is tried
AT_ONCE = 64  # points between two looks at whether a new plane can still do
ALMOST_LEVEL = 0.15  # rise over run; below it a plane may as well be level


@compiled
def settled(trial, scene, k, value, reach, around):
    """`trial` with volume k refitted, its edges moved and refitted, and its objective, infinite where that is above `value`."""
    refit(trial, scene, k, around)
    limit = value + BEGIN_UNITS * scene.evidence + BEGIN_SHARE * scene.n
    found = objective_with(trial, scene, k, around, limit)
    if found == np.inf:
        return trial, found
    found = move_edges(trial, scene, k, found, reach, around)
    again = trial.copy()
    refit(again, scene, k, around)
    better = objective_with(again, scene, k, around, found)
    if better < found:
        trial, found = again, better
    return (trial, found) if found < value - LEAST_GAIN else (trial, np.inf)


@compiled
def without(volumes, k):
    """The volumes but for the k-th."""
    return np.concatenate((volumes[:k], volumes[k + 1 :]))


@compiled
def refit_each(volumes, scene, value):
    """Every volume refitted once, where that helps."""
    for k in range(len(volumes)):
        if is_fixed(volumes, k):
            continue
        volumes, value = refitted(volumes, scene, value, k)
    return volumes, value


@compiled
def refitted(volumes, scene, value, k):
    """Volume k refitted, where that helps."""
    trial, around = volumes.copy(), look_around(volumes, scene.U, scene.V, k)
    refit(trial, scene, k, around)
    found = objective_with(trial, scene, k, around, value)
    return (trial, found) if found < value - LEAST_GAIN else (volumes, value)


@compiled
def move_all_edges(volumes, scene, value, reach):
    """The edges of every volume moved, in place."""
    for k in range(1, len(volumes)):
        around = look_around(volumes, scene.U, scene.V, k)
        value = move_edges(volumes, scene, k, value, reach, around)
    return value


@compiled
def drop_volumes(volumes, scene, value):
    """Volumes that do not pay go."""
    k = 1
    while k < len(volumes):
        trial, found = volumes, np.inf
        if not is_fixed(volumes, k):
            trial = without(volumes, k)
            found = objective(trial, scene, value - LEAST_GAIN)
        if found < np.inf:
            volumes, value = trial, found
        else:
            k += 1
    return volumes, value


@compiled
def drop_planes(volumes, scene, value, k, steepest, around):
    """Planes of volume k no steeper than `steepest` that do not pay go."""
    for plane in range(PLANES):
        if volumes[k, OFFSET + plane] == np.inf or plane_count(volumes[k]) < 2:
            continue
        if plane < LEVEL and volumes[k, SLOPE + plane] > steepest:
            continue
        trial = volumes.copy()
        remove_plane(trial[k], plane)
        trial, found = settled(trial, scene, k, value, EVERYWHERE, around)
        if found < np.inf:
            volumes, value = trial, found
    return volumes, value


@compiled
def remove_plane(row, plane):
    """Take a plane off a volume, in place."""
    row[OFFSET + plane] = np.inf
    if plane < LEVEL:
        row[SLOPE + plane] = row[LEAN + plane] = 0.0


@compiled
def flatten(volumes, scene, value, k, around):
    """The all but level planes of volume k become one level top."""
    flat = (volumes[k, OFFSET : OFFSET + SIDES] < np.inf) & (volumes[k, SLOPE : SLOPE + SIDES] < ALMOST_LEVEL)
    if not flat.any() or volumes[k, OFFSET + LEVEL] < np.inf:
        return volumes, value
    trial = volumes.copy()
    u, v = 0.5 * (volumes[k, U0] + volumes[k, U1]), 0.5 * (volumes[k, V0] + volumes[k, V1])
    total = 0.0
    for plane in range(SIDES):
        if flat[plane]:
            total += volumes[k, OFFSET + plane] + volumes[k, SLOPE + plane] * distance_up(volumes[k], plane, u, v)
            remove_plane(trial[k], plane)
    trial[k, OFFSET + LEVEL] = total / flat.sum()
    trial, found = settled(trial, scene, k, value, EVERYWHERE, around)
    return (trial, found) if found < np.inf else (volumes, value)


@compiled
def change_ties(volumes, scene, value, k, around):
    """Other slopes of volume k equal; and it may join the max instead of replacing what it covers."""
    if volumes[k, REPLACES] > 0.0:
        trial = volumes.copy()
        trial[k, REPLACES] = 0.0
        trial, found = settled(trial, scene, k, value, EVERYWHERE, around)
        if found < np.inf:
            volumes, value = trial, found
    for tie in range(3):
        if tie == volumes[k, TIE]:
            continue
        trial = volumes.copy()
        trial[k, TIE] = tie
        if slope_count(trial[k]) == slope_count(volumes[k]):
            continue
        equalise_slopes(trial[k])
        trial, found = settled(trial, scene, k, value, 0.6, around)
        if found < np.inf:
            volumes, value = trial, found
    return volumes, value


@compiled
def add_planes(volumes, scene, value, k, slopes, around):
    """A further plane for volume k: an end, a side or a level top; its rectangle may reach beyond the outline there."""
    z_now = roof_with(volumes, scene.U, scene.V, k, around)
    everywhere = roof_everywhere(volumes, scene.U, scene.V, k, around)
    for plane in range(PLANES):
        if volumes[k, OFFSET + plane] < np.inf:
            continue
        tried = slopes_to_try(volumes[k], plane, slopes)
        least = 0.6 * scene.evidence * PARAMETER_COST
        gain, slope, offset = best_plane(volumes, scene, k, plane, tried, z_now, everywhere, around.without, least)
        wide = volumes.copy()
        if plane < LEVEL:
            wide[k, U0 + plane] = beyond(scene, int(volumes[k, DIRECTION]), plane)
            more, other_slope, other_offset = best_plane(wide, scene, k, plane, tried, z_now, everywhere, around.without, gain)
            if more > gain + LEAST_GAIN:
                gain, slope, offset = more, other_slope, other_offset
            else:
                wide = volumes.copy()
        if gain <= least:
            continue
        for tie in range(int(volumes[k, TIE]), 3):
            trial = wide.copy()
            trial[k, OFFSET + plane] = offset
            if plane < LEVEL:
                trial[k, SLOPE + plane] = slope
            trial[k, TIE] = tie
            equalise_slopes(trial[k])
            trial, found = settled(trial, scene, k, value, EVERYWHERE, around)
            if found < np.inf:
                volumes, value = trial, found
                z_now = roof_with(volumes, scene.U, scene.V, k, around)
                everywhere = roof_everywhere(volumes, scene.U, scene.V, k, around)
                break
    return volumes, value


@compiled
def beyond(scene, direction, edge):
    """A place outside the outline for an edge."""
    lines = scene.lines[direction, edge // 2]
    if edge % 2 == 0:
        return lines[0] - BEYOND_M
    last = lines[0]
    for x in lines:
        if x < np.inf:
            last = x
    return last + BEYOND_M


@compiled
def slopes_to_try(row, plane, slopes):
    """The slopes that the volume has and `slopes`, distinct; none for a level plane."""
    tried = np.zeros(MOST_SLOPES)
    if plane == LEVEL:
        return tried[:1]
    count = 0
    for q in range(SIDES + len(slopes)):
        if q < SIDES and row[OFFSET + q] == np.inf:
            continue
        slope = row[SLOPE + q] if q < SIDES else slopes[q - SIDES]
        if count < MOST_SLOPES and (np.abs(tried[:count] - slope) >= SLOPES_APART).all():
            tried[count] = slope
            count += 1
    return tried[:count]


@compiled
def best_plane(volumes, scene, k, plane, slopes, z_now, everywhere, beneath, least):
    """The plane in place `plane` of volume k that lowers the misfit most, by more than `least`: (gain, slope, offset).

    It goes through one of the points that lie well below the volume.
    """
    direction, n = int(volumes[k, DIRECTION]), scene.n
    u, v = scene.U[direction], scene.V[direction]
    c, ends, replaces = coefficients(volumes, k), rectangle(volumes, k), volumes[k, REPLACES] > 0.0
    dead, width, z_points = scene.dead, scene.width, scene.z
    z, x, own, under = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    seeds = np.empty(n, np.int64)
    m = count = 0
    unchanged = 0.0
    for i in range(n):
        inside = is_within(ends, u[i], v[i])
        h = lowest(c, u[i], v[i])
        if not inside or everywhere[i] != h:  # or something else shows there
            continue
        t = 0.0 if plane == LEVEL else u[i] if plane < 2 else v[i]
        z[m], x[m], own[m] = z_points[i], -t if plane % 2 == 1 else t, h
        under[m] = -np.inf if replaces else beneath[i]
        r = min(max(abs(z_now[i] - z[m]) - dead, 0.0) / width, 1.0)
        unchanged += r * r
        if h - z[m] > 0.5 * (dead + width) and (r > 0.5 or z[m] > under[m] - dead - width):
            seeds[count] = m
            count += 1
        m += 1
    best, best_slope, best_offset = least, 0.0, 0.0
    if count < 3:
        return best, best_slope, best_offset
    for slope in slopes:
        for g in range(0, count, max(1, count // END_SEEDS)):
            offset = z[seeds[g]] - slope * x[seeds[g]]
            gain = unchanged
            for first in range(0, m, AT_ONCE):
                gain -= misfit_of(slope, offset, z[first:m], x[first:m], own[first:m], under[first:m], dead, width)
                if gain < best:
                    break
            if gain > best:
                best, best_slope, best_offset = gain, slope, offset
    return best, best_slope, best_offset


@compiled(fastmath={"reassoc", "nsz"})
def misfit_of(slope, offset, z, x, own, under, dead, width):
    """What the first AT_ONCE of points z cost under a volume `own` high there that is given a further plane, but nowhere below `under`."""
    total = 0.0
    for p in range(min(AT_ONCE, len(z))):
        h = max(min(own[p], offset + slope * x[p]), under[p])
        total += point_cost(z[p], h, dead, width)
    return total
