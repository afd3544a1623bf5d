"""Change several volumes at once, where that lowers the objective. Compiled.

    merge       one volume over the rectangles of two
    take end    a volume of one plane becomes an end of its neighbour
    surround    slopes around a volume become one that it stands on
    hand plane  a plane goes to the volume that continues it

All functions take volumes (k, COLUMNS) and the objective's value, and return the better of these
and of what they find.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from .around import measure_context
from .moves import remove_plane, remove_volume, settle_move
from .volumes import (
    DIRECTION,
    FREE,
    LEAN0,
    LEVEL,
    N_PLANES,
    N_SIDES,
    OFFSET0,
    REPLACES,
    SLOPE0,
    TIE,
    U0,
    U1,
    V0,
    V1,
    count_planes,
    is_fixed,
    measure_run,
)

# Height (m) between two planes that may be one: as far as points reach from a plane, and half as
# far again.
SAME_HEIGHT_M = 0.4
NEIGHBOUR_GAP_M = 0.6  # A volume begins at the side of another within this distance (m) beyond it.
# A volume begins at the side of another within this distance (m) under it, where edges are hidden
# and lie anywhere.
UNDER_M = 2.0
MERGE_REACH_M = 2.0  # Distance (m) that edges may move when one volume takes another's place.


@compiled
def merge_volumes(volumes, scene, value, steepest):
    """Merge pairs of volumes over both rectangles, if neither is above `steepest`."""
    k = 1
    while k < len(volumes):
        count_before = len(volumes)
        volumes, value = merge_volume(volumes, scene, value, k, steepest)
        k = k + 1 if len(volumes) == count_before else 1
    return volumes, value


@compiled
def merge_volume(volumes, scene, value, k, steepest):
    """Merge volume k with another over both rectangles.

    Neither may be steeper than `steepest`.
    """
    for j in range(1, len(volumes)):
        if j == k or is_fixed(volumes, j) or volumes[j, DIRECTION] != volumes[k, DIRECTION]:
            continue
        if find_steepest_slope(volumes, j, k) > steepest:
            continue
        trial = volumes.copy()
        for edge in range(4):
            extend_edge(trial, k, j, edge)
        trial, trial_value = settle_merger(trial, scene, k, value, j)
        if trial_value < np.inf:
            return trial, trial_value
    return volumes, value


@compiled
def extend_edge(volumes, k, j, edge):
    """Move an edge of volume k as far out as that of volume j, in place."""
    a, b = volumes[k, U0 + edge], volumes[j, U0 + edge]
    volumes[k, U0 + edge] = min(a, b) if edge % 2 == 0 else max(a, b)


@compiled
def settle_merger(trial, scene, k, value, j):
    """Settle volume k of `trial` without volume j, whose place it takes."""
    return settle_trial(remove_volume(trial, j), scene, k if k < j else k - 1, value)


@compiled
def settle_trial(trial, scene, k, value):
    """Settle volume k of a `trial` of which others changed, too."""
    context = measure_context(trial, scene.U, scene.V, scene.order, k)
    return settle_move(trial, scene, k, value, MERGE_REACH_M, context)


@compiled
def join_neighbours(volumes, scene, value, k):
    """Merge volume k, take in an end, surround it, or hand over a plane.

    The first of these that helps is kept.
    """
    count, start = len(volumes), value
    volumes, value = merge_volume(volumes, scene, value, k, np.inf)
    if len(volumes) == count:
        volumes, value = take_end(volumes, scene, value, k)
    if len(volumes) == count:
        volumes, value = surround(volumes, scene, value, k)
    return hand_plane(volumes, scene, value, k) if value == start else (volumes, value)


@compiled
def take_end(volumes, scene, value, k):
    """Let volume k take the one plane of a volume at its end as its own.

    A steep end is no roof in front of a gable.
    """
    for j in range(1, len(volumes)):
        if j == k or is_fixed(volumes, j) or volumes[j, DIRECTION] != volumes[k, DIRECTION]:
            continue
        if count_planes(volumes[j]) != 1:
            continue
        side = np.argmin(volumes[j, OFFSET0 : OFFSET0 + N_PLANES])
        if side == LEVEL or volumes[k, OFFSET0 + side] < np.inf or count_planes(volumes[k]) < 2:
            continue
        trial = volumes.copy()
        for column in (OFFSET0 + side, SLOPE0 + side, LEAN0 + side):
            trial[k, column] = volumes[j, column]
        trial[k, TIE] = FREE
        extend_edge(trial, k, j, side)
        trial, trial_value = settle_merger(trial, scene, k, value, j)
        if trial_value < np.inf:
            return trial, trial_value
    return volumes, value


@compiled
def surround(volumes, scene, value, k):
    """Let volumes that slope towards volume k on several sides become one under it.

    Such are the lower slopes of a mansard, or a skirt.
    """
    neighbours = np.zeros(N_SIDES, np.int64)
    for side in range(N_SIDES):
        neighbours[side] = find_rising_neighbour(volumes, k, side)
    first = neighbours.max()
    if first == 0 or ((neighbours == 0) | (neighbours == first)).all():
        return volumes, value
    skirt = volumes[first].copy()
    is_kept = np.ones(len(volumes), np.bool_)
    (
        skirt[OFFSET0 : OFFSET0 + N_PLANES],
        skirt[SLOPE0 : SLOPE0 + N_SIDES],
        skirt[LEAN0 : LEAN0 + N_SIDES],
    ) = np.inf, 0.0, 0.0
    for side in range(N_SIDES):
        j = neighbours[side]
        skirt[U0 + side] = volumes[j if j > 0 else k, U0 + side]
        if j > 0:
            is_kept[j] = False
            for column in (OFFSET0 + side, SLOPE0 + side, LEAN0 + side):
                skirt[column] = volumes[j, column]
    skirt[TIE], skirt[REPLACES] = FREE, 0.0
    top = volumes[k : k + 1].copy()
    top[0, REPLACES] = 1.0
    for side in range(N_SIDES):
        if neighbours[side] > 0:
            top[0, U0 + side] = volumes[neighbours[side], U0 + (side ^ 1)]
    is_kept[0] = is_kept[k] = False
    trial = np.concatenate((volumes[:1], skirt.reshape(1, -1), top, volumes[is_kept]))
    trial, trial_value = settle_trial(trial, scene, 1, value)
    return (trial, trial_value) if trial_value < np.inf else (volumes, value)


@compiled
def hand_plane(volumes, scene, value, k):
    """Hand a plane of volume k to the volume that continues it.

    Two slopes with a step between them are no gable with a strip beside it.
    """
    for side in range(N_SIDES):
        j = find_continuation(volumes, k, side)
        if j == 0:
            continue
        trial = volumes.copy()
        remove_plane(trial[k], side)
        trial[j, U0 + side], trial[k, U0 + side] = (
            volumes[k, U0 + side],
            volumes[j, U0 + (side ^ 1)],
        )
        trial, trial_value = settle_trial(trial, scene, k, value)
        if trial_value < np.inf:
            return trial, trial_value
    return volumes, value


@compiled
def find_continuation(volumes, k, side):
    """Find the volume that begins within volume k and continues its plane of one side.

    It reaches over all its length, has no other plane, and lies nearly as high. Returns 0 without
    one.
    """
    if volumes[k, OFFSET0 + side] == np.inf or count_planes(volumes[k]) < 2:
        return 0
    across = 2 - 2 * (side // 2)
    for j in range(1, len(volumes)):
        if j == k or is_fixed(volumes, j) or volumes[j, DIRECTION] != volumes[k, DIRECTION]:
            continue
        if volumes[j, OFFSET0 + side] == np.inf:
            continue
        along = np.abs(
            volumes[j, U0 + across : U0 + across + 2] - volumes[k, U0 + across : U0 + across + 2]
        ).max()
        is_inside = (
            volumes[k, U0 + 2 * (side // 2)]
            < volumes[j, U0 + (side ^ 1)]
            < volumes[k, U1 + 2 * (side // 2)]
        )
        if (
            along < NEIGHBOUR_GAP_M
            and is_inside
            and count_planes(volumes[j]) == 1
            and has_same_height(volumes, k, j, side)
        ):
            return j
    return 0


@compiled
def has_same_height(volumes, k, j, plane):
    """Return whether a plane of two volumes is nearly as high in volume k's middle."""
    u, v = 0.5 * (volumes[k, U0] + volumes[k, U1]), 0.5 * (volumes[k, V0] + volumes[k, V1])
    height = volumes[k, OFFSET0 + plane] + volumes[k, SLOPE0 + plane] * measure_run(
        volumes[k], plane, u, v
    )
    other_height = volumes[j, OFFSET0 + plane] + volumes[j, SLOPE0 + plane] * measure_run(
        volumes[j], plane, u, v
    )
    return abs(height - other_height) < SAME_HEIGHT_M


@compiled
def find_rising_neighbour(volumes, k, side):
    """Find the volume that begins at a side of volume k and rises towards it.

    It reaches along half of the side at least. Returns 0 without one.
    """
    across, sign = 2 - 2 * (side // 2), -1.0 if side % 2 == 0 else 1.0
    start, end = volumes[k, U0 + across], volumes[k, U1 + across]
    for j in range(1, len(volumes)):
        if j == k or is_fixed(volumes, j) or volumes[j, DIRECTION] != volumes[k, DIRECTION]:
            continue
        if volumes[j, OFFSET0 + side] == np.inf:
            continue
        overlap = min(end, volumes[j, U1 + across]) - max(start, volumes[j, U0 + across])
        begins = sign * (volumes[j, U0 + (side ^ 1)] - volumes[k, U0 + side])
        ends = sign * (volumes[j, U0 + side] - volumes[k, U0 + side])
        if -UNDER_M < begins < NEIGHBOUR_GAP_M and ends > 0.0 and overlap > 0.5 * (end - start):
            return j
    return 0


@compiled
def find_steepest_slope(volumes, j, k):
    return max(
        volumes[j, SLOPE0 : SLOPE0 + N_SIDES].max(), volumes[k, SLOPE0 : SLOPE0 + N_SIDES].max()
    )
