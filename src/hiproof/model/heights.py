"""Heights of roofs at many points. Compiled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..compiled import compiled
from ..geometry.point_in_polygon import flips
from ..geometry.rings import ring_edges
from .roof import Part

MANY_PLACES = 10_000  # Of more places, each piece looks only at those in its strip.


def find_highest(parts: Sequence[Part], xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the height (n,) of the roof of `parts` at `xy` (n, 2), and the part.

    Beside the roof the height is minus infinity. The part (n,) is given by its number, the first of
    several. This is `Part.height_at` for many points. On a border that two pieces share, one piece
    that holds the point counts.
    """
    z, top = np.full(len(xy), -np.inf), np.zeros(len(xy), np.int64)
    is_sorted = len(xy) > MANY_PLACES
    order = np.argsort(xy[:, 0]) if is_sorted else slice(None)
    x, y = np.ascontiguousarray(xy[order].T)
    for k, part in enumerate(parts):
        for piece in part.pieces:
            starts, ends = ring_edges(piece.outline)
            strip = find_strip(x, starts[:, 0]) if is_sorted else slice(None)
            planes = np.ascontiguousarray(piece.planes)
            raise_over(z[strip], top[strip], k, x[strip], y[strip], starts, ends, planes)
    if is_sorted:
        z[order], top[order] = z.copy(), top.copy()
    return z, top


def find_strip(x: np.ndarray, ends: np.ndarray) -> slice:
    """Return which of sorted x (n,) lie between the lowest and the highest end."""
    first, last = np.searchsorted(x, (ends.min(), np.nextafter(ends.max(), np.inf)))
    return slice(int(first), int(last))


@compiled
def raise_over(
    z: np.ndarray,
    top: np.ndarray,
    number: int,
    x: np.ndarray,
    y: np.ndarray,
    starts: np.ndarray,
    ends: np.ndarray,
    planes: np.ndarray,
) -> None:
    """Raise heights z (n,) inside a polygon to the lowest of `planes` (k, 3).

    The polygon has edges from `starts` to `ends` (m, 2). Where z rises, `top` (n,) becomes
    `number`.
    """
    low_x, low_y, high_x, high_y = np.inf, np.inf, -np.inf, -np.inf
    for e in range(len(starts)):
        low_x, high_x = min(low_x, starts[e, 0]), max(high_x, starts[e, 0])
        low_y, high_y = min(low_y, starts[e, 1]), max(high_y, starts[e, 1])
    near = np.nonzero((x >= low_x) & (x <= high_x) & (y >= low_y) & (y <= high_y))[0]
    near_x, near_y, inside = x[near], y[near], np.zeros(len(near), np.bool_)
    for e in range(len(starts)):
        for i in range(len(near)):
            inside[i] ^= flips(
                starts[e, 0], starts[e, 1], ends[e, 0], ends[e, 1], near_x[i], near_y[i]
            )
    for k in near[inside]:
        lowest = np.inf
        for a, b, c in planes:
            lowest = min(lowest, a * x[k] + b * y[k] + c)
        if lowest > z[k]:
            z[k], top[k] = lowest, number
