"""What lies hidden of a volume is drawn in: no rectangle reaches further under another than it has to.

First sides next to a line of the outline's corners are drawn out to it, for what shows of others in between is no roof of theirs.
"""

from __future__ import annotations

import numpy as np

from .moves import without
from .objective import objective
from .prices import CUT_UNITS, SLACK_UNITS
from .scene import Scene, nodes
from .volumes import DIRECTION, U0, U1, V0, V1, roof_heights

HIDDEN_M, COVER_M = 0.35, 0.25  # edges hidden by more are drawn in, to so much beyond what shows
# m from what shows within which an edge or a corner is the place to draw a side in to
NEAR_EDGE_M, NEAR_VERTEX_M = 0.5, 0.3
# m, and of the raster's steps, which are long on large roofs, for which a volume is hidden that shows in several places
GAP_M, GAP_NODES = 0.8, 2.5
OUTWARDS = np.array([-1.0, 1.0])  # of the low and the high edge along an axis


def trim(volumes: np.ndarray, scene: Scene, value: float) -> tuple[np.ndarray, float]:
    """The volumes without those that nowhere show, hidden edges drawn in to what shows of each; and the objective."""
    volumes, value = drawn_out(volumes, scene, value)
    U, V = nodes(scene)
    _, top = roof_heights(volumes, U, V)
    shown = [top == k for k in range(len(volumes))]
    k = 1
    for seen in shown[1:]:
        if not seen.any():
            trial = without(volumes, k)
            found = objective(trial, scene, value + 1e-9)
            if np.isfinite(found):
                volumes, value = trial, found
                continue
        else:
            direction = int(volumes[k, DIRECTION])
            for low, x in ((U0, U[direction][seen]), (V0, V[direction][seen])):
                starts, ends, counts = runs_of(x, scene.pitch)
                for edge, seen_to in ((low, starts[0]), (low + 1, ends[-1])):
                    volumes, value = drawn_in(volumes, scene, value, k, edge, float(seen_to), U, V)
                longest = int(np.argmax(counts))
                for edge, seen_to in ((low, starts[longest]), (low + 1, ends[longest])):
                    volumes, value = cut_short(volumes, scene, value, k, edge, float(seen_to))
        k += 1
    return volumes, value


def runs_of(x: np.ndarray, pitch: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where the runs of places x (n,) begin and end (m,) that follow each other by no more than a few steps of the raster, and how
    many places each has."""
    gap, low, high = max(GAP_M, GAP_NODES * pitch), x.min(), x.max()
    if np.bincount(
        ((x - low) * (2.0 / gap)).astype(int)
    ).all():  # some in every half of a gap: one run, found without sorting
        return np.array([low]), np.array([high]), np.array([len(x)])
    x = np.sort(x)
    gaps = np.flatnonzero(x[1:] - x[:-1] > gap)
    first, last = np.concatenate(([0], gaps + 1)), np.concatenate((gaps, [len(x) - 1]))
    return x[first], x[last], last - first + 1


def drawn_out(volumes: np.ndarray, scene: Scene, value: float) -> tuple[np.ndarray, float]:
    """The volumes with every edge at the line of corners that is next to it on its outer side, where that costs next to nothing."""
    edges, lines = volumes[:, U0 : V1 + 1].reshape(-1, 2, 2, 1), scene.vertices[volumes[:, DIRECTION].astype(int)]
    beyond = OUTWARDS[:, None] * (lines[:, :, None] - edges)
    nearest = np.where(beyond > 0.0, beyond, np.inf).min(axis=3).reshape(-1, 4)
    for k, edge in np.argwhere(nearest < NEAR_VERTEX_M):
        if k > 0:
            trial = volumes.copy()
            trial[k, U0 + edge] += OUTWARDS[edge % 2] * nearest[k, edge]
            found = objective(trial, scene, value + SLACK_UNITS * scene.evidence)
            if np.isfinite(found):
                volumes, value = trial, found
    return volumes, value


def drawn_in(
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
    low = edge in (U0, V0)
    hidden = seen_to - volumes[k, edge] if low else volumes[k, edge] - seen_to
    if hidden < HIDDEN_M:
        return volumes, value
    just_beyond = seen_to - COVER_M if low else seen_to + COVER_M
    for place in (*lines_near(volumes, scene, k, edge, seen_to), just_beyond):
        trial = volumes.copy()
        trial[k, edge] = place
        if not has_width(trial[k]):
            continue
        found = objective(trial, scene, value + SLACK_UNITS * scene.evidence)
        if np.isfinite(found):
            return trial, found
        if np.array_equal(roof_heights(trial, U, V)[0], roof_heights(volumes, U, V)[0]):
            return trial, objective(trial, scene, np.inf)
    return volumes, value


def cut_short(
    volumes: np.ndarray, scene: Scene, value: float, k: int, edge: int, seen_to: float
) -> tuple[np.ndarray, float]:
    """Edge `edge` (a column) of volume k at `seen_to`, where most of what shows of it ends, if neighbours may take the rest for next to
    nothing."""
    low = edge in (U0, V0)
    if (seen_to - volumes[k, edge] if low else volumes[k, edge] - seen_to) < HIDDEN_M:
        return volumes, value
    trial = volumes.copy()
    trial[k, edge] = next(iter(lines_near(volumes, scene, k, edge, seen_to)), seen_to)
    if not has_width(trial[k]):
        return volumes, value
    found = objective(trial, scene, value + CUT_UNITS * scene.evidence)
    if np.isfinite(found):
        trial, found = drawn_out(trial, scene, found)
    return (trial, found) if found < value + SLACK_UNITS * scene.evidence else (volumes, value)


def has_width(row: np.ndarray) -> bool:
    """Whether a volume's rectangle holds more than a line, as one that shows at one line of nodes may end in."""
    return bool(row[U0] < row[U1] and row[V0] < row[V1])


def lines_near(volumes: np.ndarray, scene: Scene, k: int, edge: int, seen_to: float) -> list[float]:
    """The nearest line to `seen_to` that another volume's edge or a corner of the outline has; none if none is near."""
    axis, direction = (edge - U0) // 2, int(volumes[k, DIRECTION])
    low = U0 + 2 * axis
    others = [row for j, row in enumerate(volumes[1:, [low, low + 1, DIRECTION]].tolist(), start=1) if j != k]
    edges = [x for *ends, along in others if along == direction for x in ends]
    near = [x for x in edges if abs(x - seen_to) < NEAR_EDGE_M]
    near += [x for x in scene.vertices[direction, axis].tolist() if abs(x - seen_to) < NEAR_VERTEX_M]
    return [min(near, key=lambda x: abs(x - seen_to))] if near else []
