"""Shapes of the catalogue that are neither of the family nor put together in `larger`: one part or neighbours that are one of them by their points.

None of the shapes that come with the package is such a one; a shape of your own may be.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import shapely

from ...errors import FitError
from ...geometry.rings import OVERLAY_GRID_M
from ...model import Part, Piece
from ...primitives.catalogue import CATALOGUE
from ...primitives.contract import Primitive
from ...primitives.family import COMPONENTS
from ...settings import Settings
from .regions import exclude_parts, list_polygons, unite_outlines

MOST_REPLACED_PARTS = 3  # that one shape may take the place of
RECTANGULAR = 0.9  # share of the smallest rectangle around them that the parts roof together
MOST_DISTANCE_M = 0.25  # points farther off are counted as this far
FARTHER_M = 0.01  # in the mean: one shape may lie so much farther from the points than several, must lie so much nearer than one


def fit_custom_shapes(parts: list[Part], points: np.ndarray, settings: Settings) -> list[Part]:
    """`parts` with one or several replaced by a part of another shape where the `points` (n, 3) say as much for it."""
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
    """Types with other planes than a volume has, for which nothing else is made to find them."""
    names = [
        name
        for name, shape in CATALOGUE.items()
        if not shape.is_of_family and name not in COMPONENTS
    ]
    return [name for name in names if not allowed or name in allowed]


def unite_parts(
    shape: Primitive, group: tuple[Part, ...], points: np.ndarray, settings: Settings
) -> Part | None:
    """The `group` parts as one of `shape` over what they roof, None where they are none."""
    covered = list_polygons(unite_outlines(group))
    if (
        len(covered) != 1
        or covered[0].area < RECTANGULAR * shapely.minimum_rotated_rectangle(covered[0]).area
    ):
        return None
    inside_points = points[shapely.intersects_xy(covered[0], points[:, 0], points[:, 1])]
    part = fit_shape(shape, inside_points, covered[0], settings)
    farther = (
        FARTHER_M if len(group) > 1 else -FARTHER_M
    )  # fewer parts are worth a little, another name is not
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
    """A part of `shape` that roofs `outline` by its points, None where these are too few."""
    from ..single import fit_roof

    try:
        fit = fit_roof(
            points,
            outline,
            settings.replace({"fit": {"types": [shape.name], "objective": "likelihood"}}),
        )
    except FitError:
        return None
    variant = shape.variant(fit.parameters)
    theta = variant.to_theta(fit.parameters, fit.kappa, fit.translation + fit.global_translation)
    part = variant.part(theta, fit.sigma)
    if len(part.pieces) == 1:
        pieces = [Piece(outline, part.pieces[0].planes)]
    else:
        cut = [
            (
                list_polygons(shapely.intersection(p.outline, outline, grid_size=OVERLAY_GRID_M)),
                p.planes,
            )
            for p in part.pieces
        ]
        pieces = [Piece(polygon, planes) for polygons, planes in cut for polygon in polygons]
    return Part(
        shape.name, tuple(pieces), part.parameters, part.kappa, part.translation, part.sigma
    )


def measure_misfit(parts: list[Part], points: np.ndarray) -> float:
    """Mean distance in height (m) of points (n, 3) from the highest of the parts, those far off counted as MOST_DISTANCE_M."""
    z = np.max([part.height_at(points[:, :2]) for part in parts], axis=0)
    return float(np.minimum(np.abs(points[:, 2] - z), MOST_DISTANCE_M).mean())
