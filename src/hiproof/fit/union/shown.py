"""Parts that show nowhere go: what lies under others, or shows along the border in slivers only, which a neighbour takes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from ...compiled import compiled
from ...model import Part, Piece
from ...parity import flips
from ...rings import GRID_M
from .plan import Plan, ring_edges
from .regions import area_of, polygons_of, shares_most
from .scene import Scene, nodes

SEAM_M = 1e-5  # between corners that are the same but for the grid they lie on
BORDER_M = 0.1  # a part shows that is the highest somewhere so far inside the outline


def that_show(parts: list[Part], plan: Plan, scene: Scene, widest_m2: float = math.inf) -> list[Part]:
    """Those of the parts that show, over all that the parts cover; what would leave more than `widest_m2` bare stays too."""
    if len(parts) < 2:
        return parts
    u, v = nodes(scene, BORDER_M)
    xy = plan.frame.xy_local(np.column_stack([u[0], v[0]]))
    places = np.bincount(highest_of(parts, xy)[1], minlength=len(parts)).tolist()  # at which each part is the highest
    shown = [part for part, count in zip(parts, places, strict=True) if count]
    hidden = [part for part, count in zip(parts, places, strict=True) if not count]
    for part in hidden:
        taken = shown and with_slivers(shown, part, widest_m2)
        shown = taken or [*shown, part]
    return shown


def highest_of(parts: Sequence[Part], xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Height (n,) of the roof of `parts` at `xy` (n, 2), minus infinity beside it, and the part (n,) it is of, the first of several,
    by its number: `Part.height_at` for many points. On a border that two pieces share it is one of them that holds a point."""
    z, top, (x, y) = np.full(len(xy), -np.inf), np.zeros(len(xy), np.int64), np.ascontiguousarray(xy.T)
    for k, part in enumerate(parts):
        for piece in part.pieces:
            raise_over(z, top, k, x, y, *ring_edges(piece.outline), np.ascontiguousarray(piece.planes))
    return z, top


@compiled
def raise_over(z, top, number, x, y, starts, ends, planes):
    """Raise heights z (n,) at x, y to the lowest of `planes` (k, 3) inside the edges `starts`, `ends` (m, 2), `top` (n,) there
    becomes `number`."""
    inside = np.zeros(len(x), np.bool_)
    for e in range(len(starts)):
        for i in range(len(x)):
            inside[i] ^= flips(starts[e, 0], starts[e, 1], ends[e, 0], ends[e, 1], x[i], y[i])
    for k in np.nonzero(inside)[0]:
        lowest = np.inf
        for a, b, c in planes:
            lowest = min(lowest, a * x[k] + b * y[k] + c)
        if lowest > z[k]:
            z[k], top[k] = lowest, number


def with_slivers(parts: list[Part], hidden: Part, widest_m2: float) -> list[Part] | None:
    """`parts` with what only the `hidden` one covers added to the pieces beside it; None where that cannot be or is too much."""
    covered, own = area_of(parts), area_of([hidden])
    pieces = [list(part.pieces) for part in parts]
    bare = polygons_of(shapely.difference(own, covered, grid_size=GRID_M))
    if sum(polygon.area for polygon in bare) > widest_m2:
        return None
    for sliver in bare:
        near, k, q = shares_most(sliver, [[piece.outline for piece in mine] for mine in pieces])
        if not (pieces and pieces[k]):
            return None  # nothing lies beside the sliver
        outline = pieces[k][q].outline
        seam = polygons_of(shapely.intersection(near, own, grid_size=GRID_M))
        beside = shapely.snap(sliver, outline, SEAM_M)
        merged = polygons_of(shapely.union_all([outline, *seam, beside], grid_size=GRID_M))
        if len(merged) != 1:
            return None
        pieces[k][q] = Piece(merged[0], pieces[k][q].planes)
    return [replace(part, pieces=tuple(mine)) for part, mine in zip(parts, pieces, strict=True)]
