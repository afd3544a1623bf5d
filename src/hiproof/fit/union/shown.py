"""Parts that show nowhere go: what lies under others, or shows along the border in slivers only, which a neighbour takes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import shapely

from ...model import Part, Piece
from .plan import Plan
from .regions import GRID_M, polygons_of
from .scene import Scene

BORDER_M = 0.1  # a part shows that is the highest somewhere so far inside the outline


def that_show(parts: list[Part], plan: Plan, scene: Scene, widest_m2: float = math.inf) -> list[Part]:
    """Those of the parts that show, over all that the parts cover; what would leave more than `widest_m2` bare stays too."""
    if len(parts) < 2:
        return parts
    i, j = np.nonzero(scene.depth >= BORDER_M)
    xy = plan.frame.xy_local(np.column_stack([scene.corner_u + i * scene.pitch, scene.corner_v + j * scene.pitch]))
    top = set(np.argmax([heights_of(part, xy) for part in parts], axis=0).tolist())
    shown, hidden = ([part for k, part in enumerate(parts) if (k in top) == seen] for seen in (True, False))
    for part in hidden:
        taken = shown and with_slivers(shown, part, widest_m2)
        shown = taken or [*shown, part]
    return shown


def heights_of(part: Part, xy: np.ndarray) -> np.ndarray:
    """Heights (n,) of a part at local `xy` (n, 2), minus infinity where it is not."""
    z = np.full(len(xy), -np.inf)
    for piece in part.pieces:
        inside = shapely.intersects_xy(piece.outline, xy[:, 0], xy[:, 1])
        z[inside] = np.maximum(z[inside], piece.height_at(xy[inside]))
    return z


def with_slivers(parts: list[Part], hidden: Part, widest_m2: float) -> list[Part] | None:
    """`parts` with what only the `hidden` one covers added to the pieces beside it; None where that cannot be or is too much."""
    covered = shapely.union_all([piece.outline for part in parts for piece in part.pieces], grid_size=GRID_M)
    own = shapely.union_all([piece.outline for piece in hidden.pieces], grid_size=GRID_M)
    pieces = [list(part.pieces) for part in parts]
    bare = polygons_of(shapely.difference(own, covered, grid_size=GRID_M))
    if sum(polygon.area for polygon in bare) > widest_m2:
        return None
    for sliver in bare:
        near = shapely.buffer(sliver, 1e-3, quad_segs=1)
        _, k, q = max(
            (shapely.intersection(near, piece.outline, grid_size=GRID_M).area, k, q)
            for k, mine in enumerate(pieces)
            for q, piece in enumerate(mine)
        )
        grown = shapely.union(pieces[k][q].outline, shapely.intersection(near, own), grid_size=GRID_M)
        merged = polygons_of(shapely.union(grown, sliver, grid_size=GRID_M))
        if len(merged) != 1:
            return None
        pieces[k][q] = Piece(merged[0], pieces[k][q].planes)
    return [replace(part, pieces=tuple(mine)) for part, mine in zip(parts, pieces, strict=True)]
