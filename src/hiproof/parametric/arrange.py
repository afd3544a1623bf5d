"""Parts put otherwise: one cut in two, two made one, a dormer set on a slope, a recess.

Parts are JSON objects here, as in change.py.

Recesses are level parts lower than the parts around them. A roof is its highest part, so a light
well, a roof terrace or a lower corner shows only where the parts around it do not roof it: their
outlines leave it out. Where a recess is moved or resized, they take back its old place and leave
out the new one.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely

from ..data_files import Values
from ..errors import InputError
from ..geometry.rings import intersect, join, repair_polygons, subtract, unite
from ..model import Roof
from ..primitives.cants import keep_cants_in_place
from ..primitives.table import PARAMETER_ROWS
from ..write.parameters import outline_record
from .change import PLAN_SIZES, leave_out, make_polygon, with_sizes
from .record import list_at, number, numbers_by_name, place, polygon

GRID_M = 1e-4  # m; the grid on which solids are composed
FAR_M = 1e4  # m; beyond any building, for a half plane drawn as a rectangle
# m; an ordinary dormer: a window wide, its wall above the slope, its gable
DORMER_WIDTH_M, DORMER_WALL_M, DORMER_RISE_M = 1.8, 1.0, 0.6
# m, least and most; on a flat slope it would reach through the whole roof
DORMER_DEPTH_M = (1.0, 4.0)
LEVEL_SLOPE = 0.05  # a slope that a dormer cannot run into; a block stands there
BLOCK_SIDE_M, BLOCK_HEIGHT_M = 3.0, 2.5  # m; a lift's or a staircase's head


def split_part(part: Values, side: str = "length", share: float = 0.5) -> list[Values]:
    """Cut a part in two across its `side` at a share of it.

    `side` is "length" or "width". Both halves keep type, eave and height, and roof what lies on
    their side of the cut. Raises InputError for a cut outside the part.

    >>> house = {"width": 8.0, "length": 12.0, "height": 3.0}
    >>> ring = [[-6, -4], [6, -4], [6, 4], [-6, 4], [-6, -4]]
    >>> part = {"type": "gable", "parameters": house, "position": [0, 0, 5], "rotation": 0.0,
    ...     "outlines": [[ring]]}
    >>> [(half["parameters"]["length"], half["position"][0]) for half in split_part(part,
    ...     share=0.25)]
    [(3.0, -4.5), (9.0, 1.5)]
    """
    if side not in PLAN_SIZES or not 0.0 < share < 1.0:
        raise InputError(
            f"expected a cut across length or width at a share of it between 0 and 1, got {side}, "
            f"{share}"
        )
    part = leave_out(with_sizes(part), "sigma")
    whole, axis = part["parameters"][side], find_axis(part, side)
    cut = np.array(part["position"][:2]) + (share - 0.5) * whole * axis
    halves = []
    for size, middle, sign in ((share, 0.5 * share - 0.5, -1.0), (1.0 - share, 0.5 * share, 1.0)):
        x, y = np.array(part["position"][:2]) + middle * whole * axis
        moved = (middle * whole, 0.0) if side == "length" else (0.0, middle * whole)
        halves.append(
            {
                **part,
                "parameters": keep_cants_in_place(
                    resize_rectangle(part["parameters"], side, size * whole), *moved
                ),
                "position": [float(x), float(y), part["position"][2]],
                "outlines": cut_outlines(part["outlines"], cut, sign * axis),
            }
        )
    return halves


def merge_parts(item: Values, other: Values) -> Values:
    """Merge two parts as the larger one is, over the rectangle and the outlines of both."""
    main, side = sorted(
        map(with_sizes, (item, other)),
        key=lambda part: sum(make_polygon(outline).area for outline in part["outlines"]),
        reverse=True,
    )
    axes = np.array([find_axis(main, "length"), find_axis(main, "width")])
    corners = np.concatenate([compute_corners(main), compute_corners(side)]) @ axes.T
    lower, upper = corners.min(axis=0), corners.max(axis=0)
    parameters = main["parameters"]
    for name, size in zip(("length", "width"), (upper - lower).tolist(), strict=True):
        parameters = resize_rectangle(parameters, name, size)
    middle = 0.5 * (lower + upper) @ axes
    moved = (middle - main["position"][:2]) @ axes.T
    together = unite([make_polygon(o) for part in (main, side) for o in part["outlines"]], GRID_M)
    return {
        **leave_out(main, "sigma"),
        "parameters": keep_cants_in_place(parameters, *moved.tolist()),
        "position": [*middle.tolist(), main["position"][2]],
        "outlines": list_rings(together),
    }


def add_dormer(roof: Roof, index: int, place: tuple[float, float] | None = None) -> Values:
    """Return a gable dormer on part `index`, its ridge running into the slope.

    Its middle is at `place` (x, y about the roof's origin) or half-way up a slope. Where the part
    is level it is a flat block, turned as the part is.
    """
    part = roof.parts[index]
    down = np.array([math.sin(part.kappa), -math.cos(part.kappa)])
    middle = part.translation[:2] + 0.25 * part.parameters.get("width", 0.0) * down
    x, y = middle if place is None else place
    surroundings = np.array([[x, y], [x + 0.01, y], [x, y + 0.01]])
    z = np.max([piece.height_at(surroundings) for piece in part.pieces], axis=0)
    slope = np.array([z[1] - z[0], z[2] - z[0]]) / 0.01
    steepness = float(np.hypot(*slope))
    if not steepness > LEVEL_SLOPE:
        return {
            "type": "flat",
            "parameters": {"width": BLOCK_SIDE_M, "length": BLOCK_SIDE_M},
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


def find_axis(part: Values, side: str) -> np.ndarray:
    """Return the direction (2,) of a side of the part's rectangle."""
    turn = math.radians(part.get("rotation", 0.0)) + (0.0 if side == "length" else 0.5 * math.pi)
    return np.array([math.cos(turn), math.sin(turn)])


def resize_rectangle(parameters: dict[str, float], side: str, size: float) -> dict[str, float]:
    """Return parameters with another `side`, scaling all that lies within it."""
    grown = {
        name: value * size / parameters[side]
        for name, value in parameters.items()
        if PARAMETER_ROWS.get(name, {}).get("side") == side
    }
    return {**parameters, **grown, side: size}


def compute_corners(part: Values) -> np.ndarray:
    """Return the corners (4, 2) of the part's rectangle."""
    u = 0.5 * part["parameters"]["length"] * find_axis(part, "length")
    v = 0.5 * part["parameters"]["width"] * find_axis(part, "width")
    return np.array(part["position"][:2]) + np.array([-u - v, u - v, u + v, v - u])


def cut_outlines(outlines: list[Any], place: np.ndarray, direction: np.ndarray) -> list[Any]:
    """Keep what lies beyond a line through `place` (2,), along `direction` (2,)."""
    perpendicular = np.array([-direction[1], direction[0]])
    ring = place + FAR_M * np.array(
        [-perpendicular, perpendicular, perpendicular + direction, direction - perpendicular]
    )
    overlap = intersect(
        shapely.union_all([make_polygon(o) for o in outlines]), shapely.Polygon(ring), GRID_M
    )
    rings = list_rings(overlap)
    if not rings:
        raise InputError(
            "expected a cut through what the part roofs, got one beside it; cut elsewhere"
        )
    return rings


def list_rings(geometry: shapely.Geometry) -> list[Any]:
    """Return the polygons of a geometry as rings, the outer first."""
    return [
        outline_record(polygon)
        for polygon in shapely.get_parts(geometry)
        if polygon.geom_type == "Polygon" and not polygon.is_empty
    ]


LEAST_M2 = 0.1  # m2 that two rectangles share; less is a sliver along an edge
CLEAR = 0.02  # of what they share: a part that roofs no more of it leaves it to the other


def with_recess(
    parts: list[Any], roof: Roof, index: int, position: tuple[float, float] | None = None
) -> list[Any]:
    """Return the parts with a recess, turned as part `index` is.

    Its middle is at `position` (x, y about the roof's origin), else in the middle of part `index`.
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


def replace_part(parts: list[Any], index: int, changed: Values) -> list[Any]:
    """Return the parts with `changed` as part `index`; they leave out its place, if the old."""
    old = find_cover(parts[index])
    rectangle = cover_rectangle(changed) if "outlines" not in changed else find_cover(changed)
    neighbours = [
        part if k == index else move_along(part, old, rectangle) for k, part in enumerate(parts)
    ]
    return [*neighbours[:index], changed, *neighbours[index + 1 :]]


def move_along(part: Values, old: shapely.Geometry, new: shapely.Geometry) -> Values:
    """Return the part, leaving out `new` if it left out `old`."""
    if "outlines" not in part or old.equals(new):
        return part
    shared = intersect(cover_rectangle(with_sizes(part)), old, GRID_M)
    if shared.area < LEAST_M2 or find_cover(part).intersection(shared).area > CLEAR * shared.area:
        return part
    whole = join(find_cover(part), shared, GRID_M)
    return leaving_out({**part, "outlines": list_rings(whole)}, new)


def leaving_out(part: Values, area: shapely.Geometry) -> Values:
    """Return the part without `area`; raises InputError where nothing is left of it."""
    if not find_cover(part).intersection(area).area > 0.0:
        return part
    rings = list_rings(subtract(find_cover(part), area, GRID_M))
    if not rings:
        raise InputError(
            "expected a recess smaller than the part it lies in, got one that covers it; delete "
            "the part"
        )
    return {**part, "outlines": rings}


def find_cover(part: Values) -> shapely.Geometry:
    """Return what a part roofs in plan: its outlines, else its rectangle."""
    if part.get("outlines") is None:
        return cover_rectangle(part)
    outlines = [
        repair_polygons(polygon(outline, "an outline")) for outline in list_at(part, "outlines")
    ]
    return unite(outlines, GRID_M)


def cover_rectangle(part: Values) -> shapely.Polygon:
    """Return the rectangle of a part in plan; raises InputError for what are no numbers."""
    numbers_by_name(part.get("parameters") or {}, "the parameters")
    place(part.get("position"), "position")
    number(part.get("rotation", 0.0), "rotation")
    return shapely.Polygon(compute_corners(part))
