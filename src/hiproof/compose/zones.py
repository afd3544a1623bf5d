"""Zones of a plan in which a solid failed, and what is attempted there.

So a fault in one place of a large roof changes nothing in the others.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from .arrangement import GRID_M

CROSSING_MOVE_M = 2e-4  # rounding to the grid moves a crossing by less
ZONE_MARGIN_M = 0.5  # around faces at fault, more than the coarsest snapping


class Attempt(NamedTuple):
    """What is tried in a zone.

    It is a factor on the snap distance, whether walls in line are one, and whether flat corners
    turn in.
    """

    coarseness: float
    merges_walls: bool
    turns_in: bool


# in turn until the solid is valid
ATTEMPTS = (
    Attempt(1.0, True, False),
    Attempt(1.0, False, False),
    Attempt(3.0, False, False),
    Attempt(10.0, False, False),
    Attempt(20.0, False, False),
    Attempt(30.0, False, False),
    Attempt(1.0, False, True),
    Attempt(3.0, False, True),
    Attempt(10.0, False, True),
    Attempt(30.0, False, True),
)


class Zone(NamedTuple):
    """A box of the plan, and the number of its attempt.

    The box is (low x, low y, high x, high y) [m]. Of zones that overlap, the last one holds.
    """

    box: tuple[float, ...]
    number: int

    @property
    def attempt(self) -> Attempt:
        return ATTEMPTS[self.number]


WHOLE_PLAN = (-math.inf, -math.inf, math.inf, math.inf)


def add_zones(zones: Sequence[Zone], boxes: Iterable[tuple[float, ...]]) -> tuple[Zone, ...]:
    """Add a zone around every box, with the attempt that follows all those made there.

    Returns no zones where none follows.
    """
    result = list(zones)
    for x0, y0, x1, y1 in boxes:
        box = x0 - ZONE_MARGIN_M, y0 - ZONE_MARGIN_M, x1 + ZONE_MARGIN_M, y1 + ZONE_MARGIN_M
        numbers = [zone.number for zone in zones if overlap(zone.box, box)]
        if 1 + max(numbers) == len(ATTEMPTS):
            return ()
        result.append(Zone(box, 1 + max(numbers)))
    return tuple(result)


def frame_places(xy: np.ndarray) -> tuple[float, ...]:
    """Return the box around places (n, 2): low x, low y, high x, high y."""
    return (*xy.min(axis=0).tolist(), *xy.max(axis=0).tolist())


def overlap(box: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return box[0] <= other[2] and other[0] <= box[2] and box[1] <= other[3] and other[1] <= box[3]


def list_reaches(zones: Iterable[Zone], snap_m: float) -> np.ndarray:
    """Return the box and the reach (k, 5) of every zone, in grid units."""
    return (
        np.array(
            [(*zone.box, zone.attempt.coarseness * snap_m + CROSSING_MOVE_M) for zone in zones]
        )
        / GRID_M
    )


def select_turned_in(zones: Iterable[Zone], xy: np.ndarray) -> np.ndarray:
    """Return which places (n, 2), in grid units, may be turned in (n,)."""
    result = np.zeros(len(xy), bool)
    x, y = xy.T * GRID_M
    for (x0, y0, x1, y1), number in zones:
        inside = (x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)
        result[inside] = ATTEMPTS[number].turns_in
    return result
