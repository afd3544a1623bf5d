"""A start for the search: the largest rectangles inside the outline, each with the volume that explains its points best.

Wings of one building often have the same planes, and the volume that gains most by itself then covers both. Two rectangles
that overlap start from what the footprint says.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from .objective import costs, place_cost
from .plan import MERGE_LINES_M
from .scene import Scene, nodes
from .volumes import DIRECTION, U0, V1, coefficients, lowest, roof_heights, volume_cost

INSIDE_SHARE = 0.96  # of a rectangle that lies in the outline
LEAST_SHARE, LEAST_M2 = 0.06, 4.0  # of the outline that a further rectangle adds
AS_LARGE, ON_BORDER_M = 0.97, 0.01
MOST_RECTANGLES, MOST_LINES = 5, 14


def from_rectangles(base: np.ndarray, scene: Scene, candidates: np.ndarray) -> np.ndarray:
    """The `base` and a volume over each of the outline's largest rectangles; the base alone where these are fewer than two."""
    found = largest_rectangles(scene)
    if len(found) < 2 or len(candidates) == 0:
        return base
    volumes = base
    for rectangle in found:
        z_now, _ = roof_heights(volumes, scene.U, scene.V)
        chosen = best_within(scene, candidates, rectangle, z_now, costs(z_now, scene))
        if chosen >= 0:
            volume = candidates[chosen].copy()
            volume[U0 : V1 + 1] = rectangle[1:]
            volumes = np.vstack([volumes, volume])
    return volumes


def largest_rectangles(scene: Scene) -> np.ndarray:
    """Direction, u0, u1, v0, v1 (k, 5) of the rectangles between corners of the outline that together cover most of it."""
    inside = scene.depth.ravel() > -ON_BORDER_M
    own = [rectangles_in(scene, k, u, v, inside) for k, (u, v) in enumerate(zip(*nodes(scene, -np.inf), strict=True))]
    rectangles, covers = np.concatenate([one for one, _ in own]), np.concatenate([other for _, other in own])
    area, missing, found = covers.sum(axis=1), np.ones(covers.shape[1], bool), []
    while len(rectangles) and len(found) < MOST_RECTANGLES:
        new = covers[:, missing].sum(axis=1)
        if new.max() < max(LEAST_SHARE * inside.sum(), LEAST_M2 / scene.pitch**2):
            break
        best = int(np.argmax(np.where(new >= AS_LARGE * new.max(), area, 0)))
        found.append(rectangles[best])
        missing &= ~covers[best]
    return np.array(found).reshape(-1, 5)


def rectangles_in(
    scene: Scene, direction: int, u: np.ndarray, v: np.ndarray, inside: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """All rectangles (m, 5) of one direction inside the outline, and which nodes of the outline each covers (m, n)."""
    lines = [merged(axis[np.isfinite(axis)]) for axis in scene.vertices[direction]]
    none = np.zeros((0, 5)), np.zeros((0, inside.sum()), bool)
    if max(map(len, lines)) > MOST_LINES:
        return none
    (u0, u1), (v0, v1) = (np.triu_indices(len(axis), 1) for axis in lines)
    a, b, c, d = (axis.ravel() for axis in np.broadcast_arrays(u0[:, None], u1[:, None], v0, v1))
    cells = np.zeros((2, len(lines[0]) + 1, len(lines[1]) + 1))
    np.add.at(cells, (inside.astype(int), np.searchsorted(lines[0], u), np.searchsorted(lines[1], v)), 1.0)
    total = cells.cumsum(axis=1).cumsum(axis=2)  # up to each line
    outside, within = total[:, b, d] - total[:, a, d] - total[:, b, c] + total[:, a, c]
    full = (within > INSIDE_SHARE * (within + outside)) & (within * scene.pitch**2 > LEAST_M2)
    if not full.any():
        return none
    a, b, c, d = a[full], b[full], c[full], d[full]
    found = np.column_stack([np.full(len(a), direction), lines[0][a], lines[0][b], lines[1][c], lines[1][d]])
    _, low_u, high_u, low_v, high_v = found.T[:, :, None]
    u, v = u[inside], v[inside]
    return found, (u >= low_u) & (u <= high_u) & (v >= low_v) & (v <= high_v)


def merged(lines: np.ndarray) -> np.ndarray:
    """Ascending lines without those within MERGE_LINES_M of the one before; the last stays."""
    kept = [lines[0]]
    for x in lines[1:]:
        if x - kept[-1] > MERGE_LINES_M:
            kept.append(x)
    kept[-1] = max(kept[-1], lines[-1])
    return np.array(kept)


@compiled
def best_within(scene, candidates, rectangle, z_now, cost_now):
    """The candidate that, joined over `rectangle` (5,), gains most over it less its price; -1 where none is of its direction."""
    direction = int(rectangle[0])
    u, v = scene.U[direction], scene.V[direction]
    best, chosen = -np.inf, -1
    for m in range(len(candidates)):
        if int(candidates[m, DIRECTION]) != direction:
            continue
        c = coefficients(candidates, m)
        gain = -scene.evidence * volume_cost(candidates[m])
        for i in range(len(z_now)):
            if rectangle[1] <= u[i] <= rectangle[2] and rectangle[3] <= v[i] <= rectangle[4]:
                h = lowest(c, u[i], v[i])
                if h <= z_now[i]:
                    continue
                gain += cost_now[i] - place_cost(scene, i, h)
        if gain > best:
            best, chosen = gain, m
    return chosen
