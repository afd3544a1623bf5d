"""Fit shapes of more planes than a volume has over several parts, where that is cheaper.

A gable above a truncated gable, or between two slopes, may be a gambrel. Shapes that you add to the
catalogue may stand for any few parts that roof a rectangle together. Saw-teeth are in teeth.py.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations

import shapely

from ...errors import FitError
from ...geometry.point_in_polygon import find_inside
from ...model import Part
from ...primitives.catalogue import CATALOGUE, CURVED
from ...primitives.family import COMPONENTS
from ...settings import Settings
from .accept import PartsRoof
from .regions import cut_part, list_polygons, select_touching, unite_outlines
from .teeth import TURN_ALIKE_RAD

MOST_REPLACED_PARTS = 3  # Most parts that one shape of your own replaces.
RECTANGULAR = 0.9  # Share of the smallest rectangle around them that the parts roof together.


def list_composite_names(allowed: tuple[str, ...]) -> list[str]:
    """List types with other planes than a volume has, but for saw-teeth and curved ones."""
    names = [
        name
        for name, shape in CATALOGUE.items()
        if not shape.is_of_family and name not in ("shed", *CURVED)
    ]
    return [name for name in names if not allowed or name in allowed]


def list_composite_shapes(
    roof: PartsRoof, asked: list[Part], names: list[str], settings: Settings
) -> Iterator[tuple[Part, int]]:
    """Yield shapes of the types `names` over parts in `asked` that roof a rectangle together."""
    groups = [(stack, ["gambrel"]) for stack in list_stacks(asked) if "gambrel" in names]
    if own := [name for name in names if name not in COMPONENTS]:
        others = [part for part in asked if part.type not in own]
        for count in range(1, MOST_REPLACED_PARTS + 1):
            groups += [(list(group), own) for group in combinations(others, count)]
    for group, types in groups:
        covered = list_polygons(unite_outlines(group))
        rectangle = shapely.minimum_rotated_rectangle(covered[0])
        if len(covered) == 1 and covered[0].area >= RECTANGULAR * rectangle.area:
            yield from ((part, 0) for part in fit_over(roof, covered[0], types, settings))


def list_stacks(parts: list[Part]) -> Iterator[list[Part]]:
    """Yield gables with what may be the lower slopes of a gambrel: one part or two beside each."""
    for upper in parts:
        if upper.type not in ("gable", "asymmetric_gable"):
            continue
        near = [
            part
            for part in select_touching(parts, unite_outlines([upper]))
            if abs(math.remainder(part.kappa - upper.kappa, math.pi)) < TURN_ALIKE_RAD
        ]
        yield from ([upper, part] for part in near if part.type == "truncated_gable")
        slopes = [part for part in near if part.type == "monopitch"]
        for part, other in combinations(slopes, 2):
            if math.cos(part.kappa - other.kappa) < 0.0:
                yield [upper, part, other]


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
