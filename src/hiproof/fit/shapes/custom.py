"""Fit custom shapes instead of parts, where points suggest it.

A custom shape is one of the catalogue that is neither of the family nor combined in
`composite`. The package has none, but you may add one.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import shapely

from ...errors import FitError
from ...geometry.rings import OVERLAY_GRID_M
from ...model import Part, Piece
from ...primitives.catalogue import CATALOGUE, CURVED
from ...primitives.contract import Primitive
from ...primitives.family import COMPONENTS
from ...settings import Settings
from .regions import exclude_parts, list_polygons, unite_outlines

MOST_REPLACED_PARTS = 3  # Most parts that one shape replaces.
RECTANGULAR = 0.9  # Share of the smallest rectangle around them that the parts roof together.
MOST_DISTANCE_M = 0.25  # Points further off (m) count as this far.
# One shape may lie so much further (m, in the mean) from the points than several parts, and must
# lie so much nearer than one.
FARTHER_M = 0.01


def fit_custom_shapes(parts: list[Part], points: np.ndarray, settings: Settings) -> list[Part]:
    """Replace one or several `parts` by a custom shape that fits the points as well.

    The points are (n, 3).
    """
    for name in list_custom_names(settings.fit.types):
        for count in range(1, min(MOST_REPLACED_PARTS, len(parts)) + 1):
            for group in combinations([part for part in parts if part.type != name], count):
                single = unite_parts(CATALOGUE[name], group, points, settings)
                if single is not None:
                    return fit_custom_shapes(
                        [*exclude_parts(parts, group), single], points, settings
                    )
    return parts


def list_custom_names(allowed: tuple[str, ...]) -> list[str]:
    """List types with other planes than a volume has, that nothing else finds."""
    names = [
        name
        for name, shape in CATALOGUE.items()
        if not shape.is_of_family and name not in COMPONENTS and name not in CURVED
    ]
    return [name for name in names if not allowed or name in allowed]


def unite_parts(
    shape: Primitive, group: tuple[Part, ...], points: np.ndarray, settings: Settings
) -> Part | None:
    """Fit one `shape` over what a `group` of parts roofs, None if it does not fit."""
    covered = list_polygons(unite_outlines(group))
    if (
        len(covered) != 1
        or covered[0].area < RECTANGULAR * shapely.minimum_rotated_rectangle(covered[0]).area
    ):
        return None
    inside_points = points[shapely.intersects_xy(covered[0], points[:, 0], points[:, 1])]
    part = fit_shape(shape, inside_points, covered[0], settings)
    # Fewer parts are worth a little more misfit, another name is not.
    farther = FARTHER_M if len(group) > 1 else -FARTHER_M
    return (
        None
        if part is None
        or measure_misfit([part], inside_points)
        > measure_misfit(list(group), inside_points) + farther
        else part
    )


def fit_shape(
    shape: Primitive, points: np.ndarray, outline: shapely.Polygon, settings: Settings
) -> Part | None:
    """Fit a part of `shape` that roofs `outline`, None if there are too few points."""
    part = fit_types(points, outline, (shape.name,), settings)
    return None if part is None else cut_part(part, outline)


def fit_types(
    points: np.ndarray, outline: shapely.Polygon | None, names: tuple[str, ...], settings: Settings
) -> Part | None:
    """Fit a part of one of the types `names`, None if there are too few points.

    Its plan is that of its type over the rectangle of `outline`, free without one.
    """
    from ..single import fit_roof

    choice = {"fit": {"types": list(names), "objective": "likelihood"}}
    try:
        fit = fit_roof(points, outline, settings.replace(choice))
    except FitError:
        return None
    variant = CATALOGUE[fit.type].variant(fit.parameters)
    theta = variant.to_theta(fit.parameters, fit.kappa, fit.translation + fit.global_translation)
    return variant.part(theta, fit.sigma)


def cut_part(part: Part, outline: shapely.Polygon) -> Part:
    """Return the part over `outline`, or the share of each piece of several."""
    if len(part.outlines) == 1:
        return replace(part, pieces=tuple(Piece(outline, p.planes) for p in part.pieces))
    cut = [
        (
            list_polygons(shapely.intersection(p.outline, outline, grid_size=OVERLAY_GRID_M)),
            p.planes,
        )
        for p in part.pieces
    ]
    pieces = [Piece(polygon, planes) for polygons, planes in cut for polygon in polygons]
    return replace(part, pieces=tuple(pieces))


def measure_misfit(parts: list[Part], points: np.ndarray) -> float:
    """Return the mean distance in height (m) of points (n, 3) from the highest part.

    Distances count up to MOST_DISTANCE_M.
    """
    z = np.max([part.height_at(points[:, :2]) for part in parts], axis=0)
    return float(np.minimum(np.abs(points[:, 2] - z), MOST_DISTANCE_M).mean())
