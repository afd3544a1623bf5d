"""Draw in what is hidden of each volume.

No rectangle reaches further under another than necessary. First, sides next to a line of the
outline's corners are drawn out to it: what is visible of others in between is no roof of theirs.
"""

from __future__ import annotations

import numpy as np

from ..prices import SLACK_UNITS
from .moves import remove_volume
from .objective import compute_objective
from .scene import Scene
from .volumes import (
    DIRECTION,
    U0,
    U1,
    V0,
    V1,
    compute_roof_heights,
)

HIDDEN_M = 0.35  # Edges that are hidden by more (m) are drawn in.
COVER_M = 0.25  # They are drawn in to this distance (m) beyond what is visible.
NEAR_VERTEX_M = 0.3  # A corner within this distance (m) of what is visible is the place for a side.
# The outward direction of the low and the high edge along an axis.
OUTWARDS = np.array([-1.0, 1.0])


def trim(
    volumes: np.ndarray, scene: Scene, value: float, U: np.ndarray, V: np.ndarray
) -> tuple[np.ndarray, float]:
    """Drop volumes that are not visible, and draw hidden edges in.

    Edges are drawn in to what is visible of each volume at the nodes U, V (directions, n). Also
    returns the objective.
    """
    volumes, value = draw_out(volumes, scene, value)
    _, top = compute_roof_heights(volumes, U, V)
    k = 1
    for number in range(1, len(volumes)):
        visible = top == number
        if not visible.any():
            trial = remove_volume(volumes, k)
            trial_value = compute_objective(trial, scene)
            if trial_value <= value + 1e-9:
                volumes, value = trial, trial_value
                continue
        else:
            direction = int(volumes[k, DIRECTION])
            for column, x in ((U0, U[direction][visible]), (V0, V[direction][visible])):
                for edge, seen_to in ((column, x.min()), (column + 1, x.max())):
                    volumes, value = draw_in(volumes, scene, value, k, edge, float(seen_to), U, V)
        k += 1
    return volumes, value


def draw_out(volumes: np.ndarray, scene: Scene, value: float) -> tuple[np.ndarray, float]:
    """Draw edges of the volumes out to the line of corners next to each.

    An edge is drawn out if that costs nearly nothing.
    """
    edges, lines = (
        volumes[:, U0 : V1 + 1].reshape(-1, 2, 2, 1),
        scene.vertices[volumes[:, DIRECTION].astype(int)],
    )
    distances = OUTWARDS[:, None] * (lines[:, :, None] - edges)
    nearest = np.where(distances > 0.0, distances, np.inf).min(axis=3).reshape(-1, 4)
    for k, edge in np.argwhere(nearest[1:] < NEAR_VERTEX_M) + (1, 0):
        trial = volumes.copy()
        trial[k, U0 + edge] += OUTWARDS[edge % 2] * nearest[k, edge]
        trial_value = compute_objective(trial, scene)
        if trial_value <= value + SLACK_UNITS * scene.unit:
            volumes, value = trial, trial_value
    return volumes, value


def draw_in(
    volumes: np.ndarray,
    scene: Scene,
    value: float,
    k: int,
    edge: int,
    seen_to: float,
    U: np.ndarray,
    V: np.ndarray,
) -> tuple[np.ndarray, float]:
    """Draw edge `edge` (a column) of volume k in to just beyond `seen_to`.

    It is, whatever its steps cost, if no height at the nodes U, V changes.
    """
    is_low = edge in (U0, V0)
    hidden = seen_to - volumes[k, edge] if is_low else volumes[k, edge] - seen_to
    if hidden < HIDDEN_M:
        return volumes, value
    trial = volumes.copy()
    trial[k, edge] = seen_to - COVER_M if is_low else seen_to + COVER_M
    if changes_heights(volumes, trial, k, edge, U, V):
        return volumes, value
    return trial, compute_objective(trial, scene)


def changes_heights(
    volumes: np.ndarray, trial: np.ndarray, k: int, edge: int, U: np.ndarray, V: np.ndarray
) -> bool:
    """Return whether the roof's height changes at any of U, V with a moved edge.

    The edge is a column of volume k, and `trial` are the volumes with it elsewhere.
    """
    x = (U if edge in (U0, U1) else V)[int(volumes[k, DIRECTION])]
    first, last = sorted((volumes[k, edge], trial[k, edge]))
    is_between = (first <= x) & (x <= last)
    U, V = (np.ascontiguousarray(axis[:, is_between]) for axis in (U, V))
    heights = [compute_roof_heights(rows, U, V)[0] for rows in (volumes, trial)]
    return not np.array_equal(*heights)
