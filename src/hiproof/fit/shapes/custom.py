"""Fit custom shapes instead of parts, where that is cheaper.

A custom shape is one of the catalogue that is neither of the family nor combined in
`composite`. The package has none, but you may add one.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np
import shapely

from ...errors import FitError
from ...geometry.point_in_polygon import find_inside
from ...model import Part
from ...primitives.catalogue import CATALOGUE, CURVED
from ...primitives.family import COMPONENTS
from ...settings import Settings
from .accept import PartsRoof, accept_all, make_parts_roof
from .regions import cut_part, list_polygons, unite_outlines

MOST_REPLACED_PARTS = 3  # Most parts that one shape replaces.
RECTANGULAR = 0.9  # Share of the smallest rectangle around them that the parts roof together.


def fit_custom_shapes(parts: list[Part], points: np.ndarray, settings: Settings) -> list[Part]:
    """Replace parts by custom shapes where the roof of points (n, 3) costs less."""
    names = list_custom_names(settings.fit.types)
    if not names:
        return parts
    outline = unite_outlines(parts)
    points = points[shapely.intersects_xy(outline, points[:, 0], points[:, 1])]
    roof = make_parts_roof(parts, points, outline, settings)
    return accept_all(
        roof, lambda one, asked: list_custom_shapes(one, asked, names, settings)
    ).parts


def list_custom_names(allowed: tuple[str, ...]) -> list[str]:
    """List types with other planes than a volume has, that nothing else finds."""
    names = [
        name
        for name, shape in CATALOGUE.items()
        if not shape.is_of_family and name not in COMPONENTS and name not in CURVED
    ]
    return [name for name in names if not allowed or name in allowed]


def list_custom_shapes(
    roof: PartsRoof, asked: list[Part], names: list[str], settings: Settings
) -> Iterator[tuple[Part, int]]:
    """Yield custom shapes over parts in `asked` that roof a rectangle together."""
    others = [part for part in asked if part.type not in names]
    for count in range(1, MOST_REPLACED_PARTS + 1):
        for group in combinations(others, count):
            covered = list_polygons(unite_outlines(group))
            rectangles = [shapely.minimum_rotated_rectangle(polygon) for polygon in covered]
            if len(covered) == 1 and covered[0].area >= RECTANGULAR * rectangles[0].area:
                yield from ((part, 0) for part in fit_over(roof, covered[0], names, settings))


def fit_over(
    roof: PartsRoof, outline: shapely.Polygon, names: list[str], settings: Settings
) -> Iterator[Part]:
    """Yield the best part of the types `names` that roofs an outline, none for too few points.

    Its plan is that of its type over the outline's rectangle.
    """
    from ..single import fit_roof  # compiled code that most roofs never need

    choice = {"fit": {"types": names, "objective": "likelihood"}}
    inside = find_inside(outline, *roof.points[:, :2].T)
    try:
        fit = fit_roof(roof.points[inside], outline, settings.replace(choice))
    except FitError:
        return
    variant = CATALOGUE[fit.type].variant(fit.parameters)
    theta = variant.to_theta(fit.parameters, fit.kappa, fit.translation + fit.global_translation)
    yield cut_part(variant.part(theta, fit.sigma), outline)
