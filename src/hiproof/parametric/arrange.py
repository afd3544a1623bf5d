"""Parts put otherwise: one cut in two, two made one, a dormer set on a slope.

Parts are JSON objects here, as in change.py.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely

from ..errors import InputError
from ..model import Roof
from ..primitives.cants import cants_left_in_place
from .change import polygon_of, with_sizes

INNER = {
    "length": ("ridge_length", "top_length"),
    "width": ("top_width", "break_width", "ridge_offset"),
}
"""Parameters that grow with a side of the rectangle."""

GRID_M = 1e-4  # m; the grid on which solids are composed
FAR_M = 1e4  # m; beyond any building, for a half plane drawn as a rectangle
# m; an ordinary dormer: a window wide, its wall above the slope, its gable
DORMER_WIDTH_M, DORMER_WALL_M, DORMER_RISE_M = 1.8, 1.0, 0.6
# m, least and most; on a flat slope it would reach through the whole roof
DORMER_DEPTH_M = (1.0, 4.0)
LEVEL = 0.05  # a slope that a dormer cannot run into; a block stands there
BLOCK_M, BLOCK_HEIGHT_M = 3.0, 2.5  # m; a lift's or a staircase's head


def split_part(
    part: dict[str, Any], side: str = "length", share: float = 0.5
) -> list[dict[str, Any]]:
    """The part cut in two across its `side` ("length" or "width") at a share of it: both keep type,
    eave and height, and roof what lies on their side of the cut. Raises InputError for a cut
    outside the part.

    >>> house = {"width": 8.0, "length": 12.0, "height": 3.0}
    >>> ring = [[-6, -4], [6, -4], [6, 4], [-6, 4], [-6, -4]]
    >>> part = {"type": "gable", "parameters": house, "position": [0, 0, 5], "rotation": 0.0,
    ...     "outlines": [[ring]]}
    >>> [(half["parameters"]["length"], half["position"][0]) for half in split_part(part,
    ...     share=0.25)]
    [(3.0, -4.5), (9.0, 1.5)]
    """
    if side not in INNER or not 0.0 < share < 1.0:
        raise InputError(
            f"expected a cut across length or width at a share of it between 0 and 1, got {side}, "
            f"{share}"
        )
    part = {key: value for key, value in with_sizes(part).items() if key != "sigma"}
    whole, axis = part["parameters"][side], axis_of(part, side)
    cut = np.array(part["position"][:2]) + (share - 0.5) * whole * axis
    halves = []
    for size, middle, sign in ((share, 0.5 * share - 0.5, -1.0), (1.0 - share, 0.5 * share, 1.0)):
        x, y = np.array(part["position"][:2]) + middle * whole * axis
        moved = (middle * whole, 0.0) if side == "length" else (0.0, middle * whole)
        halves.append(
            {
                **part,
                "parameters": cants_left_in_place(
                    resized(part["parameters"], side, size * whole), *moved
                ),
                "position": [float(x), float(y), part["position"][2]],
                "outlines": outlines_beyond(part["outlines"], cut, sign * axis),
            }
        )
    return halves


def merged_parts(one: dict[str, Any], other: dict[str, Any]) -> dict[str, Any]:
    """One part in place of two: of the larger's type, direction and heights, over the rectangle
    around both, roofing what both roofed.
    """
    main, side = sorted(map(with_sizes, (one, other)), key=area_of, reverse=True)
    along, across = axis_of(main, "length"), axis_of(main, "width")
    corners = np.concatenate([corners_of(main), corners_of(side)])
    low, high = (np.array([f(corners @ along), f(corners @ across)]) for f in (np.min, np.max))
    x, y = 0.5 * (low + high) @ np.array([along, across])
    parameters = resized(main["parameters"], "length", float(high[0] - low[0]))
    parameters = resized(parameters, "width", float(high[1] - low[1]))
    moved = np.array([x, y]) - main["position"][:2]
    parameters = cants_left_in_place(parameters, float(moved @ along), float(moved @ across))
    together = shapely.union_all(
        [polygon_of(o) for part in (main, side) for o in part["outlines"]], grid_size=GRID_M
    )
    merged = {key: value for key, value in main.items() if key != "sigma"}
    position = [float(x), float(y), main["position"][2]]
    return {
        **merged,
        "parameters": parameters,
        "position": position,
        "outlines": rings_of(together),
    }


def dormer_on(roof: Roof, index: int, place: tuple[float, float] | None = None) -> dict[str, Any]:
    """A gable dormer on part `index`, its middle at `place` (x, y about the roof's origin) or
    half-way up a slope, its ridge running into the slope; where the part is level a flat block,
    turned as the part is.
    """
    part = roof.parts[index]
    x, y = place if place is not None else middle_of_slope(part)
    around = np.array([[x, y], [x + 0.01, y], [x, y + 0.01]])
    z = np.max([piece.height_at(around) for piece in part.pieces], axis=0)
    slope = np.array([z[1] - z[0], z[2] - z[0]]) / 0.01
    steepness = float(np.hypot(*slope))
    if not steepness > LEVEL:
        return {
            "type": "flat",
            "parameters": {"width": BLOCK_M, "length": BLOCK_M},
            "position": [float(x), float(y), float(z[0]) + BLOCK_HEIGHT_M],
            "rotation": math.degrees(part.kappa),
        }
    depth = float(np.clip((DORMER_WALL_M + DORMER_RISE_M) / steepness, *DORMER_DEPTH_M))
    eave = float(z[0]) - 0.5 * depth * steepness + DORMER_WALL_M
    return {
        "type": "gable",
        "parameters": {"width": DORMER_WIDTH_M, "length": depth, "height": DORMER_RISE_M},
        "position": [float(x), float(y), eave],
        "rotation": math.degrees(math.atan2(-slope[1], -slope[0])),
    }


def middle_of_slope(part: Any) -> tuple[float, float]:
    """A place half-way between the ridge and the front eave."""
    width = part.parameters.get("width", 0.0)
    x, y = part.translation[:2] - 0.25 * width * np.array(
        [-math.sin(part.kappa), math.cos(part.kappa)]
    )
    return float(x), float(y)


def axis_of(part: dict[str, Any], side: str) -> np.ndarray:
    """Direction (2,) of a side of the part's rectangle."""
    turn = math.radians(part.get("rotation", 0.0)) + (0.0 if side == "length" else 0.5 * math.pi)
    return np.array([math.cos(turn), math.sin(turn)])


def resized(parameters: dict[str, float], side: str, size: float) -> dict[str, float]:
    """Parameters whose rectangle has another `side`, what lies within it grown alike."""
    grown = {
        name: parameters[name] * size / parameters[side]
        for name in INNER[side]
        if name in parameters
    }
    return {**parameters, **grown, side: size}


def corners_of(part: dict[str, Any]) -> np.ndarray:
    """Corners (4, 2) of the part's rectangle."""
    u = 0.5 * part["parameters"]["length"] * axis_of(part, "length")
    v = 0.5 * part["parameters"]["width"] * axis_of(part, "width")
    return np.array(part["position"][:2]) + np.array([-u - v, u - v, u + v, v - u])


def area_of(part: dict[str, Any]) -> float:
    return sum(polygon_of(outline).area for outline in part["outlines"])


def outlines_beyond(outlines: list, place: np.ndarray, direction: np.ndarray) -> list:
    """What of the outlines lies beyond a line through `place` (2,), seen along `direction` (2,)."""
    aside = np.array([-direction[1], direction[0]])
    ring = place + FAR_M * np.array([-aside, aside, aside + direction, direction - aside])
    kept = shapely.intersection(
        shapely.union_all([polygon_of(o) for o in outlines]),
        shapely.Polygon(ring),
        grid_size=GRID_M,
    )
    found = rings_of(kept)
    if not found:
        raise InputError(
            "expected a cut through what the part roofs, got one beside it; cut elsewhere"
        )
    return found


def rings_of(geometry: shapely.Geometry) -> list:
    """The polygons of a geometry as rings, the outer first."""
    return [
        [shapely.get_coordinates(ring).tolist() for ring in (polygon.exterior, *polygon.interiors)]
        for polygon in shapely.get_parts(geometry)
        if polygon.geom_type == "Polygon" and not polygon.is_empty
    ]
