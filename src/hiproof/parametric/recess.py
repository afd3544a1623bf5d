"""Recesses: level parts lower than the parts around them.

Parts are JSON objects here, as in change.py.

A roof is its highest part, so a light well, a roof terrace or a lower corner shows only where the
parts around it do not roof it: their outlines leave it out. Where a recess is moved or resized,
they take back its old place and leave out the new one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely

from ..errors import InputError
from ..geometry.rings import repair_polygons, with_area
from ..model import Roof
from .arrange import BLOCK_HEIGHT_M, BLOCK_SIDE_M, GRID_M, compute_corners, list_rings
from .change import with_sizes
from .record import list_at, number, numbers_by_name, place, polygon

LEAST_M2 = 0.1  # m2 that two rectangles share; less is a sliver along an edge
CLEAR = 0.02  # of what they share: a part that roofs no more of it leaves it to the other


def with_recess(
    parts: list[Any], roof: Roof, index: int, position: tuple[float, float] | None = None
) -> list[Any]:
    """Return the parts with a recess, turned as part `index` is.

    It lies at `position` (x, y about the roof's origin), else in the middle of part `index`.

    Raises InputError for a part of which nothing is left.
    """
    surroundings = with_sizes(parts[index])
    x, y = surroundings["position"][:2] if position is None else position
    height = max(
        float(piece.height_at(np.array([[x, y]]))[0]) for piece in roof.parts[index].pieces
    )
    recess = {
        "type": "flat",
        "parameters": {"width": BLOCK_SIDE_M, "length": BLOCK_SIDE_M},
        "position": [float(x), float(y), height - BLOCK_HEIGHT_M],
        "rotation": surroundings.get("rotation", 0.0),
    }
    return [*(leaving_out(part, cover_rectangle(recess)) for part in parts), recess]


def replace_part(parts: list[Any], index: int, changed: dict[str, Any]) -> list[Any]:
    """Return the parts with `changed` in place of part `index`.

    Parts that left out its old place leave out its new one instead.
    """
    old = roofed_by(parts[index])
    rectangle = cover_rectangle(changed) if "outlines" not in changed else roofed_by(changed)
    neighbours = [
        part if k == index else moved_along(part, old, rectangle) for k, part in enumerate(parts)
    ]
    return [*neighbours[:index], changed, *neighbours[index + 1 :]]


def moved_along(
    part: dict[str, Any], old: shapely.Geometry, new: shapely.Geometry
) -> dict[str, Any]:
    """Return the part, leaving out `new` if it left out `old`."""
    if "outlines" not in part or old.equals(new):
        return part
    shared = with_area(
        shapely.intersection(cover_rectangle(with_sizes(part)), old, grid_size=GRID_M)
    )
    if shared.area < LEAST_M2 or roofed_by(part).intersection(shared).area > CLEAR * shared.area:
        return part
    whole = with_area(shapely.union(roofed_by(part), shared, grid_size=GRID_M))
    return leaving_out({**part, "outlines": list_rings(whole)}, new)


def leaving_out(part: dict[str, Any], area: shapely.Geometry) -> dict[str, Any]:
    """Return the part without what it roofs of `area`.

    Raises InputError where nothing is left of it.
    """
    if not roofed_by(part).intersection(area).area > 0.0:
        return part
    rings = list_rings(shapely.difference(roofed_by(part), area, grid_size=GRID_M))
    if not rings:
        raise InputError(
            "expected a recess smaller than the part it lies in, got one that covers it; delete "
            "the part"
        )
    return {**part, "outlines": rings}


def roofed_by(part: dict[str, Any]) -> shapely.Geometry:
    """Return what a part roofs in plan: its outlines, else its rectangle."""
    if part.get("outlines") is None:
        return cover_rectangle(part)
    outlines = [
        repair_polygons(polygon(outline, "an outline")) for outline in list_at(part, "outlines")
    ]
    return with_area(shapely.union_all(outlines, grid_size=GRID_M))


def cover_rectangle(part: dict[str, Any]) -> shapely.Polygon:
    """Return the rectangle of a part in plan.

    Raises InputError for values that are no numbers.
    """
    numbers_by_name(part.get("parameters") or {}, "the parameters")
    place(part.get("position"), "position")
    number(part.get("rotation", 0.0), "rotation")
    return shapely.Polygon(compute_corners(part))
