"""A polygon as the lines of its sides. Compiled.

They run counter-clockwise; those of a court in one run clockwise.

`lines` (n, 2) hold a row a side: the azimuth of the normal that looks outwards (rad) and the line's
distance from the origin along it (m). Corner i is where sides i - 1 and i meet, so side i runs from
corner i to corner i + 1.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled import compiled
from ...geometry.arrays import copy_row, copy_rows
from .. import direction

# sine of the angle between neighbours: lines closer to parallel have no corner to speak of
SHARPEST = 0.15
# of the turn at a corner: what ends in a wedge of less than 25 degrees is no roof
BACK = math.cos(math.radians(155.0))
SAME_RAD = 1e-6  # rad; numerically parallel

quarter_gap = compiled(direction.quarter_gap)


def make_lines(corners: np.ndarray) -> np.ndarray:
    """Return the sides (n, 2) of the polygon with `corners` (n, 2).

    They run counter-clockwise, those of a court clockwise.
    """
    ends = np.roll(corners, -1, axis=0)
    step, middle = ends - corners, 0.5 * (corners + ends)
    azimuth = np.arctan2(step[:, 1], step[:, 0]) - 0.5 * math.pi
    return np.column_stack(
        [azimuth, middle[:, 0] * np.cos(azimuth) + middle[:, 1] * np.sin(azimuth)]
    )


@compiled
def find_corners(lines, corners, smallest):
    """Write the corners (n, 2) of `lines`.

    False where they are no simple polygon run through in order.

    Only the first `smallest` are written unless it is negative: the others are there, and the sides
    between them run on and cross none of each other.
    """
    n = len(lines)
    smallest = n if smallest < 0 else min(smallest, n)
    for i in range(smallest):
        previous, r_before, following, r_after = (
            lines[i - 1, 0],
            lines[i - 1, 1],
            lines[i, 0],
            lines[i, 1],
        )
        sine = math.sin(following - previous)
        if abs(sine) < SHARPEST or math.cos(following - previous) < BACK:
            return False
        corners[i, 0] = (r_before * math.sin(following) - r_after * math.sin(previous)) / sine
        corners[i, 1] = (r_after * math.cos(previous) - r_before * math.cos(following)) / sine
    wanted_count = min(smallest + 1, n)
    for k in range(wanted_count):
        i = (k - 1) % n
        along = math.cos(lines[i, 0]) * (corners[k, 1] - corners[i, 1])
        if along - math.sin(lines[i, 0]) * (corners[k, 0] - corners[i, 0]) < -1e-9:
            return False
    for k in range(wanted_count):
        if crosses_another(corners, (k - 1) % n):
            return False
    return True


@compiled
def crosses_another(corners, i):
    """Return whether side i crosses another that is not next to it."""
    n = len(corners)
    previous, count = i - 1 if i > 0 else n - 1, i + 1 if i + 1 < n else 0
    x, y = corners[i, 0], corners[i, 1]
    u, v = corners[count, 0] - x, corners[count, 1] - y
    for j in range(n):
        k = j + 1 if j + 1 < n else 0
        start = u * (corners[j, 1] - y) - v * (corners[j, 0] - x)
        end = u * (corners[k, 1] - y) - v * (corners[k, 0] - x)
        # ends on either side of the line of side i
        if start * end < 0.0 and j != i and j != previous and j != count:
            p, q = corners[k, 0] - corners[j, 0], corners[k, 1] - corners[j, 1]
            item = p * (y - corners[j, 1]) - q * (x - corners[j, 0])
            other = p * (y + v - corners[j, 1]) - q * (x + u - corners[j, 0])
            if item * other < 0.0:
                return True
    return False


@compiled
def compute_area(corners):
    """Return the area (m2) of a polygon, positive if counter-clockwise."""
    doubled = 0.0
    for i in range(len(corners)):
        doubled += corners[i - 1, 0] * corners[i, 1] - corners[i, 0] * corners[i - 1, 1]
    return 0.5 * doubled


@compiled
def shares_direction(lines, i):
    """Return whether a line before line `i` has its direction."""
    for j in range(i):
        if abs(quarter_gap(lines[j, 0] - lines[i, 0])) < SAME_RAD:
            return True
    return False


@compiled
def replace_lines(lines, i, count, azimuth, distance):
    """Replace `count` lines from `i` on by one, which comes first."""
    return replaced_by(lines, i, count, np.array([[azimuth, distance]]))


@compiled
def replaced_by(lines, i, count, flight):
    """Replace `count` lines from `i` on by those of `flight` (m, 2).

    These come first.
    """
    n, m = len(lines), len(flight)
    result = np.empty((m + n - count, 2))
    copy_rows(result, flight)
    for k in range(n - count):
        copy_row(result[m + k], lines[(i + count + k) % n])
    return result


@compiled
def drop_line(lines, i):
    """Return the lines without line `i`; the one after it comes first."""
    return replaced_by(lines, i, 1, lines[:0])
