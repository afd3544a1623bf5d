"""What lies hidden of a volume is drawn in: no rectangle reaches further under another than it has to.

First sides next to a line of the outline's corners are drawn out to it, for what shows of others in between is no roof of theirs.
"""

from __future__ import annotations

import numpy as np

from .moves import remove_volume
from .objective import compute_objective
from .prices import CUT_UNITS, SLACK_UNITS
from .scene import Scene, list_nodes
from .volumes import DIRECTION, U0, U1, V0, V1, compute_roof_heights

HIDDEN_M, COVER_M = 0.35, 0.25  # edges hidden by more are drawn in, to so much beyond what shows
# m from what shows within which an edge or a corner is the place to draw a side in to
NEAR_EDGE_M, NEAR_VERTEX_M = 0.5, 0.3
# m, and of the raster's steps, which are long on large roofs, for which a volume is hidden that shows in several places
RUN_GAP_M, RUN_GAP_NODES = 0.8, 2.5
OUTWARDS = np.array([-1.0, 1.0])  # of the low and the high edge along an axis


def trim(volumes: np.ndarray, scene: Scene, value: float) -> tuple[np.ndarray, float]:
    """The volumes without those that nowhere show, hidden edges drawn in to what shows of each; and the objective."""
    volumes, value = draw_out(volumes, scene, value)
    U, V = list_nodes(scene)
    _, top = compute_roof_heights(volumes, U, V)
    visible_by_volume = [top == k for k in range(len(volumes))]
    k = 1
    for visible in visible_by_volume[1:]:
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
    """Where the runs of places x (n,) begin and end (m,) that follow each other by no more than a few steps of the raster, and how
    many places each has."""
    gap, lowest, highest = max(RUN_GAP_M, RUN_GAP_NODES * pitch), x.min(), x.max()
    if np.bincount(
        ((x - lowest) * (2.0 / gap)).astype(int)
    ).all():  # some in every half of a gap: one run, found without sorting
        return np.array([lowest]), np.array([highest]), np.array([len(x)])
    x = np.sort(x)
    gaps = np.flatnonzero(x[1:] - x[:-1] > gap)
    first, last = np.concatenate(([0], gaps + 1)), np.concatenate((gaps, [len(x) - 1]))
    return x[first], x[last], last - first + 1


def draw_out(volumes: np.ndarray, scene: Scene, value: float) -> tuple[np.ndarray, float]:
    """The volumes with every edge at the line of corners that is next to it on its outer side, where that costs next to nothing."""
    edges, lines = (
        volumes[:, U0 : V1 + 1].reshape(-1, 2, 2, 1),
        scene.vertices[volumes[:, DIRECTION].astype(int)],
    )
    distances = OUTWARDS[:, None] * (lines[:, :, None] - edges)
    nearest = np.where(distances > 0.0, distances, np.inf).min(axis=3).reshape(-1, 4)
    for k, edge in np.argwhere(nearest < NEAR_VERTEX_M):
        if k > 0:
            trial = volumes.copy()
            trial[k, U0 + edge] += OUTWARDS[edge % 2] * nearest[k, edge]
            trial_value = compute_objective(trial, scene, value + SLACK_UNITS * scene.evidence)
            if np.isfinite(trial_value):
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
    """Edge `edge` (a column) of volume k drawn in to the line near `seen_to` that others have, or just beyond it.

    It may cost next to nothing, or whatever its steps cost where no height at the nodes U, V changes.
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
        if np.array_equal(
            compute_roof_heights(trial, U, V)[0], compute_roof_heights(volumes, U, V)[0]
        ):
            return trial, compute_objective(trial, scene, np.inf)
    return volumes, value


def cut_short(
    volumes: np.ndarray, scene: Scene, value: float, k: int, edge: int, seen_to: float
) -> tuple[np.ndarray, float]:
    """Edge `edge` (a column) of volume k at `seen_to`, where most of what shows of it ends, if neighbours may take the rest for next to
    nothing."""
    is_low = edge in (U0, V0)
    if (seen_to - volumes[k, edge] if is_low else volumes[k, edge] - seen_to) < HIDDEN_M:
        return volumes, value
    trial = volumes.copy()
    trial[k, edge] = next(iter(list_near_lines(volumes, scene, k, edge, seen_to)), seen_to)
    if not has_width(trial[k]):
        return volumes, value
    trial_value = compute_objective(trial, scene, value + CUT_UNITS * scene.evidence)
    if np.isfinite(trial_value):
        trial, trial_value = draw_out(trial, scene, trial_value)
    return (
        (trial, trial_value)
        if trial_value < value + SLACK_UNITS * scene.evidence
        else (volumes, value)
    )


def has_width(row: np.ndarray) -> bool:
    """Whether a volume's rectangle holds more than a line, as one that shows at one line of nodes may end in."""
    return bool(row[U0] < row[U1] and row[V0] < row[V1])


def list_near_lines(
    volumes: np.ndarray, scene: Scene, k: int, edge: int, seen_to: float
) -> list[float]:
    """The nearest line to `seen_to` that another volume's edge or a corner of the outline has; none if none is near."""
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
