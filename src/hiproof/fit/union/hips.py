"""Steps below hips: where a hip's plane comes down to its neighbours' eaves.

Where a hip ends in a step, not at a wall, points tell its place only to within their spacing. Its plane and those beside it tell better: a
draughtsman draws its corners where they meet.
"""

from __future__ import annotations

import numpy as np

from .finish import Planes
from .objective import costs
from .scene import Scene
from .sides import Side
from .volumes import DIRECTION, SIDES, U0, V0, V1, with_and_without

MOVED_M, AT_PLACE_M = 0.8, 0.01  # how far a step may be moved to the planes; nearer it is where they meet
POINTS_UNITS = 2.0  # of evidence that its points may cost more there
LEAST_BREAK = 0.05  # rise over run; planes less apart do not tell where they meet
ONE_LINE_M = 0.02  # sides of two volumes nearer than this are one step


def with_steps_at_hips(
    volumes: np.ndarray, planes: list[Planes], sides: list[list[Side]], scene: Scene
) -> list[list[Side]]:
    """The sides of all volumes, steps below hips moved to where the planes meet, as far as the points allow."""
    moved = [list(own) for own in sides]
    for k in range(1, len(volumes)):
        for edge in range(SIDES):
            was = moved[k][edge]
            side = None if was.anchored else side_at_corners(planes[k].rows, moved[k], edge)
            if side is not None and dearer(volumes, k, edge, was, side, scene) <= POINTS_UNITS * scene.evidence:
                for own in (
                    own
                    for own, volume in zip(moved, volumes, strict=True)
                    if volume[DIRECTION] == volumes[k, DIRECTION]
                ):
                    for other in (edge & 2, edge | 1):
                        if is_one_line(own[other], was):
                            own[other] = Side(side.at, side.lean, False, own[other].sigma)
    return moved


def side_at_corners(rows: np.ndarray, sides: list[Side], edge: int) -> Side | None:
    """The line of a volume's side through where its plane meets those beside it at their sides; None where there is no other."""
    axis, was = edge // 2, sides[edge]
    ends = [place for beside in (2 - 2 * axis, 3 - 2 * axis) for place in corner_of(rows, sides[beside], edge, beside)]
    off = [abs(x - was.at - was.lean * y) for x, y in ends]
    if not ends or not AT_PLACE_M < max(off) < MOVED_M:
        return None
    (x, y), (last_x, last_y) = ends[0], ends[-1]
    lean = (last_x - x) / (last_y - y) if len(ends) == 2 else was.lean
    return Side(x - lean * y, lean, False, was.sigma)


def corner_of(rows: np.ndarray, beside: Side, edge: int, other: int) -> list[tuple[float, float]]:
    """Where planes `edge` and `other` of a volume (5, 3) meet on the side `beside` of the latter, across and along the former; none where
    they do not."""
    apart = (rows[edge] - rows[other])[[edge // 2, 1 - edge // 2, 2]]
    fall = apart[0] + apart[1] * beside.lean
    if not abs(fall) > LEAST_BREAK:  # also where one of them is not there
        return []
    x = -(apart[2] + apart[1] * beside.at) / fall
    return [(float(x), float(beside.at + beside.lean * x))]


def dearer(volumes: np.ndarray, k: int, edge: int, was: Side, side: Side, scene: Scene) -> float:
    """What points cost more where `edge` of volume k is on the line `side`."""
    axis, direction, sign = edge // 2, int(volumes[k, DIRECTION]), -1.0 if edge % 2 == 0 else 1.0
    x, y = (scene.U[direction], scene.V[direction])[:: 1 if axis == 0 else -1]
    within = (y >= volumes[k, V0 - 2 * axis]) & (y <= volumes[k, V1 - 2 * axis])
    within &= sign * (x - volumes[k, U0 + (edge ^ 1)]) >= 0.0
    before, after = (within & (sign * (x - line.at - line.lean * y) <= 0.0) for line in (was, side))
    everywhere, without = with_and_without(volumes, scene.U, scene.V, k)
    gain = np.where(everywhere != without, costs(everywhere, scene) - costs(without, scene), 0.0)
    return float(gain[after].sum() - gain[before].sum())


def is_one_line(one: Side, other: Side) -> bool:
    return not one.anchored and abs(one.at - other.at) < ONE_LINE_M and abs(one.lean - other.lean) < ONE_LINE_M
