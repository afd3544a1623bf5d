"""The state of a roof: four small tables that refer to each other by number.

- A **line** (a, b, c) with a x + b y + c in metres, positive on its left. A volume ends at lines,
  and planes rise from them. Signed numbers say which side is meant: line k is k + 1, its other side
  is -(k + 1).
- An **unknown** is a height or a slope. Planes with one slope share its number.
- A **plane** is z = height + slope d, with d the distance from its line. A level one has no slope.
- A **volume** has four sides, at most VOLUME_PLANES planes, and joins others or replaces them. Its
  roof is the lowest of its planes, the whole roof the highest of the volumes over a place. A volume
  that replaces hides all that came before it.

What is equal is shared, so it stays equal and is paid for once. Coordinates are those of the plan.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ...compiled import compiled

VOLUME_PLANES = 8  # Most planes of a volume: four sides, a top and three over cut corners.
N_SIDES = 4  # Sides of a volume: the first two face each other, and the last two.
FAR_M = 1e4  # Distance (m) of a side that other volumes or the outline hide.
NO_UNKNOWN = -1  # A level plane's slope, and what a volume does not have.
VOLUME_COUNT, LINE_COUNT, UNKNOWN_COUNT = 0, 1, 2  # Places in `Tables.counts`.
ONE_PLANE = 1e-4  # Planes whose coefficients differ less (m, rise over run) are one.
PARALLEL_SINE = 1e-9  # Sine of the angle below which two lines do not cross.

Tables = namedtuple(
    "Tables",
    "counts lines values sides n_planes plane_lines heights slopes replaces half_planes planes "
    "boxes",
)
"""A roof, as arrays with room for more.

- counts (3,): volumes, lines and unknowns in use.
- lines (l, 4): a, b, c, and what the line costs (units). values (u,).
- sides (v, 4): signed lines. n_planes (v,): 0 for a volume that was left out.
- plane_lines, heights, slopes (v, VOLUME_PLANES): a signed line and unknowns.
- replaces (v,).

The rest follows from these: half_planes (v, 4, 3), planes (v, VOLUME_PLANES, 3) and boxes (v, 4),
which are the least and greatest x and y of each volume's plan.
"""


def make_tables(volumes: int, lines: int, unknowns: int) -> Tables:
    """Return empty tables with room for so many rows."""
    return Tables(
        np.zeros(3, np.int64),
        np.zeros((lines, 4)),
        np.zeros(unknowns),
        np.zeros((volumes, N_SIDES), np.int64),
        np.zeros(volumes, np.int64),
        np.zeros((volumes, VOLUME_PLANES), np.int64),
        np.full((volumes, VOLUME_PLANES), NO_UNKNOWN),
        np.full((volumes, VOLUME_PLANES), NO_UNKNOWN),
        np.zeros(volumes, np.int64),
        np.zeros((volumes, N_SIDES, 3)),
        np.zeros((volumes, VOLUME_PLANES, 3)),
        np.zeros((volumes, 4)),
    )


def make_tables_like(roof: Tables) -> Tables:
    """Return empty tables with as much room as those of a roof."""
    return make_tables(len(roof.sides), len(roof.lines), len(roof.values))


@compiled
def copy_tables(source, target):
    """Copy all rows in use."""
    v, l, u = source.counts[VOLUME_COUNT], source.counts[LINE_COUNT], source.counts[UNKNOWN_COUNT]
    target.counts[:] = source.counts
    target.lines[:l] = source.lines[:l]
    target.values[:u] = source.values[:u]
    target.sides[:v] = source.sides[:v]
    target.n_planes[:v] = source.n_planes[:v]
    target.plane_lines[:v] = source.plane_lines[:v]
    target.heights[:v] = source.heights[:v]
    target.slopes[:v] = source.slopes[:v]
    target.replaces[:v] = source.replaces[:v]
    target.half_planes[:v] = source.half_planes[:v]
    target.planes[:v] = source.planes[:v]
    target.boxes[:v] = source.boxes[:v]


@compiled
def has_room(roof):
    """Return whether a move may add a volume with all its lines and unknowns."""
    return (
        roof.counts[VOLUME_COUNT] < len(roof.sides)
        and roof.counts[LINE_COUNT] + N_SIDES < len(roof.lines)
        and roof.counts[UNKNOWN_COUNT] + 2 * VOLUME_PLANES < len(roof.values)
    )


@compiled
def read_line(roof, signed):
    """Return a, b, c of a signed line."""
    k = abs(signed) - 1
    sign = 1.0 if signed > 0 else -1.0
    return sign * roof.lines[k, 0], sign * roof.lines[k, 1], sign * roof.lines[k, 2]


@compiled
def add_line(roof, a, b, c, units=0.0):
    """Add a line that costs so many units, or find it. Returns its signed number."""
    count = roof.counts[LINE_COUNT]
    for k in range(count):
        for sign in (1, -1):
            if (
                abs(roof.lines[k, 0] - sign * a) < 1e-6
                and abs(roof.lines[k, 1] - sign * b) < 1e-6
                and abs(roof.lines[k, 2] - sign * c) < 1e-4
            ):
                return sign * (k + 1)
    roof.lines[count, 0], roof.lines[count, 1], roof.lines[count, 2] = a, b, c
    roof.lines[count, 3] = units
    roof.counts[LINE_COUNT] = count + 1
    return count + 1


@compiled
def add_unknown(roof, value):
    """Add an unknown, and return its number."""
    count = roof.counts[UNKNOWN_COUNT]
    roof.values[count] = value
    roof.counts[UNKNOWN_COUNT] = count + 1
    return count


@compiled
def add_plane(roof, k, line, height, slope):
    """Give volume k one more plane, if it has room."""
    p = roof.n_planes[k]
    if p < VOLUME_PLANES:
        roof.plane_lines[k, p], roof.heights[k, p], roof.slopes[k, p] = line, height, slope
        roof.n_planes[k] = p + 1


@compiled
def drop_plane(roof, k, p):
    """Take plane p from volume k."""
    for q in range(p, roof.n_planes[k] - 1):
        roof.plane_lines[k, q] = roof.plane_lines[k, q + 1]
        roof.heights[k, q] = roof.heights[k, q + 1]
        roof.slopes[k, q] = roof.slopes[k, q + 1]
    roof.n_planes[k] -= 1


@compiled
def cross_lines(roof, first, second):
    """Return x, y where two signed lines cross; far away if they do not."""
    a, b, c = read_line(roof, first)
    d, e, f = read_line(roof, second)
    det = a * e - b * d
    if abs(det) < PARALLEL_SINE:
        return np.inf, np.inf
    return (b * f - e * c) / det, (d * c - a * f) / det


@compiled
def place_planes(roof, k):
    """Compute the planes of volume k from its unknowns."""
    for p in range(roof.n_planes[k]):
        slope = roof.slopes[k, p]
        row = roof.planes[k, p]
        row[2] = roof.values[roof.heights[k, p]]
        if slope < 0:
            row[0], row[1] = 0.0, 0.0
        else:
            line = roof.plane_lines[k, p]
            l, s = abs(line) - 1, roof.values[slope] if line > 0 else -roof.values[slope]
            row[0], row[1] = s * roof.lines[l, 0], s * roof.lines[l, 1]
            row[2] += s * roof.lines[l, 2]


@compiled
def find_lowest_plane(roof, k, x, y):
    """Return the height of volume k at a place, whatever its sides, and the plane that has it."""
    lowest, plane = np.inf, -1
    for p in range(roof.n_planes[k]):
        z = roof.planes[k, p, 0] * x + roof.planes[k, p, 1] * y + roof.planes[k, p, 2]
        if z < lowest:
            lowest, plane = z, p
    return lowest, plane


@compiled
def place_volume(roof, k):
    """Compute the planes, the half planes and the box of volume k from the tables."""
    for s in range(N_SIDES):
        a, b, c = read_line(roof, roof.sides[k, s])
        roof.half_planes[k, s, 0], roof.half_planes[k, s, 1], roof.half_planes[k, s, 2] = a, b, c
    place_planes(roof, k)
    x0, x1, y0, y1 = FAR_M, -FAR_M, FAR_M, -FAR_M
    for s in range(2):
        for t in range(2, N_SIDES):
            x, y = cross_lines(roof, roof.sides[k, s], roof.sides[k, t])
            if not np.isfinite(x):
                x0, x1, y0, y1 = -FAR_M, FAR_M, -FAR_M, FAR_M
            else:
                x0, x1, y0, y1 = min(x0, x), max(x1, x), min(y0, y), max(y1, y)
    roof.boxes[k, 0], roof.boxes[k, 1], roof.boxes[k, 2], roof.boxes[k, 3] = x0, x1, y0, y1


@compiled
def measure_middle(roof, k, s, box):
    """Return x, y of the middle of side s of volume k within a box, and its length."""
    t = 2 if s < 2 else 0
    x0, y0 = cross_lines(roof, roof.sides[k, s], roof.sides[k, t])
    x1, y1 = cross_lines(roof, roof.sides[k, s], roof.sides[k, t + 1])
    if not (np.isfinite(x0) and np.isfinite(x1)):
        return 0.0, 0.0, 0.0
    dx, dy, low, high = x1 - x0, y1 - y0, 0.0, 1.0
    if abs(dx) > PARALLEL_SINE:
        first, last = (box[0] - x0) / dx, (box[1] - x0) / dx
        low, high = max(low, min(first, last)), min(high, max(first, last))
    if abs(dy) > PARALLEL_SINE:
        first, last = (box[2] - y0) / dy, (box[3] - y0) / dy
        low, high = max(low, min(first, last)), min(high, max(first, last))
    if high <= low:
        return 0.0, 0.0, 0.0
    middle = 0.5 * (low + high)
    return x0 + middle * dx, y0 + middle * dy, (high - low) * np.sqrt(dx * dx + dy * dy)


@compiled
def is_double(roof, k, p):
    """Return whether plane p of volume k is another of its planes, too."""
    for q in range(roof.n_planes[k]):
        is_same = q != p and roof.plane_lines[k, q] == roof.plane_lines[k, p]
        is_same &= roof.heights[k, q] == roof.heights[k, p]
        if is_same and roof.slopes[k, q] == roof.slopes[k, p]:
            return True
    return False


@compiled
def copy_volume(roof, k, place):
    """Let the volume at a place be as volume k, on the same lines and of the same unknowns."""
    roof.sides[place], roof.n_planes[place] = roof.sides[k], roof.n_planes[k]
    roof.plane_lines[place], roof.heights[place] = roof.plane_lines[k], roof.heights[k]
    roof.slopes[place], roof.replaces[place] = roof.slopes[k], roof.replaces[k]


@compiled
def pack(roof):
    """Remove what was left out or is there twice, and lines and unknowns that nothing uses."""
    place = 0
    for k in range(roof.counts[VOLUME_COUNT]):
        for p in range(roof.n_planes[k] - 1, 0, -1):
            if is_double(roof, k, p):
                drop_plane(roof, k, p)
        if roof.n_planes[k] == 0:
            continue
        copy_volume(roof, k, place)
        place += 1
    roof.counts[VOLUME_COUNT] = place
    new_line, new_unknown = np.full(len(roof.lines), -1), np.full(len(roof.values), -1)
    for k in range(place):
        for s in range(N_SIDES):
            new_line[abs(roof.sides[k, s]) - 1] = 0
        for p in range(roof.n_planes[k]):
            new_line[abs(roof.plane_lines[k, p]) - 1] = 0
            new_unknown[roof.heights[k, p]] = 0
            if roof.slopes[k, p] >= 0:
                new_unknown[roof.slopes[k, p]] = 0
    count = 0
    for l in range(roof.counts[LINE_COUNT]):
        if new_line[l] == 0:
            roof.lines[count], new_line[l] = roof.lines[l], count
            count += 1
    roof.counts[LINE_COUNT], count = count, 0
    for u in range(roof.counts[UNKNOWN_COUNT]):
        if new_unknown[u] == 0:
            roof.values[count], new_unknown[u] = roof.values[u], count
            count += 1
    roof.counts[UNKNOWN_COUNT] = count
    for k in range(place):
        for s in range(N_SIDES):
            sign = 1 if roof.sides[k, s] > 0 else -1
            roof.sides[k, s] = sign * (new_line[abs(roof.sides[k, s]) - 1] + 1)
        for p in range(roof.n_planes[k]):
            sign = 1 if roof.plane_lines[k, p] > 0 else -1
            roof.plane_lines[k, p] = sign * (new_line[abs(roof.plane_lines[k, p]) - 1] + 1)
            roof.heights[k, p] = new_unknown[roof.heights[k, p]]
            if roof.slopes[k, p] >= 0:
                roof.slopes[k, p] = new_unknown[roof.slopes[k, p]]
        place_volume(roof, k)
