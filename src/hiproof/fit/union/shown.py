"""Parts that show nowhere go: what lies under others, or shows along the border in slivers only, which a neighbour takes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import shapely

from ...geometry.rings import OVERLAY_GRID_M
from ...model import Part, Piece
from ...model.heights import find_highest
from .plan import Plan
from .regions import area_of, place_beside, polygons_of, widened
from .scene import BORDER_M, Scene, nodes

SEAM_M = 1e-5  # between corners that are the same but for the grid they lie on


def that_show(parts: list[Part], plan: Plan, scene: Scene, widest_m2: float = math.inf) -> list[Part]:
    """Those of the parts that show, over all that the parts cover; what would leave more than `widest_m2` bare stays too."""
    if len(parts) < 2:
        return parts
    u, v = nodes(scene, BORDER_M)
    xy = plan.frame.xy_local(np.column_stack([u[0], v[0]]))
    places = np.bincount(find_highest(parts, xy)[1], minlength=len(parts)).tolist()  # at which each part is the highest
    shown = [part for part, count in zip(parts, places, strict=True) if count]
    hidden = [part for part, count in zip(parts, places, strict=True) if not count]
    for part in hidden:
        taken = shown and with_slivers(shown, part, widest_m2)
        shown = taken or [*shown, part]
    return shown


def with_slivers(parts: list[Part], hidden: Part, widest_m2: float) -> list[Part] | None:
    """`parts` with what only the `hidden` one covers added to the pieces beside it; None where that cannot be or is too much."""
    covered, own = area_of(parts), area_of([hidden])
    pieces = [list(part.pieces) for part in parts]
    bare = polygons_of(shapely.difference(own, covered, grid_size=OVERLAY_GRID_M))
    bare = [polygon for polygon in bare if not shapely.buffer(polygon, -SEAM_M).is_empty]
    if sum(polygon.area for polygon in bare) > widest_m2:
        return None
    for sliver in bare:
        near = widened(sliver)
        k, q = place_beside(near, [[piece.outline for piece in mine] for mine in pieces])
        if not (pieces and pieces[k]):
            return None  # nothing lies beside the sliver
        outline = pieces[k][q].outline
        seam = polygons_of(shapely.intersection(near, own, grid_size=OVERLAY_GRID_M))
        beside = shapely.snap(sliver, outline, SEAM_M)
        merged = polygons_of(shapely.union_all([outline, *seam, beside], grid_size=OVERLAY_GRID_M))
        if len(merged) != 1:
            return None
        pieces[k][q] = Piece(merged[0], pieces[k][q].planes)
    return [replace(part, pieces=tuple(mine)) for part, mine in zip(parts, pieces, strict=True)]
