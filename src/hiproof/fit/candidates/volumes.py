"""Describe candidates for volumes as rows of one array. Compiled.

A volume is a rectangle in one of the building's directions and a min of at most five planes in its
own axes u, v:

    rising along +u, rising along -u, rising along +v, rising along -v, level

The four inclined ones may lean: they then face square to a wall that is not quite along the axes. A
volume that replaces others (a recess cut into a slope, a low annex beside a gable's wall) hides
within it all that came before.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from ..prices import SKEW_UNITS, UNKNOWN_UNITS, VOLUME_UNITS

DIRECTION = 0  # Column of a volume's row: the number of its direction.
# Columns of its rectangle, in metres of that direction's axes.
U0, U1, V0, V1 = 1, 2, 3, 4
SLOPE0 = 5  # First column of the slopes of its four inclined planes.
# First column of the offsets of its five planes: z at u = v = 0, infinite where it has no such
# plane.
OFFSET0 = 9
TIE = 14  # Column that says which slopes are equal.
REPLACES = 15  # Column that says whether it replaces what lies below.
# First column of the leans: plane k is z = offset + slope (x + lean y) with x = u, -u, v, -v and y
# the other of u, v.
LEAN0 = 16
COLUMNS = 20  # Number of columns of a row.
N_SIDES = 4  # Number of planes that slope.
N_PLANES = 5  # Number of all planes.
LEVEL = 4  # Number of the level plane.

FREE = 0.0  # The tie under which no slopes are equal.
OPPOSITE = 1.0  # The tie under which slopes that face each other are equal.
ALL_EQUAL = 2.0  # The tie under which all slopes are equal.
SLOPE_LOW = 0.01  # A flatter slope (rise over run), half a degree, is level.
SLOPE_HIGH = 2.75  # A steeper slope (rise over run), 70 degrees, is a wall.


@compiled
def read_coefficients(volumes, k):
    """Return the numbers of volume k's planes.

    They are five offsets, four slopes, and four slopes across, as scalars that stay in registers.
    """
    # no view of a row: counting the references to one costs more than reading the numbers
    along = volumes[k, 5], volumes[k, 6], volumes[k, 7], volumes[k, 8]
    lean = volumes[k, 16], volumes[k, 17], volumes[k, 18], volumes[k, 19]
    across = along[0] * lean[0], along[1] * lean[1], along[2] * lean[2], along[3] * lean[3]
    return (
        volumes[k, 9],
        volumes[k, 10],
        volumes[k, 11],
        volumes[k, 12],
        volumes[k, 13],
        *along,
        *across,
    )


@compiled
def find_lowest(c, u, v):
    """Return the height at u, v of a volume with coefficients c.

    Its rectangle does not matter.
    """
    along = min(c[0] + c[5] * u + c[9] * v, c[1] - c[6] * u + c[10] * v)
    across = min(c[2] + c[7] * v + c[11] * u, c[3] - c[8] * v + c[12] * u)
    return min(min(along, across), c[4])


@compiled
def measure_run(row, k, u, v):
    """Return the run of plane k of a volume at u, v: metres from the axes' origin.

    The plane rises along it, by its slope.
    """
    x, y = (u, v) if k < 2 else (v, u)
    return (x if k % 2 == 0 else -x) + row[LEAN0 + k] * y


@compiled
def count_slopes(row):
    """Count the slopes of its own that a volume has under its tie."""
    along = int(row[OFFSET0] < np.inf) + int(row[OFFSET0 + 1] < np.inf)
    across = int(row[OFFSET0 + 2] < np.inf) + int(row[OFFSET0 + 3] < np.inf)
    if row[TIE] == FREE:
        return along + across
    if row[TIE] == OPPOSITE:
        return min(along, 1) + min(across, 1)
    return min(along + across, 1)


@compiled
def count_planes(row):
    count = 0
    for k in range(N_PLANES):
        count += int(row[OFFSET0 + k] < np.inf)
    return count


@compiled
def price_volume(row):
    """Return the units of one volume without its edges."""
    leaning = 0.0
    for k in range(N_SIDES):
        leaning += SKEW_UNITS if row[LEAN0 + k] != 0.0 and row[OFFSET0 + k] < np.inf else 0.0
    return VOLUME_UNITS + UNKNOWN_UNITS * (count_planes(row) + count_slopes(row)) + leaning


@compiled
def is_allowed(row, allowed):
    """Return whether a volume's shape is among `allowed` (2, 3, 3, 2).

    The axes are: has a top, planes along, planes across, free slopes.
    """
    along = int(row[OFFSET0] < np.inf) + int(row[OFFSET0 + 1] < np.inf)
    across = int(row[OFFSET0 + 2] < np.inf) + int(row[OFFSET0 + 3] < np.inf)
    return allowed[int(row[OFFSET0 + LEVEL] < np.inf), along, across, int(row[TIE] == FREE)]


@compiled
def equalise_slopes(row):
    """Make the slopes equal that the tie makes equal.

    Each plane turns about the middle of its half of the rectangle.
    """
    if row[TIE] == FREE:
        return
    step = N_SIDES if row[TIE] == ALL_EQUAL else 2
    for first in range(0, N_SIDES, step):
        total = count = 0.0
        for k in range(first, first + step):
            if row[OFFSET0 + k] < np.inf:
                total += row[SLOPE0 + k]
                count += 1.0
        if count < 2.0:
            continue
        for k in range(first, first + step):
            if row[OFFSET0 + k] < np.inf:
                start, end = (row[U0], row[U1]) if k < 2 else (row[V0], row[V1])
                middle, quarter = 0.5 * (start + end), 0.25 * (end - start)
                x = middle - quarter if k % 2 == 0 else middle + quarter
                y = 0.5 * (row[V0] + row[V1]) if k < 2 else 0.5 * (row[U0] + row[U1])
                u, v = (x, y) if k < 2 else (y, x)
                row[OFFSET0 + k] += (row[SLOPE0 + k] - total / count) * measure_run(row, k, u, v)
                row[SLOPE0 + k] = total / count
