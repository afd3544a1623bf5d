"""Remove parts that are not visible.

They lie under others, or are visible along the border in slivers only, which a neighbour takes.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import shapely

from ...geometry.rings import intersect, subtract, unite
from ...model import Part, Piece
from ...model.heights import find_highest
from .regions import (
    OVERLAY_GAP_M,
    find_neighbour,
    list_polygons,
    select_touching,
    unite_outlines,
    widen_gap,
)


def keep_visible(parts: list[Part], xy: np.ndarray, widest_m2: float = math.inf) -> list[Part]:
    """Keep the parts that are visible at places (n, 2), and cover with these all that parts cover.

    A part that would leave more than `widest_m2` bare stays, too.
    """
    if len(parts) < 2:
        return parts
    # These are the numbers of places at which each part is the highest.
    places = np.bincount(find_highest(parts, xy)[1], minlength=len(parts)).tolist()
    visible = [part for part, count in zip(parts, places, strict=True) if count]
    hidden = [part for part, count in zip(parts, places, strict=True) if not count]
    for part in hidden:
        extended = visible and absorb_slivers(visible, part, widest_m2)
        visible = extended or [*visible, part]
    return visible


def absorb_slivers(parts: list[Part], hidden: Part, widest_m2: float) -> list[Part] | None:
    """Add what only the `hidden` part covers to the pieces beside it.

    Returns None if that is impossible or too much.
    """
    hidden_area = unite_outlines([hidden])
    covered = unite_outlines(select_touching(parts, hidden_area))
    pieces = [list(part.pieces) for part in parts]
    bare = list_polygons(subtract(hidden_area, covered))
    bare = [polygon for polygon in bare if not shapely.buffer(polygon, -OVERLAY_GAP_M).is_empty]
    if sum(polygon.area for polygon in bare) > widest_m2:
        return None
    for sliver in bare:
        wide_sliver = widen_gap(sliver)
        k, q = find_neighbour(
            wide_sliver, [[piece.outline for piece in part_pieces] for part_pieces in pieces]
        )
        if not (pieces and pieces[k]):
            return None  # nothing lies beside the sliver
        outline = pieces[k][q].outline
        seam = list_polygons(intersect(wide_sliver, hidden_area))
        snapped = shapely.snap(sliver, outline, OVERLAY_GAP_M)
        merged = list_polygons(unite([outline, *seam, snapped]))
        if len(merged) != 1:
            return None
        pieces[k] = [
            Piece(merged[0], piece.planes) if piece.outline == outline else piece
            for piece in pieces[k]
        ]
    return [
        replace(part, pieces=tuple(part_pieces))
        for part, part_pieces in zip(parts, pieces, strict=True)
    ]
