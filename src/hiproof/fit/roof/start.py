"""Begin with the volumes of the search: rows of rectangles and planes become tables."""

from __future__ import annotations

import numpy as np

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
)
from .tables import (
    FAR_M,
    NO_UNKNOWN,
    Tables,
    add_line,
    add_plane,
    add_unknown,
    make_tables,
    place_volumes,
)

ROOM = 2  # Room for so many times the volumes that there are.


def make_roof(volumes: np.ndarray, sides: list, turns: np.ndarray, with_base: bool) -> Tables:
    """Return the tables of volumes along their `sides`. The base is one `with_base`, or alone."""
    numbers = [k for k in range(len(volumes)) if k > 0 or with_base or len(volumes) == 1]
    size = ROOM * len(numbers) + 8
    roof = make_tables(size, 8 * size, 8 * size)
    for row, k in enumerate(numbers):
        roof.counts[0] += 1
        roof.replaces[row] = volumes[k, REPLACES] > 0
        c, s = turns[int(volumes[k, DIRECTION])]
        axes = np.array([[c, s], [-s, c]])
        for edge, side in enumerate(sides[k]):
            line = np.array([1.0, -side.lean, -side.offset])
            line *= (1.0 if edge % 2 == 0 else -1.0) / np.hypot(1.0, side.lean)
            normal = line[:2] if edge < 2 else line[1::-1]
            roof.sides[row, edge] = add_line(roof, *(normal @ axes), line[2])
        add_planes(roof, row, volumes[k], sides[k], axes)
    place_volumes(roof)
    return roof


def add_planes(roof: Tables, row: int, volume: np.ndarray, sides: list, axes: np.ndarray) -> None:
    """Add the planes of a volume: each rises from the middle of a side, equal slopes are shared."""
    offsets = np.clip([side.offset for side in sides], -FAR_M, FAR_M)
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
