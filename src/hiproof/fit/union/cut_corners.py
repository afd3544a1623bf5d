"""One volume over walls that cut its corners off, in place of several.

The search has no planes over such walls: it covers a bay with slanted sides, or an eight-sided tower, with several volumes, some of them
turned. So each volume is tried as it would be if it reached over these walls, by itself.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...primitives.cants import MOST_CANTS
from ..direction import quarter_gap
from .cants import FEWEST_INCLINED, NEAR_M, OFF_RAD, seen_along
from .finish import shown_points
from .scene import Scene
from .volumes import DIRECTION, OFFSET, REPLACES, SIDES, SLOPE, U0, U1, V0, V1, is_allowed

# m by which a volume may be drawn out to a corner of the outline, at how many places a side, and how far beside the volume these may be
FURTHEST_M, MOST_STEPS, BESIDE_M = 6.0, 2, 0.3
LEAST_M = 0.1  # nearer, a corner is where the volume ends
MOST_ASLANT = 8  # walls of an outline that face along no axis of its main direction: with more its walls are round
WITHIN = 0.8  # of a volume's points, from which on it stands within another


def over_cut_corners(volumes: np.ndarray, walls: np.ndarray, scene: Scene) -> Iterator[np.ndarray]:
    """The volumes with one of them drawn out over `walls` (m, 2, 2) that cut its corners off, as far as a corner of the outline on one
    side or none, and without those over these walls that then stand within it."""
    places, aslant = beside_walls(walls, scene)
    if not 0 < aslant[0].sum() <= MOST_ASLANT:
        return
    shown = shown_points(volumes, scene)
    for k in range(1, len(volumes)):
        direction, joined = int(volumes[k, DIRECTION]), volumes[k].copy()
        joined[REPLACES] = 0.0
        if not inclined(joined):
            continue
        for row in (joined, *further_out(joined, scene.corners[direction])):
            cut = aslant[direction] & lies_within(places[direction], row)
            if not 0 < cut.sum() <= MOST_CANTS or inclined(row) < FEWEST_INCLINED or not is_allowed(row, scene.allowed):
                continue
            over = [(cut & lies_within(places[int(other[DIRECTION])], other)).any() for other in volumes]
            inside = lies_within(np.column_stack([scene.U[direction], scene.V[direction]]), row)
            within = [inside[own].sum() > WITHIN * len(own) for own in shown]
            gone = [j for j in range(1, len(volumes)) if j != k and over[j] and within[j]]
            if gone or row is not joined:
                trial = volumes.copy()
                trial[k] = row
                yield np.delete(trial, gone, axis=0)


def beside_walls(walls: np.ndarray, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Places (directions, m, 2) just inside the middles of `walls` (m, 2, 2), in every direction's axes, and which walls (directions, m)
    face along no axis there."""
    seen = [seen_along(walls, turn) for turn in scene.turn]
    places = np.array([middle - NEAR_M * outwards for middle, outwards in seen])
    off = quarter_gap(np.array([np.arctan2(outwards[:, 1], outwards[:, 0]) for _, outwards in seen]))
    return places, np.abs(off) > OFF_RAD


def lies_within(places: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Which places (n, 2) lie in a volume's rectangle."""
    u, v = places.T
    return (u >= row[U0]) & (u <= row[U1]) & (v >= row[V0]) & (v <= row[V1])


def inclined(row: np.ndarray) -> int:
    """How many inclined planes a volume has."""
    return int(np.isfinite(row[OFFSET : OFFSET + SIDES]).sum())


def further_out(row: np.ndarray, corners: np.ndarray) -> Iterator[np.ndarray]:
    """The volume drawn out on one side to corners (c, 2) of the outline, in its own axes, with a plane from there as steep as its others."""
    for edge in range(SIDES):
        axis, sign = edge // 2, 1.0 if edge % 2 else -1.0
        low, high = row[V0 - 2 * axis], row[V1 - 2 * axis]
        beside = (corners[:, 1 - axis] > low - BESIDE_M) & (corners[:, 1 - axis] < high + BESIDE_M)
        out = sign * (corners[beside, axis] - row[U0 + edge])
        for step in np.unique(np.round(out[(out > LEAST_M) & (out < FURTHEST_M)], 1)).tolist()[-MOST_STEPS:]:
            trial = row.copy()
            trial[U0 + edge] += sign * step
            yield with_plane(trial, edge)


def with_plane(row: np.ndarray, edge: int) -> np.ndarray:
    """The volume with a plane from the side `edge`, which rises as its others do from as high, where it has none there."""
    there = [k for k in range(SIDES) if np.isfinite(row[OFFSET + k])]
    if edge not in there:
        at = row[[U0, U1, V0, V1]] * (1.0, -1.0, 1.0, -1.0)
        row[SLOPE + edge] = row[[SLOPE + k for k in there]].mean()
        eave = min(row[OFFSET + k] + row[SLOPE + k] * at[k] for k in there)
        row[OFFSET + edge] = eave - row[SLOPE + edge] * at[edge]
    return row
