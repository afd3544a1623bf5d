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
from .moves import LINE_COSINE
from .price import Site
from .tables import (
    FAR_M,
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
)

ROOM = 2  # Room for so many times the volumes that there are.
NEAR_WALL_M = 0.4  # A line of the outline so near (m) a new volume's side is that side.


def make_roof(volumes: np.ndarray, sides: list, turns: np.ndarray, with_base: bool) -> Tables:
    """Return the tables of volumes along their `sides`. The base is one `with_base`, or alone."""
    numbers = [k for k in range(len(volumes)) if k > 0 or with_base or len(volumes) == 1]
    size = ROOM * len(numbers) + 8
    roof = make_tables(size, 8 * size, 8 * size)
    for k in numbers:
        add_volume(roof, volumes[k], sides[k], turns)
    return roof


def add_volume(roof: Tables, volume: np.ndarray, sides: list, turns: np.ndarray) -> int:
    """Add a volume along its `sides`. Returns its number."""
    row = int(roof.counts[VOLUME_COUNT])
    roof.counts[VOLUME_COUNT] += 1
    roof.replaces[row], roof.n_planes[row] = volume[REPLACES] > 0, 0
    c, s = turns[int(volume[DIRECTION])]
    axes = np.array([[c, s], [-s, c]])
    for edge, side in enumerate(sides):
        line = np.array([1.0, -side.lean, -side.offset])
        line *= (1.0 if edge % 2 == 0 else -1.0) / np.hypot(1.0, side.lean)
        normal = line[:2] if edge < 2 else line[1::-1]
        roof.sides[row, edge] = add_line(roof, *(normal @ axes), line[2])
    add_planes(roof, row, volume, sides, axes)
    place_volume(roof, row)
    return row


def put_on_walls(roof: Tables, k: int, site: Site) -> None:
    """Put the sides of volume k on lines of the outline that lie near them."""
    for s in range(N_SIDES):
        x, y, length = measure_middle(roof, k, s, site.bounds)
        cosine = site.lines[:, :2] @ roof.half_planes[k, s, :2]
        gap = np.abs(site.lines[:, :3] @ [x, y, 1.0])
        gap[np.abs(cosine) < LINE_COSINE] = np.inf
        m = int(np.argmin(gap)) if len(gap) and length > 0.0 else -1
        if m >= 0 and gap[m] < NEAR_WALL_M:
            sign = 1.0 if cosine[m] > 0.0 else -1.0
            roof.sides[k, s] = add_line(roof, *(sign * site.lines[m, :3]))
    place_volume(roof, k)


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
