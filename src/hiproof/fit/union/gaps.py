"""Split volumes at gaps, such as a row of dormers found as one strip.

In a gap across a volume, points lie on what the roof would be without it. The search moves edges
and adds volumes, but a strip as long as a row explains so many points that no dormer replaces it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .around import compute_roof_with, measure_context
from .edges import MIN_SIDE_M
from .moves import settle_volume
from .objective import compute_costs, compute_objective
from .prices import COPY_UNITS
from .repeats import COPY_REACH_M, is_repeatable, sum_costs
from .scene import Scene
from .volumes import DIRECTION, U0, U1, V0, V1, list_movable


class Gap(NamedTuple):
    """A strip across a volume from `start` to `end` along an axis.

    `gain` is what the roof would cost less without the volume there.
    """

    gain: float
    axis: int = 0
    start: float = 0.0
    end: float = 0.0


def split_at_gaps(volumes: np.ndarray, scene: Scene) -> np.ndarray:
    """Split each volume at its gaps, and the pieces again."""
    open_numbers = list_movable(volumes).tolist()
    while open_numbers:
        k = open_numbers.pop()
        trial = split_once(volumes, k, scene)
        if trial is not None:
            volumes = trial
            open_numbers += [k, k + 1]
    return volumes


def split_once(volumes: np.ndarray, k: int, scene: Scene) -> np.ndarray | None:
    """Split volume k in two at the gap in which it costs most.

    Returns None if that does not pay. It pays by the objective, or as copies of small volumes do:
    the pieces of a row have lines and heights in common.
    """
    numbers, gain = measure_gain_without(volumes, k, scene)
    if np.maximum(gain, 0.0).sum() < scene.evidence:
        return None
    gap = max(find_gap(volumes, k, axis, numbers, gain, scene) for axis in (0, 1))
    if gap.gain < scene.evidence:
        return None
    trial, value = settle_pieces(cut_at_gap(volumes, k, gap), k, scene)
    if value < compute_objective(volumes, scene, np.inf):
        return trial
    saved = sum_costs(volumes, scene) - sum_costs(trial, scene)
    is_row = is_repeatable(trial[k]) or is_repeatable(trial[k + 1])
    return trial if is_row and saved > COPY_UNITS * scene.evidence else None


def measure_gain_without(
    volumes: np.ndarray, k: int, scene: Scene
) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers (m,) of the places under volume k, and its gains (m,).

    A gain is what a place would cost less without the volume.
    """
    u, v = scene.U[int(volumes[k, DIRECTION])], scene.V[int(volumes[k, DIRECTION])]
    u0, u1, v0, v1 = volumes[k, [U0, U1, V0, V1]]
    numbers = np.flatnonzero((u >= u0) & (u <= u1) & (v >= v0) & (v <= v1))
    context = measure_context(volumes, scene.U, scene.V, scene.order, k)
    roof_with = compute_roof_with(volumes, scene.U, scene.V, k, context)
    gain = compute_costs(roof_with, scene) - compute_costs(context.roof_without, scene)
    return numbers, gain[numbers]


def find_gap(
    volumes: np.ndarray, k: int, axis: int, numbers: np.ndarray, gain: np.ndarray, scene: Scene
) -> Gap:
    """Find where along an axis volume k costs most more than the roof without it.

    A piece of least width remains on either side. The gap saves nothing if there is none.
    """
    x = (scene.U, scene.V)[axis][int(volumes[k, DIRECTION]), numbers]
    lower, upper = volumes[k, [U0 + 2 * axis, U1 + 2 * axis]]
    order = np.argsort(x, kind="stable")
    order = order[(x[order] > lower + MIN_SIDE_M) & (x[order] < upper - MIN_SIDE_M)]
    if len(order) < 2:
        return Gap(0.0)
    total = np.concatenate([[0.0], np.cumsum(gain[order])])
    rise = total - np.minimum.accumulate(total)
    last = int(np.argmax(rise))
    first = int(np.argmin(total[: last + 1]))
    x = np.concatenate([x[order[:1]], x[order], x[order[-1:]]])
    start, end = (0.5 * (x[n] + x[n + 1]) for n in (first, last))
    return Gap(float(rise[last]), axis, float(start), float(end))


def cut_at_gap(volumes: np.ndarray, k: int, gap: Gap) -> np.ndarray:
    """Return the volumes with two pieces, on either side of a gap, as volume k."""
    pieces = volumes[[k, k]]
    pieces[0, U1 + 2 * gap.axis], pieces[1, U0 + 2 * gap.axis] = gap.start, gap.end
    return np.concatenate([volumes[:k], pieces, volumes[k + 1 :]])


def settle_pieces(volumes: np.ndarray, k: int, scene: Scene) -> tuple[np.ndarray, float]:
    """Refit volumes k and k + 1, and move their edges. Also returns the objective."""
    value = compute_objective(volumes, scene, np.inf)
    for piece in (k, k + 1):
        volumes, value = settle_volume(volumes, scene, value, piece, COPY_REACH_M)
    return volumes, value
