"""Draw one volume over walls that cut its corners off, instead of several.

The search has no planes over such walls. It covers a bay with slanted sides, or an eight-sided
tower, with several volumes, some of them turned. Each volume is therefore tried alone as it would
be if it reached over these walls.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...primitives.cants import MOST_CANTS
from ..direction import quarter_gap
from .cants import FEWEST_INCLINED, INSIDE_WALL_M, OFF_RAD, orient_walls
from .finish import find_visible_points
from .scene import Scene
from .volumes import DIRECTION, N_SIDES, OFFSET0, REPLACES, SLOPE0, U0, U1, V0, V1, is_allowed

FURTHEST_M = 6.0  # Furthest (m) that a volume is drawn out to a corner of the outline.
MOST_STEPS = 2  # Most corners to which each side is drawn out.
CORNER_MARGIN_M = 0.3  # Distance (m) that these corners may lie beside the volume.
LEAST_OUT_M = 0.1  # A corner that is nearer (m) is where the volume ends.
# Most walls that face along no axis of the outline's main direction. With more, its walls are
# round.
MOST_ASLANT = 8
WITHIN = 0.8  # Share of a volume's points from which on it lies within another.


def draw_over_corners(volumes: np.ndarray, walls: np.ndarray, scene: Scene) -> Iterator[np.ndarray]:
    """Yield the volumes with one of them drawn over `walls` that cut its corners off.

    The walls are (m, 2, 2). The volume reaches as far as a corner of the outline on one side, or
    stays as wide. Volumes over these walls that then lie within it are dropped.
    """
    if len(volumes) < 3:  # there is none to drop
        return
    places, aslant = place_inside_walls(walls, scene)
    if not 0 < aslant[0].sum() <= MOST_ASLANT:
        return
    visible_points = find_visible_points(volumes, scene)
    for k in range(1, len(volumes)):
        direction, joined = int(volumes[k, DIRECTION]), volumes[k].copy()
        joined[REPLACES] = 0.0
        if not count_inclined_planes(joined):
            continue
        for row in (joined, *extend_to_corners(joined, scene.corners[direction])):
            cut = aslant[direction] & is_in_rectangle(places[direction], row)
            if (
                not 0 < cut.sum() <= MOST_CANTS
                or count_inclined_planes(row) < FEWEST_INCLINED
                or not is_allowed(row, scene.allowed)
            ):
                continue
            is_over = [
                (cut & is_in_rectangle(places[int(other[DIRECTION])], other)).any()
                for other in volumes
            ]
            inside = is_in_rectangle(np.column_stack([scene.U[direction], scene.V[direction]]), row)
            is_covered = [
                inside[numbers].sum() > WITHIN * len(numbers) for numbers in visible_points
            ]
            dropped = [j for j in range(1, len(volumes)) if j != k and is_over[j] and is_covered[j]]
            if dropped:
                trial = volumes.copy()
                trial[k] = row
                yield np.delete(trial, dropped, axis=0)


def place_inside_walls(walls: np.ndarray, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return places (directions, m, 2) just inside the middles of `walls` (m, 2, 2).

    They are in every direction's axes. Also returns which walls (directions, m) face along no axis
    there.
    """
    orientations = [orient_walls(walls, turn) for turn in scene.turn]
    places = np.array([middle - INSIDE_WALL_M * outwards for middle, outwards in orientations])
    angles = quarter_gap(
        np.array([np.arctan2(outwards[:, 1], outwards[:, 0]) for _, outwards in orientations])
    )
    return places, np.abs(angles) > OFF_RAD


def is_in_rectangle(places: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Return which places (n, 2) lie in a volume's rectangle."""
    u, v = places.T
    return (u >= row[U0]) & (u <= row[U1]) & (v >= row[V0]) & (v <= row[V1])


def count_inclined_planes(row: np.ndarray) -> int:
    """Count the inclined planes of a volume."""
    return int(np.isfinite(row[OFFSET0 : OFFSET0 + N_SIDES]).sum())


def extend_to_corners(row: np.ndarray, corners: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the volume drawn out on one side to corners (c, 2) of the outline.

    The corners are in its own axes. A plane rises from there, as steep as its others.
    """
    for edge in range(N_SIDES):
        axis, sign = edge // 2, 1.0 if edge % 2 else -1.0
        lower, upper = row[V0 - 2 * axis], row[V1 - 2 * axis]
        is_beside = (corners[:, 1 - axis] > lower - CORNER_MARGIN_M) & (
            corners[:, 1 - axis] < upper + CORNER_MARGIN_M
        )
        out = sign * (corners[is_beside, axis] - row[U0 + edge])
        steps = np.unique(np.round(out[(out > LEAST_OUT_M) & (out < FURTHEST_M)], 1)).tolist()
        for step in steps[-MOST_STEPS:]:
            trial = row.copy()
            trial[U0 + edge] += sign * step
            yield add_plane(trial, edge)


def add_plane(row: np.ndarray, edge: int) -> np.ndarray:
    """Add a plane from the side `edge`, if the volume has none there.

    It is as steep as its others, and its eave as high.
    """
    planes = [k for k in range(N_SIDES) if np.isfinite(row[OFFSET0 + k])]
    if edge not in planes:
        distances = row[[U0, U1, V0, V1]] * (1.0, -1.0, 1.0, -1.0)
        row[SLOPE0 + edge] = row[[SLOPE0 + k for k in planes]].mean()
        eave = min(row[OFFSET0 + k] + row[SLOPE0 + k] * distances[k] for k in planes)
        row[OFFSET0 + edge] = eave - row[SLOPE0 + edge] * distances[edge]
    return row
