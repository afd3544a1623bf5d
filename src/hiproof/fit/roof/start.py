"""Begin with the volumes of the search: rows of rectangles and planes become tables."""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from ..prices import CHORD_UNITS, LOOSE_UNITS, OFF_UNITS_A_METRE
from ..union.volumes import (
    ALL_EQUAL,
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
from .draw import draw_in, draw_whole_roof
from .ends import find_end
from .moves import LINE_COSINE
from .price import Site, list_points, list_view, price_misfit, widen
from .tables import (
    FAR_M,
    LINE_COUNT,
    N_SIDES,
    NO_UNKNOWN,
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

ROOM = 2  # Room for so many times the volumes that there are.
NEAR_WALL_M = 1.0  # A line of the outline so near (m) the middle of a side may be the side.
MOST_SWING = 0.5 * np.sqrt(1.0 - LINE_COSINE**2)  # How far (of its length) an end then moves more.
PARALLEL_COSINE = 1.0 - 1e-12  # Cosine of the angle up to which two lines are parallel.


def start_roof(volumes: np.ndarray, turns: np.ndarray, site: Site) -> Tables:
    """Return the tables of the search's volumes (k, COLUMNS) along walls."""
    size = ROOM * len(volumes) + 8
    roof = make_tables(size, 8 * size, 8 * size)
    for volume in volumes:
        add_volume(roof, volume, turns)
    draw_in(roof, draw_whole_roof(roof, site))
    for k in range(len(volumes)):
        put_on_walls(roof, k, site, False)
    return roof


def add_volume(roof: Tables, volume: np.ndarray, turns: np.ndarray) -> int:
    """Add a volume with the sides of its rectangle. Returns its number."""
    row = int(roof.counts[VOLUME_COUNT])
    roof.counts[VOLUME_COUNT] += 1
    roof.replaces[row], roof.n_planes[row] = volume[REPLACES] > 0, 0
    c, s = turns[int(volume[DIRECTION])]
    axes = np.array([[c, s], [-s, c]])
    for edge, place in enumerate(volume[U0 : V1 + 1].tolist()):
        sign = 1.0 if edge % 2 == 0 else -1.0
        roof.sides[row, edge] = add_line(roof, *(sign * axes[edge // 2]), -sign * place)
    add_planes(roof, row, volume, axes)
    place_volume(roof, row)
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


def add_planes(roof: Tables, row: int, volume: np.ndarray, axes: np.ndarray) -> None:
    """Add the planes of a volume: each rises from the middle of a side, equal slopes are shared."""
    offsets = np.clip(volume[U0 : V1 + 1], -FAR_M, FAR_M)
    middle = np.array([0.5 * (offsets[0] + offsets[1]), 0.5 * (offsets[2] + offsets[3])])
    slopes: dict[int, int] = {}
    ties = group_slopes(volume)
    for p in np.flatnonzero(np.isfinite(volume[OFFSET0 : OFFSET0 + LEVEL + 1])).tolist():
        z = volume[OFFSET0 + p]
        if p == LEVEL:
            add_plane(roof, row, roof.sides[row, 0], add_unknown(roof, z), NO_UNKNOWN)
            continue
        slope, lean = volume[SLOPE0 + p], volume[LEAN0 + p]
        rise = np.array([1.0 if p % 2 == 0 else -1.0, lean])
        rise = rise if p < 2 else rise[::-1]
        place = middle.copy()
        place[p // 2] = offsets[p]
        length = float(np.hypot(*rise))
        tie = ties[p]
        if tie not in slopes:
            slopes[tie] = add_unknown(roof, slope * length)
        normal = rise / length
        line = add_line(roof, *(normal @ axes), -float(normal @ place))
        height = add_unknown(roof, z + slope * float(rise @ place))
        add_plane(roof, row, line, height, slopes[tie])


def group_slopes(volume: np.ndarray) -> list[int]:
    """Return which slopes are equal under the volume's tie."""
    if volume[TIE] == ALL_EQUAL:
        return [0, 0, 0, 0]
    return [0, 0, 2, 2] if volume[TIE] == OPPOSITE else [0, 1, 2, 3]
