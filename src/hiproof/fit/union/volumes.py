"""A roof under construction: volumes as rows of one array, their heights and what they cost, compiled.

A volume is a rectangle in one of the building's directions and a min of at most five planes in its own axes u, v:

    rising along +u, rising along -u, rising along +v, rising along -v, level

The four inclined ones may lean: face square to a wall that is not quite along the axes.
The roof is the max of the volumes in whose rectangle a place lies, but a volume that replaces (a recess cut into a slope, a
low annex beside a gable's wall) is all that shows within it of what came before. Row 0 is the base: level, everywhere.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from .prices import LEANING_COST, PARAMETER_COST, PART_COST, REPLACING_COST

# Columns of a volume's row: its direction's number, rectangle (metres in that direction's axes), the slopes of the four
# inclined planes, the offsets of all five (z at u = v = 0; infinite where it has no such plane), tie and whether it replaces,
# leans: plane k is z = offset + slope (x + lean y) with x = u, -u, v, -v and y the other of u, v; a digest of how
# things stood around it when no move changed it.
DIRECTION = 0
U0, U1, V0, V1 = 1, 2, 3, 4  # columns of a volume's row: its rectangle
SLOPE0, OFFSET0 = 5, 9  # columns of the four slopes, and of the five planes' offsets
TIE, REPLACES = 14, 15  # columns: which slopes are equal, and whether it replaces what lies below
LEAN0 = 16  # first column of how far each plane faces off its axis
# column: a digest of the surroundings in which no move was found for it, infinite where it is fixed
SETTLED = 20
# column: the number of a volume among the whole roof's while a window of it is searched, 0 for a new volume
ROW_NUMBER = 21
COLUMNS = 22  # of a row
N_SIDES, N_PLANES, LEVEL = 4, 5, 4  # planes that slope, all planes, the level one's number

FREE, OPPOSITE, ALL_EQUAL = (
    0.0,
    1.0,
    2.0,
)  # which slopes are equal: none, those that face each other, all
SLOPE_LOW, SLOPE_HIGH = (
    0.04,
    2.75,
)  # rise over run, 2 and 70 degrees: flatter is level, steeper a wall


def make_base(height: float) -> np.ndarray:
    """Volumes (1, COLUMNS): the level base at `height`."""
    volumes = np.zeros((1, COLUMNS))
    volumes[0, OFFSET0 : OFFSET0 + N_PLANES] = np.inf
    volumes[0, OFFSET0 + LEVEL] = height
    volumes[0, U0 : V1 + 1] = (-1e4, 1e4, -1e4, 1e4)
    return volumes


@compiled
def read_coefficients(volumes, k):
    """The numbers of volume k's planes: five offsets, four slopes, four slopes across (as scalars they stay in registers)."""
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


@compiled(inline="always")
def read_rectangle(volumes, k):
    """Where volume k begins and ends along u and along v."""
    return volumes[k, 1], volumes[k, 2], volumes[k, 3], volumes[k, 4]


@compiled(inline="always")
def is_fixed(volumes, k):
    """Whether no move may change volume k, because it reaches out of the window that is searched."""
    return volumes[k, SETTLED] == np.inf


@compiled(inline="always")
def is_within(ends, u, v):
    """Whether u, v lies in a rectangle, whose `ends` these are; without branches, so that a processor asks for several at once."""
    return (ends[0] <= u) & (u <= ends[1]) & (ends[2] <= v) & (v <= ends[3])


@compiled(inline="always")
def find_lowest(c, u, v):
    """Height at u, v of the volume whose `read_coefficients` are c, its rectangle not asked."""
    along = min(c[0] + c[5] * u + c[9] * v, c[1] - c[6] * u + c[10] * v)
    across = min(c[2] + c[7] * v + c[11] * u, c[3] - c[8] * v + c[12] * u)
    return min(min(along, across), c[4])


@compiled(inline="always")
def find_lowest_plane(c, u, v):
    """Height at u, v and which of the planes is the lowest there."""
    z0, z1 = c[0] + c[5] * u + c[9] * v, c[1] - c[6] * u + c[10] * v
    z2, z3 = c[2] + c[7] * v + c[11] * u, c[3] - c[8] * v + c[12] * u
    best, plane = c[4], LEVEL
    best, plane = (z0, 0) if z0 < best else (best, plane)
    best, plane = (z1, 1) if z1 < best else (best, plane)
    best, plane = (z2, 2) if z2 < best else (best, plane)
    best, plane = (z3, 3) if z3 < best else (best, plane)
    return best, plane


@compiled(inline="always")
def measure_run(row, k, u, v):
    """What plane k of a volume rises along, by its slope: metres from the axes' origin at u, v."""
    x, y = (u, v) if k < 2 else (v, u)
    return (x if k % 2 == 0 else -x) + row[LEAN0 + k] * y


def measure_runs(row: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """What each of a volume's four inclined planes rises along at u, v (n,): (4, n) metres from the axes' origin."""
    lean = row[LEAN0 : LEAN0 + N_SIDES]
    return np.stack([u + lean[0] * v, -u + lean[1] * v, v + lean[2] * u, -v + lean[3] * u])


@compiled
def compute_roof_heights(volumes, U, V):
    """Height (n,) of the roof and the volume (n,) that shows, at U, V (directions, n)."""
    n = U.shape[1]
    z, top = np.full(n, -np.inf), np.zeros(n, np.int64)
    for k in range(len(volumes)):
        u, v = U[int(volumes[k, DIRECTION])], V[int(volumes[k, DIRECTION])]
        ends = read_rectangle(volumes, k)
        c, replaces = read_coefficients(volumes, k), volumes[k, REPLACES] > 0.0
        for i in range(n):  # no branches: a processor does several points at once
            h = find_lowest(c, u[i], v[i])
            shows = is_within(ends, u[i], v[i]) & (replaces | (h > z[i]))
            z[i], top[i] = h if shows else z[i], k if shows else top[i]
    return z, top


@compiled
def count_slopes(row):
    """How many slopes of its own a volume has under its tie."""
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
    """Units of complexity of one volume, its edges not counted."""
    replacing = REPLACING_COST if row[REPLACES] > 0.0 else 0.0
    leaning = 0.0
    for k in range(N_SIDES):
        leaning += LEANING_COST if row[LEAN0 + k] != 0.0 and row[OFFSET0 + k] < np.inf else 0.0
    return (
        PART_COST + PARAMETER_COST * (count_planes(row) + count_slopes(row)) + replacing + leaning
    )


@compiled
def is_allowed(row, allowed):
    """Whether a volume's shape is among `allowed` (2, 3, 3, 2): has a top, planes along and across, free slopes."""
    along = int(row[OFFSET0] < np.inf) + int(row[OFFSET0 + 1] < np.inf)
    across = int(row[OFFSET0 + 2] < np.inf) + int(row[OFFSET0 + 3] < np.inf)
    return allowed[int(row[OFFSET0 + LEVEL] < np.inf), along, across, int(row[TIE] == FREE)]


@compiled
def equalise_slopes(row):
    """Make the slopes that the tie calls equal so; each plane turns about the middle of its half of the rectangle."""
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
