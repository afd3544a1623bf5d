"""Moves that change a roof's structure, each taken where it lowers the objective. Compiled.

    refit one volume, move its edges      after every other move
    drop a volume, a plane                what does not pay goes
    flatten                               slopes next to level become a level top
    tie, untie                            equal slopes
    face a wall                           planes square to walls that are not quite along the axes
    add an end, a level top               a gable becomes a hip, a hip a mansard
    let it join again                     a volume that replaces becomes part of the max
    merge                                 one volume over the rectangles of two
    surround                              slopes around a volume become one that it stands on
    hand over                             a plane goes to the volume that runs on in it

All functions take volumes (k, COLUMNS) and the objective's value, and return the better of what they got and what they found.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled import compiled
from .edges import BEYOND_M, EVERYWHERE, LEAST_GAIN, move_edges
from .objective import objective
from .refit import refit
from .volumes import (
    DIRECTION,
    FREE,
    LEAN,
    LEVEL,
    OFFSET,
    PARAMETER_COST,
    PLANES,
    REPLACES,
    SETTLED,
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
    lowest,
    lowest_plane,
    plane_count,
    roof_heights,
    slope_count,
    with_and_without,
)

HOPELESS_UNITS, HOPELESS_SHARE = 2.0, 0.01  # a trial that starts further above the best than this is given up
MOST_SLOPES, SLOPES_APART = 9, 0.02  # slopes a plane is tried at, and rise over run between two of them
END_SEEDS = 16  # points through which a new plane is tried
ALIKE_M = 0.4  # m between two planes that may be one: as far as points reach from a plane, and half as far again
# m within which a volume begins beyond the side of another, or under it, where edges are hidden and lie anywhere
BESIDE_M, UNDER_M = 0.6, 2.0
MERGE_REACH_M = 2.0  # m that edges may move when one volume takes another's place
ALMOST_LEVEL = 0.15  # rise over run; below it a plane may as well be level
AROUND_M = 0.5  # volumes nearer than this take part in each other's surroundings
DIGEST_STEP = 0.02  # of metres and of slopes: changes smaller than this are none
# of a digest: primes whose product float64 holds, and m above which all heights are one
DIGEST_FACTOR, DIGEST_PRIME, HIGH_ABOVE = 1_000_003.0, 2_147_483_647.0, 1e5
# of a plane towards what its points say; most of a turn as rise over run along its edge; units that a free direction costs
TURNS, MOST_TURN, FREE_UNITS = 4, 0.45, 1.5


@compiled
def settled(trial, scene, k, value, reach):
    """`trial` with volume k refitted, its edges moved and refitted, and its objective, infinite where that is above `value`."""
    refit(trial, scene, k)
    found = objective(trial, scene, value + HOPELESS_UNITS * scene.evidence + HOPELESS_SHARE * scene.n)
    if found == np.inf:
        return trial, found
    found = move_edges(trial, scene, k, found, reach)
    again = trial.copy()
    refit(again, scene, k)
    better = objective(again, scene, found)
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
        volumes, value = refitted(volumes, scene, value, k)
    return volumes, value


@compiled
def refitted(volumes, scene, value, k):
    """Volume k refitted, where that helps."""
    trial = volumes.copy()
    refit(trial, scene, k)
    found = objective(trial, scene, value)
    return (trial, found) if found < value - LEAST_GAIN else (volumes, value)


@compiled
def move_all_edges(volumes, scene, value, reach):
    """The edges of every volume moved, in place."""
    for k in range(1, len(volumes)):
        value = move_edges(volumes, scene, k, value, reach)
    return value


@compiled
def drop_volumes(volumes, scene, value):
    """Volumes that do not pay go."""
    k = 1
    while k < len(volumes):
        trial = without(volumes, k)
        found = objective(trial, scene, value - LEAST_GAIN)
        if found < np.inf:
            volumes, value = trial, found
        else:
            k += 1
    return volumes, value


@compiled
def drop_planes(volumes, scene, value, k, steepest):
    """Planes of volume k no steeper than `steepest` that do not pay go."""
    for plane in range(PLANES):
        if volumes[k, OFFSET + plane] == np.inf or plane_count(volumes[k]) < 2:
            continue
        if plane < LEVEL and volumes[k, SLOPE + plane] > steepest:
            continue
        trial = volumes.copy()
        remove_plane(trial[k], plane)
        trial, found = settled(trial, scene, k, value, EVERYWHERE)
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
def flatten(volumes, scene, value, k):
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
    trial, found = settled(trial, scene, k, value, EVERYWHERE)
    return (trial, found) if found < np.inf else (volumes, value)


@compiled
def change_ties(volumes, scene, value, k):
    """Other slopes of volume k equal; and it may join the max instead of replacing what it covers."""
    if volumes[k, REPLACES] > 0.0:
        trial = volumes.copy()
        trial[k, REPLACES] = 0.0
        trial, found = settled(trial, scene, k, value, EVERYWHERE)
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
        trial, found = settled(trial, scene, k, value, 0.6)
        if found < np.inf:
            volumes, value = trial, found
    return volumes, value


@compiled
def face_walls(volumes, scene, value, k):
    """The two planes along each axis of volume k face along it or square to walls, each to one of `scene.leans`, or freely.

    Where all walls are along the axes no other way is looked for.
    """
    for axis in range(2):
        walls = scene.leans[int(volumes[k, DIRECTION]), axis]
        low, high = 2 * axis, 2 * axis + 1
        if walls[0] == np.inf or (volumes[k, OFFSET + low] == np.inf and volumes[k, OFFSET + high] == np.inf):
            continue
        _, middles = turns_of_planes(volumes, scene, k)
        best, best_value = volumes, value - LEAST_GAIN
        there = int(np.isfinite(walls).sum())
        for a in range(-1, there):
            for b in range(-1, there):
                trial = volumes.copy()
                for plane, wall in ((low, a), (high, b)):
                    lean = 0.0 if wall < 0 else walls[wall]
                    turn_plane(trial[k], plane, (lean if plane % 2 else -lean) + 0.0, middles[plane])
                refit(trial, scene, k)
                found = objective(trial, scene, best_value)
                if found < best_value:
                    best, best_value = trial, found
        best, best_value = face_freely(best, scene, best_value, k, axis)
        if best_value < value - LEAST_GAIN:
            volumes, value = best, best_value
            trial, found = settled(volumes.copy(), scene, k, value, EVERYWHERE)
            if found < np.inf:
                volumes, value = trial, found
    return volumes, value


@compiled
def face_freely(volumes, scene, value, k, axis):
    """The two planes along an axis of volume k face as their points say, where that is clearly better than any wall."""
    trial, limit = volumes.copy(), value - FREE_UNITS * scene.evidence
    for _ in range(TURNS):
        turns, middles = turns_of_planes(trial, scene, k)
        for plane in (2 * axis, 2 * axis + 1):
            lean = trial[k, LEAN + plane] + turns[plane]
            turn_plane(trial[k], plane, min(max(lean, -MOST_TURN), MOST_TURN), middles[plane])
        refit(trial, scene, k)
        found = objective(trial, scene, limit)
        if found < limit:
            volumes, value, limit = trial.copy(), found, found
    return volumes, value


@compiled
def turns_of_planes(volumes, scene, k):
    """By how much the lean of each inclined plane (4,) of volume k has to change for the points that it explains, and u, v (4, 2)
    in the middle of these; in that of its rectangle where there are none."""
    direction, n = int(volumes[k, DIRECTION]), scene.n
    u, v, c = scene.U[direction], scene.V[direction], coefficients(volumes, k)
    _, top = roof_heights(volumes, scene.U[:, :n], scene.V[:, :n])
    sums = np.zeros(
        (SIDES, 6)
    )  # of 1, u, v, what is left, and of y^2 and what is left times y, y along the plane's eave
    for i in range(n):
        h, plane = lowest_plane(c, u[i], v[i])
        left = scene.z[i] - h
        if top[i] == k and plane < LEVEL and abs(left) < scene.dead + scene.width:
            y = v[i] if plane < 2 else u[i]
            for q, term in enumerate((1.0, u[i], v[i], left, y * y, left * y)):
                sums[plane, q] += term
    turns, middles = np.zeros(SIDES), np.empty((SIDES, 2))
    for plane in range(SIDES):
        for axis in range(2):
            middle = 0.5 * (volumes[k, U0 + 2 * axis] + volumes[k, U1 + 2 * axis])
            middles[plane, axis] = sums[plane, 1 + axis] / sums[plane, 0] if sums[plane, 0] > 0.0 else middle
        y = middles[plane, 1] if plane < 2 else middles[plane, 0]
        spread = sums[plane, 4] - sums[plane, 0] * y * y
        if spread > 1e-9 and volumes[k, SLOPE + plane] > 0.0:
            turns[plane] = (sums[plane, 5] - sums[plane, 3] * y) / spread / volumes[k, SLOPE + plane]
    return turns, middles


@compiled
def turn_plane(row, plane, lean, middle):
    """Make a plane of a volume lean by `lean`, in place, as high at `middle` (u, v) as it was; one that is not there stays so."""
    if row[OFFSET + plane] == np.inf:
        return
    across = middle[1] if plane < 2 else middle[0]
    row[OFFSET + plane] += row[SLOPE + plane] * (row[LEAN + plane] - lean) * across
    row[LEAN + plane] = lean


@compiled
def add_planes(volumes, scene, value, k, slopes):
    """A further plane for volume k: an end, a side or a level top; its rectangle may reach beyond the outline there."""
    z_now, _ = roof_heights(volumes, scene.U, scene.V)
    everywhere, beneath = with_and_without(volumes, scene.U, scene.V, k)
    for plane in range(PLANES):
        if volumes[k, OFFSET + plane] < np.inf:
            continue
        tried = slopes_to_try(volumes[k], plane, slopes)
        least = 0.6 * scene.evidence * PARAMETER_COST
        gain, slope, offset = best_plane(volumes, scene, k, plane, tried, z_now, everywhere, beneath, least)
        wide = volumes.copy()
        if plane < LEVEL:
            wide[k, U0 + plane] = beyond(scene, int(volumes[k, DIRECTION]), plane)
            more, other_slope, other_offset = best_plane(wide, scene, k, plane, tried, z_now, everywhere, beneath, gain)
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
            trial, found = settled(trial, scene, k, value, EVERYWHERE)
            if found < np.inf:
                volumes, value = trial, found
                z_now, _ = roof_heights(volumes, scene.U, scene.V)
                everywhere, beneath = with_and_without(volumes, scene.U, scene.V, k)
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
    c, replaces = coefficients(volumes, k), volumes[k, REPLACES] > 0.0
    dead, width, z_points = scene.dead, scene.width, scene.z
    z, x, own, under = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    seeds = np.empty(n, np.int64)
    m = count = 0
    unchanged = 0.0
    for i in range(n):
        inside = volumes[k, U0] <= u[i] <= volumes[k, U1] and volumes[k, V0] <= v[i] <= volumes[k, V1]
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
            for p in range(m):
                h = max(min(own[p], offset + slope * x[p]), under[p])
                r = max(abs(z[p] - h) - dead, 0.0) / width
                gain -= min(r * r, 1.0)
                if gain < best:
                    break
            if gain > best:
                best, best_slope, best_offset = gain, slope, offset
    return best, best_slope, best_offset


@compiled
def merge_volumes(volumes, scene, value, steepest):
    """Two volumes become one over both rectangles, where neither is steeper than `steepest`."""
    k = 1
    while k < len(volumes):
        before = len(volumes)
        volumes, value = merge_with_others(volumes, scene, value, k, steepest)
        k = k + 1 if len(volumes) == before else 1
    return volumes, value


@compiled
def merge_with_others(volumes, scene, value, k, steepest):
    """Volume k and another become one over both rectangles, where neither is steeper than `steepest`."""
    for j in range(1, len(volumes)):
        if j == k or volumes[j, DIRECTION] != volumes[k, DIRECTION] or max_slope(volumes, j, k) > steepest:
            continue
        trial = volumes.copy()
        for edge in range(4):
            a, b = volumes[k, U0 + edge], volumes[j, U0 + edge]
            trial[k, U0 + edge] = min(a, b) if edge % 2 == 0 else max(a, b)
        trial, found = settled(without(trial, j), scene, k if k < j else k - 1, value, MERGE_REACH_M)
        if found < np.inf:
            return trial, found
    return volumes, value


@compiled
def join_neighbours(volumes, scene, value, k):
    """Volume k merged with another, those around it made one, or a plane of it handed to its neighbour: what helps first."""
    count, start = len(volumes), value
    volumes, value = merge_with_others(volumes, scene, value, k, np.inf)
    if len(volumes) == count:
        volumes, value = surround(volumes, scene, value, k)
    return hand_over(volumes, scene, value, k) if value == start else (volumes, value)


@compiled
def surround(volumes, scene, value, k):
    """The volumes that slope towards volume k on several of its sides become one that it stands on: a mansard's lower slopes, a skirt."""
    beside = np.zeros(SIDES, np.int64)
    for side in range(SIDES):
        beside[side] = sloping_towards(volumes, k, side)
    first = beside.max()
    if first == 0 or ((beside == 0) | (beside == first)).all():
        return volumes, value
    own = volumes[first].copy()
    kept = np.ones(len(volumes), np.bool_)
    own[OFFSET : OFFSET + PLANES], own[SLOPE : SLOPE + SIDES], own[LEAN : LEAN + SIDES] = np.inf, 0.0, 0.0
    for side in range(SIDES):
        j = beside[side]
        own[U0 + side] = volumes[j if j > 0 else k, U0 + side]
        if j > 0:
            kept[j] = False
            for column in (OFFSET + side, SLOPE + side, LEAN + side):
                own[column] = volumes[j, column]
    own[TIE], own[REPLACES] = FREE, 0.0
    top = volumes[k : k + 1].copy()
    top[0, REPLACES] = 1.0
    for side in range(SIDES):
        if beside[side] > 0:
            top[0, U0 + side] = volumes[beside[side], U0 + (side ^ 1)]
    kept[0] = kept[k] = False
    trial = np.concatenate((volumes[:1], own.reshape(1, -1), top, volumes[kept]))
    trial, found = settled(trial, scene, 1, value, MERGE_REACH_M)
    return (trial, found) if found < np.inf else (volumes, value)


@compiled
def hand_over(volumes, scene, value, k):
    """A plane of volume k goes to the volume that runs on in it: two slopes with a step between them are no gable with a strip beside."""
    for side in range(SIDES):
        j = running_on(volumes, k, side)
        if j == 0:
            continue
        trial = volumes.copy()
        remove_plane(trial[k], side)
        trial[j, U0 + side], trial[k, U0 + side] = volumes[k, U0 + side], volumes[j, U0 + (side ^ 1)]
        trial, found = settled(trial, scene, k, value, MERGE_REACH_M)
        if found < np.inf:
            return trial, found
    return volumes, value


@compiled
def running_on(volumes, k, side):
    """The volume that begins within volume k, over all its length, and has its plane of that side, and no other, all but as high; 0
    where there is none."""
    if volumes[k, OFFSET + side] == np.inf or plane_count(volumes[k]) < 2:
        return 0
    across = 2 - 2 * (side // 2)
    for j in range(1, len(volumes)):
        if j == k or volumes[j, DIRECTION] != volumes[k, DIRECTION] or volumes[j, OFFSET + side] == np.inf:
            continue
        along = np.abs(volumes[j, U0 + across : U0 + across + 2] - volumes[k, U0 + across : U0 + across + 2]).max()
        within = volumes[k, U0 + 2 * (side // 2)] < volumes[j, U0 + (side ^ 1)] < volumes[k, U1 + 2 * (side // 2)]
        if along < BESIDE_M and within and plane_count(volumes[j]) == 1 and is_alike(volumes, k, j, side):
            return j
    return 0


@compiled
def is_alike(volumes, k, j, plane):
    """Whether a plane of two volumes is all but as high in the middle of volume k."""
    u, v = 0.5 * (volumes[k, U0] + volumes[k, U1]), 0.5 * (volumes[k, V0] + volumes[k, V1])
    own = volumes[k, OFFSET + plane] + volumes[k, SLOPE + plane] * distance_up(volumes[k], plane, u, v)
    other = volumes[j, OFFSET + plane] + volumes[j, SLOPE + plane] * distance_up(volumes[j], plane, u, v)
    return abs(own - other) < ALIKE_M


@compiled
def sloping_towards(volumes, k, side):
    """The volume that begins at a side of volume k, along half of it at least, and rises towards it; 0 where there is none."""
    across, sign = 2 - 2 * (side // 2), -1.0 if side % 2 == 0 else 1.0
    low, high = volumes[k, U0 + across], volumes[k, U1 + across]
    for j in range(1, len(volumes)):
        if j == k or volumes[j, DIRECTION] != volumes[k, DIRECTION] or volumes[j, OFFSET + side] == np.inf:
            continue
        overlap = min(high, volumes[j, U1 + across]) - max(low, volumes[j, U0 + across])
        begins = sign * (volumes[j, U0 + (side ^ 1)] - volumes[k, U0 + side])
        ends = sign * (volumes[j, U0 + side] - volumes[k, U0 + side])
        if -UNDER_M < begins < BESIDE_M and ends > 0.0 and overlap > 0.5 * (high - low):
            return j
    return 0


@compiled
def max_slope(volumes, j, k):
    return max(volumes[j, SLOPE : SLOPE + SIDES].max(), volumes[k, SLOPE : SLOPE + SIDES].max())


@compiled
def without_base(volumes, scene, value):
    """The base below everything, where the volumes can cover the outline by themselves."""
    if volumes[0, OFFSET + LEVEL] <= scene.low - 0.6 or not is_unsettled(volumes, 0):
        return volumes, value
    volumes[0, SETTLED] = surroundings(volumes, 0)
    trial = volumes.copy()
    trial[0, OFFSET + LEVEL] = scene.low - 0.7
    found = objective(trial, scene, value + 0.3 * scene.n)
    if found < np.inf:
        found = move_all_edges(trial, scene, found, EVERYWHERE)
    return (trial, found) if found < value - LEAST_GAIN else (volumes, value)


@compiled
def improve(volumes, scene, value, slopes, rounds):
    """All moves in turn, for at most `rounds` rounds or until one brings next to nothing.

    A volume that no move changed is left alone until something around it is another.
    """
    for _ in range(rounds):
        before = value
        for k in range(len(volumes)):
            if k == 0 or is_unsettled(volumes, k):
                volumes, value = refitted(volumes, scene, value, k)
        for k in range(1, len(volumes)):
            if is_unsettled(volumes, k):
                value = move_edges(volumes, scene, k, value, EVERYWHERE)
        volumes, value = drop_volumes(volumes, scene, value)
        k = 1
        while k < len(volumes):
            count, start = len(volumes), value
            if is_unsettled(volumes, k):
                volumes, value = change_planes(volumes, scene, value, k, slopes)
                volumes, value = join_neighbours(volumes, scene, value, k)
                if value == start:
                    volumes[k, SETTLED] = surroundings(volumes, k)
            k = k + 1 if len(volumes) == count else 1
        volumes, value = without_base(volumes, scene, value)
        if value > before - 0.05 * scene.evidence:
            break
    return volumes, value


@compiled
def change_planes(volumes, scene, value, k, slopes):
    """All moves that change which planes volume k has, how they are tied and where they face."""
    volumes, value = drop_planes(volumes, scene, value, k, np.inf)
    volumes, value = flatten(volumes, scene, value, k)
    volumes, value = change_ties(volumes, scene, value, k)
    volumes, value = face_walls(volumes, scene, value, k)
    return add_planes(volumes, scene, value, k, slopes)


@compiled
def is_unsettled(volumes, k):
    """Whether volume k or what is around it changed since no move helped there."""
    return volumes[k, SETTLED] != surroundings(volumes, k)


@compiled
def surroundings(volumes, k):
    """A digest of volume k, of those whose rectangles meet its own or lie in another direction, and of the base's height."""
    total = math.floor(volumes[0, OFFSET + LEVEL] / DIGEST_STEP)
    for j in range(1, len(volumes)):
        if volumes[j, DIRECTION] == volumes[k, DIRECTION] and (
            volumes[j, U0] > volumes[k, U1] + AROUND_M
            or volumes[j, U1] < volumes[k, U0] - AROUND_M
            or volumes[j, V0] > volumes[k, V1] + AROUND_M
            or volumes[j, V1] < volumes[k, V0] - AROUND_M
        ):
            continue
        term = 1.0
        for q in range(SETTLED):
            x = volumes[j, q]
            term = (term * DIGEST_FACTOR + math.floor(min(x, HIGH_ABOVE) / DIGEST_STEP + 0.5)) % DIGEST_PRIME
        total += term
    return total + 1.0


@compiled
def simplify(volumes, scene, value, steepest):
    """Volumes and planes no steeper than `steepest` that do not pay under `scene` (a more tolerant one) go or are merged."""
    for _ in range(4):
        before = value
        k = 1
        while k < len(volumes):
            if volumes[k, SLOPE : SLOPE + SIDES].max() <= steepest:
                trial = without(volumes, k)
                found = objective(
                    trial, scene, value + HOPELESS_UNITS * scene.evidence + 2.0 * HOPELESS_SHARE * scene.n
                )
                if found < np.inf:
                    found = move_all_edges(trial, scene, found, EVERYWHERE)
                    trial, found = refit_each(trial, scene, found)
                    if found < value - LEAST_GAIN:
                        volumes, value = trial, found
                        continue
            volumes, value = drop_planes(volumes, scene, value, k, steepest)
            k += 1
        volumes, value = merge_volumes(volumes, scene, value, steepest)
        if value > before - LEAST_GAIN:
            break
    return volumes, value
