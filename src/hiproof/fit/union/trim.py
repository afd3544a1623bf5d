"""Draw in what is hidden of each volume.

No rectangle reaches further under another than necessary. First, sides next to a line of the
outline's corners are drawn out to it: what is visible of others in between is no roof of theirs.
"""

from __future__ import annotations

import numpy as np

from .moves import remove_volume
from .objective import compute_objective
from .prices import CUT_UNITS, SLACK_UNITS
from .scene import Scene, list_nodes
from .steps import list_near
from .volumes import (
    DIRECTION,
    U0,
    U1,
    UNSORTED,
    V0,
    V1,
    compute_roof_heights,
)

HIDDEN_M = 0.35  # Edges that are hidden by more (m) are drawn in.
COVER_M = 0.25  # They are drawn in to this distance (m) beyond what is visible.
NEAR_EDGE_M = 0.5  # An edge within this distance (m) of what is visible is the place for a side.
NEAR_VERTEX_M = 0.3  # A corner within this distance (m) of what is visible is the place for a side.
RUN_GAP_M = 0.8  # Length (m) over which a volume is hidden that is visible in several places.
RUN_GAP_NODES = 2.5  # The same in the raster's steps, which are long on large roofs.
# The outward direction of the low and the high edge along an axis.
OUTWARDS = np.array([-1.0, 1.0])


def trim(volumes: np.ndarray, scene: Scene, value: float) -> tuple[np.ndarray, float]:
    """Drop volumes that are not visible, and draw hidden edges in.

    Edges are drawn in to what is visible of each volume. Also returns the objective.
    """
    volumes, value = draw_out(volumes, scene, value, np.arange(1, len(volumes)))
    U, V = list_nodes(scene)
    _, top = compute_roof_heights(volumes, U, V, UNSORTED)
    k = 1
    for number in range(1, len(volumes)):
        visible = top == number
        if not visible.any():
            trial = remove_volume(volumes, k)
            trial_value = compute_objective(trial, scene, value + 1e-9)
            if np.isfinite(trial_value):
                volumes, value = trial, trial_value
                continue
        else:
            direction = int(volumes[k, DIRECTION])
            for column, x in ((U0, U[direction][visible]), (V0, V[direction][visible])):
                starts, ends, counts = find_runs(x, scene.pitch)
                for edge, seen_to in ((column, starts[0]), (column + 1, ends[-1])):
                    volumes, value = draw_in(volumes, scene, value, k, edge, float(seen_to), U, V)
                longest = int(np.argmax(counts))
                for edge, seen_to in ((column, starts[longest]), (column + 1, ends[longest])):
                    volumes, value = cut_short(volumes, scene, value, k, edge, float(seen_to))
        k += 1
    return volumes, value


def find_runs(x: np.ndarray, pitch: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the runs of places x (n,) that are close together.

    Places of one run are no more than a few steps of the raster apart. Returns where the runs begin
    and end (m,), and how many places each has.
    """
    gap, lowest, highest = max(RUN_GAP_M, RUN_GAP_NODES * pitch), x.min(), x.max()
    # With places in every half of a gap there is one run, found without sorting.
    if np.bincount(((x - lowest) * (2.0 / gap)).astype(int)).all():
        return np.array([lowest]), np.array([highest]), np.array([len(x)])
    x = np.sort(x)
    gaps = np.flatnonzero(x[1:] - x[:-1] > gap)
    first, last = np.concatenate(([0], gaps + 1)), np.concatenate((gaps, [len(x) - 1]))
    return x[first], x[last], last - first + 1


def draw_out(
    volumes: np.ndarray, scene: Scene, value: float, numbers: np.ndarray
) -> tuple[np.ndarray, float]:
    """Draw edges of the volumes `numbers` out to the line of corners next to each.

    An edge is drawn out if that costs nearly nothing.
    """
    edges, lines = (
        volumes[:, U0 : V1 + 1].reshape(-1, 2, 2, 1),
        scene.vertices[volumes[:, DIRECTION].astype(int)],
    )
    distances = OUTWARDS[:, None] * (lines[:, :, None] - edges)
    nearest = np.where(distances > 0.0, distances, np.inf).min(axis=3).reshape(-1, 4)
    for q, edge in np.argwhere(nearest[numbers] < NEAR_VERTEX_M):
        k, trial = numbers[q], volumes.copy()
        trial[k, U0 + edge] += OUTWARDS[edge % 2] * nearest[k, edge]
        trial_value = compute_objective(trial, scene, value + SLACK_UNITS * scene.evidence)
        if np.isfinite(trial_value):
            volumes, value = trial, trial_value
    return volumes, value


def list_around(volumes: np.ndarray, k: int, scene: Scene) -> np.ndarray:
    """Return the numbers of the volumes whose edges could be drawn out over volume k."""
    wide = volumes.copy()
    wide[k, [U0, V0]] -= NEAR_VERTEX_M
    wide[k, [U1, V1]] += NEAR_VERTEX_M
    neighbours = list_near(wide, scene.turn, -1)[k]
    around = neighbours[1 : 1 + neighbours[0]]
    return np.sort(around[around > 0])


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
    """Draw edge `edge` (a column) of volume k in to a line near `seen_to`.

    It is a line of others, or lies just beyond. It may cost nearly nothing, or whatever its steps
    cost if no height at the nodes U, V changes.
    """
    is_low = edge in (U0, V0)
    hidden = seen_to - volumes[k, edge] if is_low else volumes[k, edge] - seen_to
    if hidden < HIDDEN_M:
        return volumes, value
    just_beyond = seen_to - COVER_M if is_low else seen_to + COVER_M
    for place in (*list_near_lines(volumes, scene, k, edge, seen_to), just_beyond):
        trial = volumes.copy()
        trial[k, edge] = place
        if not has_width(trial[k]):
            continue
        trial_value = compute_objective(trial, scene, value + SLACK_UNITS * scene.evidence)
        if np.isfinite(trial_value):
            return trial, trial_value
        if not changes_heights(volumes, trial, k, edge, U, V):
            return trial, compute_objective(trial, scene, np.inf)
    return volumes, value


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
    heights = [compute_roof_heights(rows, U, V, UNSORTED)[0] for rows in (volumes, trial)]
    return not np.array_equal(*heights)


def cut_short(
    volumes: np.ndarray, scene: Scene, value: float, k: int, edge: int, seen_to: float
) -> tuple[np.ndarray, float]:
    """Cut edge `edge` (a column) of volume k at `seen_to`.

    Most of what is visible of it ends there. Neighbours must take the rest for nearly nothing.
    """
    is_low = edge in (U0, V0)
    if (seen_to - volumes[k, edge] if is_low else volumes[k, edge] - seen_to) < HIDDEN_M:
        return volumes, value
    trial = volumes.copy()
    trial[k, edge] = next(iter(list_near_lines(volumes, scene, k, edge, seen_to)), seen_to)
    if not has_width(trial[k]):
        return volumes, value
    trial_value = compute_objective(trial, scene, value + CUT_UNITS * scene.evidence)
    if np.isfinite(trial_value):
        trial, trial_value = draw_out(trial, scene, trial_value, list_around(volumes, k, scene))
    return (
        (trial, trial_value)
        if trial_value < value + SLACK_UNITS * scene.evidence
        else (volumes, value)
    )


def has_width(row: np.ndarray) -> bool:
    """Return whether a volume's rectangle holds more than a line.

    One that is visible at one line of nodes may end as a line.
    """
    return bool(row[U0] < row[U1] and row[V0] < row[V1])


def list_near_lines(
    volumes: np.ndarray, scene: Scene, k: int, edge: int, seen_to: float
) -> list[float]:
    """Return the nearest line to `seen_to`, in a list, or an empty list without any.

    It is another volume's edge or a corner of the outline.
    """
    axis, direction = (edge - U0) // 2, int(volumes[k, DIRECTION])
    column = U0 + 2 * axis
    other_rows = [
        row
        for j, row in enumerate(volumes[1:, [column, column + 1, DIRECTION]].tolist(), start=1)
        if j != k
    ]
    edges = [x for *ends, along in other_rows if along == direction for x in ends]
    near_lines = [x for x in edges if abs(x - seen_to) < NEAR_EDGE_M]
    near_lines += [
        x for x in scene.vertices[direction, axis].tolist() if abs(x - seen_to) < NEAR_VERTEX_M
    ]
    return [min(near_lines, key=lambda x: abs(x - seen_to))] if near_lines else []
