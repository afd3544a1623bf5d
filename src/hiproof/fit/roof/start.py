"""Begin a roof, and add volumes to it: rows of rectangles and planes become tables."""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from ..candidates.volumes import (
    ALL_EQUAL,
    COLUMNS,
    DIRECTION,
    LEAN0,
    LEVEL,
    OFFSET0,
    OPPOSITE,
    REPLACES,
    SLOPE0,
    TIE,
    U0,
    V1,
)
from ..layout.whole import Whole
from ..prices import CHORD_UNITS, LOOSE_UNITS, OFF_UNITS_A_METRE
from .ends import find_end
from .moves import LINE_COSINE
from .price import Site, list_points, list_view, price_misfit, widen
from .tables import (
    FAR_M,
    LINE_COUNT,
    N_SIDES,
    NO_UNKNOWN,
    UNKNOWN_COUNT,
    VOLUME_COUNT,
    Tables,
    add_line,
    add_plane,
    add_unknown,
    make_tables,
    measure_middle,
    place_volume,
    read_line,
)

ROOM = 40  # Most volumes of a block, those that are tried included.
# Quantile of the heights at which the base lies: below all roofs but not below a stray point.
BASE_QUANTILE = 0.02
NEAR_WALL_M = 1.0  # A line of the outline so near (m) the middle of a side may be the side.
MOST_SWING = 0.5 * np.sqrt(1.0 - LINE_COSINE**2)  # How far (of its length) an end then moves more.
PARALLEL_COSINE = 1.0 - 1e-12  # Cosine of the angle up to which two lines are parallel.


def start_roof(whole: Whole, site: Site, quantile: float = BASE_QUANTILE) -> Tables:
    """Return a level roof at a quantile of the points of a block, with room for more volumes."""
    roof = make_tables(ROOM, 8 * ROOM, 8 * ROOM)
    z = np.sort(whole.plan.uvz[2])
    base = np.zeros(COLUMNS)
    base[OFFSET0 : OFFSET0 + LEVEL] = np.inf
    base[OFFSET0 + LEVEL] = z[int(quantile * (len(z) - 1))]
    base[U0 : V1 + 1] = whole.box
    add_volume(roof, base, whole.turn, site, False)
    return roof


def join_roofs(roofs: list[Tables]) -> Tables:
    """Return the volumes of all roofs in one, with room for as many more."""
    volumes = sum(int(roof.counts[VOLUME_COUNT]) for roof in roofs)
    size = 2 * volumes + ROOM
    joined = make_tables(size, 8 * size, 8 * size)
    for roof in roofs:
        append_roof(joined, roof)
    return joined


@compiled
def append_roof(roof, other):
    """Add all volumes of another roof."""
    first = roof.counts[UNKNOWN_COUNT]
    for u in range(other.counts[UNKNOWN_COUNT]):
        add_unknown(roof, other.values[u])
    numbers = np.zeros(other.counts[LINE_COUNT], np.int64)
    for l in range(len(numbers)):
        a, b, c, units = other.lines[l]
        numbers[l] = add_line(roof, a, b, c, units)
    for k in range(other.counts[VOLUME_COUNT]):
        new = roof.counts[VOLUME_COUNT]
        roof.counts[VOLUME_COUNT] = new + 1
        roof.replaces[new], roof.n_planes[new] = other.replaces[k], 0
        for s in range(N_SIDES):
            line = other.sides[k, s]
            roof.sides[new, s] = numbers[abs(line) - 1] * (1 if line > 0 else -1)
        for p in range(other.n_planes[k]):
            line, slope = other.plane_lines[k, p], other.slopes[k, p]
            signed = numbers[abs(line) - 1] * (1 if line > 0 else -1)
            height = first + other.heights[k, p]
            add_plane(roof, new, signed, height, first + slope if slope >= 0 else NO_UNKNOWN)
        place_volume(roof, new)


@compiled
def add_volume(roof, volume, turns, site, is_new):
    """Add a volume with the sides of its rectangle, put on walls. Returns its number."""
    row = roof.counts[VOLUME_COUNT]
    roof.counts[VOLUME_COUNT] += 1
    roof.replaces[row], roof.n_planes[row] = int(volume[REPLACES] > 0.0), 0
    c, s = turns[int(volume[DIRECTION])]
    axes = np.array([[c, s], [-s, c]])
    for edge in range(N_SIDES):
        (a, b), place = axes[edge // 2], volume[U0 + edge]
        sign = 1.0 if edge % 2 == 0 else -1.0
        roof.sides[row, edge] = add_line(roof, sign * a, sign * b, -sign * place)
    add_planes(roof, row, volume, axes)
    place_volume(roof, row)
    put_on_walls(roof, row, site, is_new)
    return row


@compiled
def put_on_ends(roof, k, site):
    """Put each side of volume k where points say that it ends, along the line that it has."""
    for s in range(N_SIDES):
        a, b, c = find_end(roof, k, s, site, False)
        if a != 0.0 or b != 0.0:
            roof.sides[k, s] = add_line(roof, a, b, c)
            place_volume(roof, k)


@compiled
def put_on_walls(roof, k, site, is_new):
    """Put each side of volume k on the line of the outline near it that costs least, if any.

    The sides of one that `is_new`, for which nothing sought an end yet, go where points end first.

    A line costs what points then miss, more the further it is off, and more if it is no edge of the
    outline but joins two corners. Along none, a side costs a fixed sum.
    """
    if is_new:
        put_on_ends(roof, k, site)
    for s in range(N_SIDES):
        x, y, length = measure_middle(roof, k, s, site.bounds)
        if length == 0.0:
            continue
        a, b, _ = roof.half_planes[k, s]
        reach = NEAR_WALL_M + MOST_SWING * length
        boxes = widen(roof.boxes[k], reach).reshape(1, 4)
        view, points = list_view(roof, boxes), list_points(site, boxes)
        best = roof.sides[k, s]
        lowest = price_misfit(roof, site, view, points) + site.unit * LOOSE_UNITS
        for line in site.lines:
            cosine, gap = a * line[0] + b * line[1], abs(line[0] * x + line[1] * y + line[2])
            if abs(cosine) < LINE_COSINE or gap > NEAR_WALL_M:
                continue
            count, sign = roof.counts[LINE_COUNT], 1.0 if cosine > 0.0 else -1.0
            roof.sides[k, s] = add_line(roof, sign * line[0], sign * line[1], sign * line[2])
            place_volume(roof, k)
            units = OFF_UNITS_A_METRE * gap + (CHORD_UNITS if line[5] == 0.0 else 0.0)
            price = price_misfit(roof, site, view, points) + site.unit * units
            if price < lowest:
                best, lowest = roof.sides[k, s], price
            else:
                roof.counts[LINE_COUNT] = count
        roof.sides[k, s] = best
        move_eaves(roof, k, best)
        place_volume(roof, k)


@compiled
def move_eaves(roof, k, line):
    """Let the planes of volume k that rise from lines parallel to a side's line rise from it.

    They stay where they are.
    """
    a, b, c = read_line(roof, line)
    for p in range(roof.n_planes[k]):
        d, e, f = read_line(roof, roof.plane_lines[k, p])
        if roof.slopes[k, p] >= 0 and a * d + b * e >= PARALLEL_COSINE:
            roof.plane_lines[k, p] = line
            roof.values[roof.heights[k, p]] += roof.values[roof.slopes[k, p]] * (f - c)


@compiled
def add_planes(roof, row, volume, axes):
    """Add the planes of a volume: each rises from the middle of a side, equal slopes are shared."""
    offsets = np.clip(volume[U0 : V1 + 1], -FAR_M, FAR_M)
    middle = np.array([0.5 * (offsets[0] + offsets[1]), 0.5 * (offsets[2] + offsets[3])])
    slopes = np.full(LEVEL, NO_UNKNOWN)
    for p in range(LEVEL):
        z, slope, lean = volume[OFFSET0 + p], volume[SLOPE0 + p], volume[LEAN0 + p]
        if not np.isfinite(z):
            continue
        along, across = 1.0 if p % 2 == 0 else -1.0, lean
        u, v = (along, across) if p < 2 else (across, along)
        x, y = (offsets[p], middle[1]) if p < 2 else (middle[0], offsets[p])
        length = np.sqrt(1.0 + lean * lean)
        tie = 0 if volume[TIE] == ALL_EQUAL else p // 2 * 2 if volume[TIE] == OPPOSITE else p
        if slopes[tie] == NO_UNKNOWN:
            slopes[tie] = add_unknown(roof, slope * length)
        a = (u * axes[0, 0] + v * axes[1, 0]) / length
        b = (u * axes[0, 1] + v * axes[1, 1]) / length
        line = add_line(roof, a, b, -(u * x + v * y) / length)
        height = add_unknown(roof, z + slope * (u * x + v * y))
        add_plane(roof, row, line, height, slopes[tie])
    if np.isfinite(volume[OFFSET0 + LEVEL]):
        height = add_unknown(roof, volume[OFFSET0 + LEVEL])
        add_plane(roof, row, roof.sides[row, 0], height, NO_UNKNOWN)
