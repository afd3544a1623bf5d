"""Blocks of LoD1: one prism over a building's outline, or several; boxes on roofs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from ..errors import CompositionError
from ..frames import LocalFrame, turn_points
from ..model import ROOF, Installation, Part, Piece, Roof, Solid
from .arrangement import GRID_M
from .lids import Lid, close_lids, draw_base, list_rings, to_grid
from .settle import PLAN_DIGITS
from .solid import compose


def block(outline: shapely.Polygon, z_low: float, z_high: float) -> Solid:
    """Return the prism over `outline` (m, any frame) between two heights.

    Its walls are the outline's edges.

    >>> from hiproof.compose import check_solid
    >>> yard = shapely.box(0, 0, 10, 10).difference(shapely.box(3, 3, 7, 7))
    >>> check_solid(block(yard, 0.0, 5.0)), block(yard, 0.0, 5.0).volume
    ((), 420.0)
    """
    low, high = (round(z / GRID_M) for z in (z_low, z_high))
    plan = list_rings(to_grid(outline))
    roof = Lid([[(*place, high) for place in ring] for ring in plan], ROOF, 0)
    return close_lids([roof, draw_base([roof], low)])


def blocks(
    outlines: Sequence[shapely.Polygon], heights: Sequence[float], z_low: float
) -> Solid | None:
    """Return a solid of blocks of their own `heights` over `outlines`, None if not valid."""
    whole = shapely.union_all(outlines)
    if whole.geom_type != "Polygon":
        return None
    origin = np.array([*np.floor(whole.bounds[:2]), 0.0])
    flat = [
        Part(
            "flat",
            (
                Piece(
                    shapely.transform(outline, lambda xy: xy - origin[:2]),
                    np.array([[0.0, 0.0, height]]),
                ),
            ),
        )
        for outline, height in zip(outlines, heights, strict=True)
    ]
    roof = Roof(
        tuple(flat), shapely.transform(whole, lambda xy: xy - origin[:2]), LocalFrame(origin)
    )
    try:
        return compose(roof, z_low).move(origin)
    except CompositionError:
        return None


def make_box(installation: Installation) -> Solid:
    """Return an installation as a solid, in the roof's frame.

    >>> make_box(Installation("chimney", 1.0, 0.5, 2.0)).volume
    1.0
    """
    half = 0.5 * np.array([installation.length, installation.width])
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    x, y, z = installation.position
    plan = np.round(turn_points(corners, installation.kappa) + [x, y], PLAN_DIGITS)
    low, high = (round(level, PLAN_DIGITS) for level in (z, z + installation.height))
    return block(shapely.Polygon(plan), low, high)
