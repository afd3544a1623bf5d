"""Moves of several volumes at once, each taken where it lowers the objective. Compiled.

    merge       one volume over the rectangles of two
    take in     a volume of one plane becomes an end of its neighbour
    surround    slopes around a volume become one that it stands on
    hand over   a plane goes to the volume that runs on in it

All functions take volumes (k, COLUMNS) and the objective's value, and return the better of what they got and what they found.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from .around import look_around
from .moves import remove_plane, settled, without
from .volumes import (
    DIRECTION,
    FREE,
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
    distance_up,
    is_fixed,
    plane_count,
)

ALIKE_M = 0.4  # m between two planes that may be one: as far as points reach from a plane, and half as far again
# m within which a volume begins beyond the side of another, or under it, where edges are hidden and lie anywhere
BESIDE_M, UNDER_M = 0.6, 2.0
MERGE_REACH_M = 2.0  # m that edges may move when one volume takes another's place


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
        if j == k or is_fixed(volumes, j) or volumes[j, DIRECTION] != volumes[k, DIRECTION]:
            continue
        if max_slope(volumes, j, k) > steepest:
            continue
        trial = volumes.copy()
        for edge in range(4):
            reach_over(trial, k, j, edge)
        trial, found = settled_without(trial, scene, k, value, j)
        if found < np.inf:
            return trial, found
    return volumes, value


@compiled
def reach_over(volumes, k, j, edge):
    """Have an edge of volume k lie as far out as that of volume j, in place."""
    a, b = volumes[k, U0 + edge], volumes[j, U0 + edge]
    volumes[k, U0 + edge] = min(a, b) if edge % 2 == 0 else max(a, b)


@compiled
def settled_without(trial, scene, k, value, j):
    """`trial` without volume j, and with volume k, which took its place, settled; what `settled` says of it."""
    return settled_anew(without(trial, j), scene, k if k < j else k - 1, value)


@compiled
def settled_anew(trial, scene, k, value):
    """Settle volume k of a `trial` of which others changed, too."""
    around = look_around(trial, scene.U, scene.V, k)
    return settled(trial, scene, k, value, MERGE_REACH_M, around)


@compiled
def join_neighbours(volumes, scene, value, k):
    """Volume k merged with another, an end taken in, those around it made one, or a plane handed to its neighbour: what helps first."""
    count, start = len(volumes), value
    volumes, value = merge_with_others(volumes, scene, value, k, np.inf)
    if len(volumes) == count:
        volumes, value = take_in(volumes, scene, value, k)
    if len(volumes) == count:
        volumes, value = surround(volumes, scene, value, k)
    return hand_over(volumes, scene, value, k) if value == start else (volumes, value)


@compiled
def take_in(volumes, scene, value, k):
    """Volume k takes the one plane of a volume at its end as its own: a steep end is no roof in front of a gable."""
    for j in range(1, len(volumes)):
        if j == k or is_fixed(volumes, j) or volumes[j, DIRECTION] != volumes[k, DIRECTION]:
            continue
        if plane_count(volumes[j]) != 1:
            continue
        side = np.argmin(volumes[j, OFFSET : OFFSET + PLANES])
        if side == LEVEL or volumes[k, OFFSET + side] < np.inf or plane_count(volumes[k]) < 2:
            continue
        trial = volumes.copy()
        for column in (OFFSET + side, SLOPE + side, LEAN + side):
            trial[k, column] = volumes[j, column]
        trial[k, TIE] = FREE
        reach_over(trial, k, j, side)
        trial, found = settled_without(trial, scene, k, value, j)
        if found < np.inf:
            return trial, found
    return volumes, value


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
    trial, found = settled_anew(trial, scene, 1, value)
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
        trial, found = settled_anew(trial, scene, k, value)
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
        if j == k or is_fixed(volumes, j) or volumes[j, DIRECTION] != volumes[k, DIRECTION]:
            continue
        if volumes[j, OFFSET + side] == np.inf:
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
        if j == k or is_fixed(volumes, j) or volumes[j, DIRECTION] != volumes[k, DIRECTION]:
            continue
        if volumes[j, OFFSET + side] == np.inf:
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
