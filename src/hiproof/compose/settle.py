"""A fitted roof rounded to exactly the numbers that are written.

So its file builds the same bytes again.

Everything is rounded before the solid is composed: lengths and angles to a millionth of a metre or
degree, plans and heights of the ground to the tenth of a millimetre on which solids are composed.
Planes then follow from the rounded parameters.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
import shapely

from ..errors import FitError
from ..geometry.rings import repair_polygons
from ..model import Building, Part, Piece, Quality, Roof
from ..primitives.catalogue import CATALOGUE
from ..primitives.family import compute_planes

DIGITS = 6  # of parameters: micrometres and millionths of a degree
PLAN_DIGITS = 4  # of outlines and the terrain: tenths of a millimetre, as solids are composed


def settled_roof(roof: Roof) -> Roof:
    """Round the roof's outline and parts as written; its origin is on whole millimetres."""
    return replace(
        roof, parts=tuple(map(settled_part, roof.parts)), outline=settled_outline(roof.outline)
    )


def settled_part(part: Part) -> Part:
    """Round a part's parameters, position and rotation as written; its planes follow."""
    parameters = {name: round_number(value) for name, value in part.parameters.items()}
    kappa = math.radians(round_number(math.degrees(part.kappa)))
    translation = np.array([round_number(value) for value in part.translation])
    outlines = settle_outlines(part.outlines)
    try:
        pieces = make_pieces(part.type, parameters, kappa, translation, outlines)
    except (FitError, KeyError):  # a shape of somebody's own, which parameters do not make
        pieces = tuple(
            Piece(polygon, p.planes)
            for p in part.pieces
            for polygon in settle_outlines([p.outline])
        )
    return Part(part.type, pieces, parameters, kappa, translation, settled_sigma(part.sigma))


def make_pieces(
    kind: str,
    parameters: Mapping[str, float],
    kappa: float,
    translation: np.ndarray,
    outlines: list[shapely.Polygon],
) -> tuple[Piece, ...]:
    """Return the pieces of a part over `outlines`.

    They have every plane of its shape, of a saw-tooth the one of the tooth in which they lie. An
    onion has several over each outline. Raises FitError for a type or parameters that make no
    shape.
    """
    if kind == "flat":
        planes = np.array([[0.0, 0.0, translation[2]]])
    else:
        planes = compute_planes(kind, parameters, kappa, translation)
    if kind != "shed":
        return CATALOGUE[kind].variant(parameters).make_pieces(outlines, planes)
    across = np.array([-math.sin(kappa), math.cos(kappa)])
    places = np.array(
        [shapely.point_on_surface(outline).coords[0] for outline in outlines]
    ).reshape(-1, 2)
    share = (places - translation[:2]) @ across / parameters["width"] + 0.5
    teeth = np.clip(np.floor(share * len(planes)), 0, len(planes) - 1).astype(int)
    return tuple(
        Piece(outline, planes[tooth : tooth + 1])
        for outline, tooth in zip(outlines, teeth, strict=True)
    )


def settled_sigma(sigma: Mapping[str, float]) -> dict[str, float]:
    """Round standard deviations as they are written, `kappa` [rad] to millionths of a degree."""
    return {
        name: math.radians(round_number(math.degrees(value)))
        if name == "kappa"
        else round_number(value)
        for name, value in sigma.items()
    }


def round_number(value: float, digits: int = DIGITS) -> float:
    """Round a number; minus zero becomes zero, NaN and infinities stay."""
    return round(float(value), digits) + 0.0


def rounded_outline(polygon: shapely.Polygon) -> shapely.Polygon:
    return shapely.transform(polygon, lambda xy: np.round(xy, PLAN_DIGITS) + 0.0)


def settle_outlines(outlines: Sequence[shapely.Polygon]) -> list[shapely.Polygon]:
    """Round outlines to valid polygons.

    One that would cross itself becomes those of which it is made. One without an area goes, unless
    all are such.
    """
    valid: list[shapely.Polygon] = []
    for outline in outlines:
        polygons = [rounded_outline(outline)]
        if not polygons[0].is_valid:
            on_grid = shapely.set_precision(repair_polygons(outline), 10.0**-PLAN_DIGITS)
            polygons = [rounded_outline(polygon) for polygon in shapely.get_parts(on_grid)]
        valid += [polygon for polygon in polygons if polygon.area > 0.0]
    return valid or [rounded_outline(outline) for outline in outlines]


def settled_outline(outline: shapely.Polygon) -> shapely.Polygon:
    """Round the outline.

    Where that makes it cross itself, it is the largest valid polygon on the same grid. Raises
    shapely's GEOSException for an outline that crosses itself before.
    """
    result = rounded_outline(outline)
    if result.is_valid:
        return result
    on_grid = shapely.get_parts(shapely.set_precision(outline, 10.0**-PLAN_DIGITS))
    return rounded_outline(max(on_grid, key=lambda polygon: polygon.area, default=outline))


def round_building(building: Building) -> Building:
    """Round a building's figures and probabilities as they are written."""
    values: dict[str, Any] = {f.name: getattr(building.quality, f.name) for f in fields(Quality)}
    values |= {name: round_number(value) for name, value in values.items() if name != "points"}
    return replace(
        building,
        quality=Quality(**values),
        objective=round_number(building.objective),
        recognised={name: round_number(value) for name, value in building.recognised.items()},
        types={name: round_number(value) for name, value in building.types.items()},
    )
