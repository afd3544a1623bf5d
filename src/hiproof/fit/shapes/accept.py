"""Price roofs of parts, and put shapes in place of parts where that is cheaper.

The price is that of prices.py: the misfit of every point, and units for what the roof has.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import shapely

from ...geometry.rings import OVERLAY_GRID_M, subtract
from ...model import Part, Piece
from ...model.heights import find_highest, join_highest, measure_part
from ...primitives.catalogue import ROUND
from ...settings import Settings
from ..direction import outline_rectangle
from ..prices import (
    CORNER_UNITS,
    DEAD_M,
    UNKNOWN_UNITS,
    VOLUME_UNITS,
    compute_unit,
)
from .regions import cut_part, exclude_parts, list_polygons, select_touching, unite_outlines
from .shown import absorb_slivers

UNDER_SHARE = 0.6  # Share of a part's points or area over which a shape lies to replace it.
SAME_CORNER_M = 0.02  # Corners so near to a rim (m) lie on it.
SAME_LEVEL_M = 0.15  # Points and parts so near to a level (m) belong to it.
LEAST_UNITS = VOLUME_UNITS + 2.0 * UNKNOWN_UNITS  # Of a curved shape, with height and slope.
CIRCLE_NUMBERS = 3  # A circle has a middle and a radius.
NO_HEIGHTS = np.zeros(0)  # What is not seen has no heights.


@dataclass(frozen=True)
class PartsRoof:
    """A roof of `parts`, the points (n, 3) inside its `outline`, and what they cost.

    A point further than `tolerance_m` from the roof costs 1. `known` is what another roof knows of
    the parts that both have.
    """

    parts: list[Part]
    points: np.ndarray
    outline: shapely.Polygon
    unit: float
    tolerance_m: float
    known: dict[int, tuple[Part, list]] = field(default_factory=dict)

    @cached_property
    def covered(self) -> dict[int, tuple[Part, list]]:
        """Each part, by its identity, and which points it covers at which heights."""
        x, y = np.ascontiguousarray(self.points[:, :2].T)
        return {
            id(part): self.known.get(id(part)) or (part, measure_part(part, x, y))
            for part in self.parts
        }

    @cached_property
    def highest(self) -> tuple[np.ndarray, np.ndarray]:
        """The roof's height (n,) at each point, and the number of the part that has it."""
        pieces = [self.covered[id(part)][1] for part in self.parts]
        return join_highest(pieces, len(self.points))

    @cached_property
    def misfits(self) -> np.ndarray:
        """What each point costs (n,)."""
        return self.price_gaps(self.points[:, 2] - self.highest[0])

    @cached_property
    def price(self) -> float:
        """What the roof costs, in points."""
        return float(self.misfits.sum()) + self.unit * count_units(self.parts, self.outline)

    @cached_property
    def shares(self) -> tuple[np.ndarray, np.ndarray]:
        """How many points see each part, at least 1, and the units of each."""
        seen = np.bincount(self.highest[1], minlength=len(self.parts))
        units = np.array([count_units([part], self.outline) for part in self.parts])
        return np.maximum(seen, 1), units

    def select_around(self, shape: Part) -> PartsRoof:
        """Return the roof of the parts that a shape may change and of those beside them."""
        parts = select_touching(self.parts, unite_outlines([shape]))
        parts = select_touching(self.parts, unite_outlines(parts))
        if len(parts) in (0, len(self.parts)):
            return self
        x0, y0, x1, y1 = shapely.total_bounds([rim for part in parts for rim in part.outlines])
        points = self.points[np.searchsorted(self.points[:, 0], x0) :]
        points = points[: np.searchsorted(points[:, 0], x1, "right")]
        is_near = (points[:, 1] >= y0) & (points[:, 1] <= y1)
        return replace(self, parts=parts, points=points[is_near], known={})

    def find_near(self, centre: np.ndarray, radius: float) -> np.ndarray:
        """Return the numbers (k,) of the points in a disc."""
        first, last = np.searchsorted(self.points[:, 0], (centre[0] - radius, centre[0] + radius))
        return first + np.flatnonzero(np.hypot(*(self.points[first:last, :2] - centre).T) <= radius)

    def find_seen(self, parts: list[Part]) -> np.ndarray:
        """Return the numbers (k,) of the points at which one of the `parts` is the highest."""
        is_one = np.array([any(one is part for part in parts) for one in self.parts])
        return np.flatnonzero(is_one[self.highest[1]])

    def select_under(self, within: np.ndarray) -> np.ndarray:
        """Return which parts are seen mostly at the points of the numbers `within` (k,)."""
        seen = np.bincount(self.highest[1][within], minlength=len(self.parts))
        return seen >= UNDER_SHARE * self.shares[0]

    def is_worth(self, within: np.ndarray, misfit: float, count: int = 0) -> bool:
        """Return whether a shape with a misfit and `count` numbers can save at points `within`.

        These are given by number (k,).
        """
        under = self.select_under(within)
        units = self.shares[1][under].sum() - LEAST_UNITS - UNKNOWN_UNITS * count
        return bool(self.misfits[within].sum() + self.unit * units > misfit)

    def price_gaps(self, gaps: np.ndarray) -> np.ndarray:
        """Return what distances in height (n,) cost."""
        beyond = (np.abs(gaps) - DEAD_M) / (self.tolerance_m - DEAD_M)
        return np.clip(beyond, 0.0, 1.0) ** 2


def make_parts_roof(
    parts: list[Part], points: np.ndarray, outline: shapely.Polygon, settings: Settings
) -> PartsRoof:
    """Return the roof of parts with the prices of a cloud (n, 3), whose points ascend by x then."""
    points = points[np.argsort(points[:, 0], kind="stable")]
    unit = compute_unit(len(points) / outline.area, settings.compound)
    return PartsRoof(parts, points, outline, unit, settings.compound.tolerance_m)


def count_units(parts: list[Part], outline: shapely.Polygon) -> float:
    """Count the units of parts, of their numbers and of the corners between them.

    A rim that follows a curved shape has no corners of its own.
    """
    numbers = sum(1 + len(part.parameters.keys() - {"width", "length"}) for part in parts)
    rims = [outline, *(rim for part in parts if is_disc(part) for rim in part.outlines)]
    straight = [rim for part in parts if not is_disc(part) for rim in part.outlines]
    places = np.unique(shapely.get_coordinates(straight).round(2) @ (1.0, 1.0j))
    corners = shapely.points(places.real, places.imag)
    for rim in rims:
        corners = corners[~shapely.dwithin(corners, rim.boundary, SAME_CORNER_M)]
    return VOLUME_UNITS * len(parts) + UNKNOWN_UNITS * numbers + CORNER_UNITS * len(corners)


def is_disc(part: Part) -> bool:
    """Return whether a part is a round shape or a drum."""
    size = part.parameters
    return part.type in (*ROUND, "half_cone") or (
        part.type == "flat" and size.get("width") == size.get("length")
    )


def accept(
    roof: PartsRoof, shapes: Iterable[tuple[Part, int]], saved: float = 0.0
) -> tuple[PartsRoof, float]:
    """Return the cheapest roof with one of the shapes, and what it saves (points).

    Each shape comes with how many of its numbers nothing but points gives, beside its heights. One
    that does not save more than `saved` leaves the roof as it is.
    """
    best = roof.parts
    for shape, count in shapes:
        near = roof.select_around(shape)
        for parts in list_roofs(near, shape):
            new = replace(near, parts=parts, known=near.covered)
            gain = near.price - new.price - UNKNOWN_UNITS * roof.unit * count
            if gain > saved:
                best, saved = [*exclude_parts(roof.parts, near.parts), *parts], gain
    return (roof if best is roof.parts else replace(roof, parts=best, known=roof.covered)), saved


def accept_all(
    roof: PartsRoof, list_shapes: Callable[[PartsRoof, list[Part]], Iterable[tuple[Part, int]]]
) -> PartsRoof:
    """Return the roof with listed shapes, each where it saves, the one that saves most first.

    Shapes are listed for parts: at first for all, then for those at what has changed.
    """
    asked = roof.parts
    while asked:
        saving = [(accept(roof, [shape])[1], shape) for shape in list_shapes(roof, asked)]
        before = roof.parts
        for saved, shape in sorted(saving, key=lambda pair: -pair[0]):
            roof = accept(roof, [shape])[0] if saved > 0.0 else roof
        new = exclude_parts(roof.parts, before)
        asked = select_touching(roof.parts, unite_outlines(new)) if new else []
    return roof


def list_roofs(roof: PartsRoof, shape: Part) -> Iterator[list[Part]]:
    """Yield roofs with a shape in place of what lies under it and follows points no better.

    What other parts cover under it is theirs, or is cut off.
    """
    over, _ = find_highest([shape], roof.points[:, :2])
    within, plan = np.flatnonzero(np.isfinite(over)), unite_outlines([shape])
    changes = roof.price_gaps(roof.points[within, 2] - over[within]) - roof.misfits[within]
    costs = np.bincount(roof.highest[1][within], changes, len(roof.parts))
    is_under = roof.select_under(within) & (costs <= roof.unit * roof.shares[1])
    replaced = [part for part, under in zip(roof.parts, is_under, strict=True) if under]
    kept = exclude_parts(roof.parts, replaced)
    for others in (kept, [trimmed for part in kept for trimmed in trim_part(part, plan)]):
        yield from cover_bare_places(roof, others, shape, replaced)
    yield from lay_base(roof, kept, shape, replaced)


def trim_part(part: Part, plan: shapely.Geometry) -> list[Part]:
    """Return a part without what lies in a plan, if most of it lies outside."""
    if not any(shapely.intersects(piece.outline, plan) for piece in part.pieces):
        return [part]
    pieces = tuple(
        Piece(polygon, piece.planes)
        for piece in part.pieces
        for polygon in list_polygons(subtract(piece.outline, plan))
    )
    left = sum(piece.outline.area for piece in pieces)
    return [part if left <= (1.0 - UNDER_SHARE) * part.area else replace(part, pieces=pieces)]


def cover_bare_places(
    roof: PartsRoof, others: list[Part], shape: Part, replaced: list[Part]
) -> Iterator[list[Part]]:
    """Yield roofs that cover what only the `replaced` parts did.

    The shape has the bare places itself, or a neighbour has them, or a level part under the shape.
    """
    under, parts = unite_outlines(replaced), [*others, shape]
    roofed = unite_outlines(select_touching(parts, under))
    bare = subtract(under, roofed)
    places = make_flat(list_polygons(bare), shape)
    if not places.pieces:
        yield parts
        return
    wider = list_polygons(unite_outlines([shape, *replaced]))
    if len(wider) == 1:
        yield [*others, cut_part(shape, wider[0])]
    absorbed = absorb_slivers(parts, places, math.inf)
    if absorbed is not None:
        yield absorbed
    yield [make_flat(list_polygons(under), shape, select_heights(roof, bare)), *parts]


def lay_base(
    roof: PartsRoof, others: list[Part], shape: Part, replaced: list[Part]
) -> Iterator[list[Part]]:
    """Yield a roof with one level part under or around a shape in place of those beside it.

    What the search leaves of a tower's top are strips beside the shape. Where its eave lies lower
    than they do, a moat would surround it. Those at the level of the largest are replaced.
    """
    plan = unite_outlines([shape])
    beside = [
        part
        for part in roof.parts
        if part.type == "flat" and shapely.dwithin(unite_outlines([part]), plan, OVERLAY_GRID_M)
    ]
    if not beside:
        return
    level = max(beside, key=lambda part: part.area).translation[2]
    levels = level, shape.translation[2] if shape.type == "flat" else level
    group = [
        part
        for part in select_touching(others, unite_outlines([*beside, shape]))
        if part.type == "flat" and min(abs(part.translation[2] - z) for z in levels) <= SAME_LEVEL_M
    ]
    area = unite_outlines([*group, *replaced, shape])
    if shape.type == "flat":
        area = subtract(area, plan)
    heights = select_heights(roof, shapely.difference(area, plan))
    base = make_flat(list_polygons(area), shape, heights)
    if base.pieces:
        yield [*exclude_parts(others, group), base, shape]


def select_heights(roof: PartsRoof, area: shapely.Geometry) -> np.ndarray:
    """Return the heights (k,) of the points in an area."""
    return roof.points[shapely.contains_xy(area, *roof.points[:, :2].T), 2]


def make_flat(
    polygons: list[shapely.Polygon], beside: Part, heights: np.ndarray = NO_HEIGHTS
) -> Part:
    """Make a flat part over polygons at the median of `heights` (n,).

    Without any, it lies at the eave of the part `beside`, whose direction it has.
    """
    level = float(np.median(heights)) if len(heights) else float(beside.translation[2])
    pieces = tuple(Piece(polygon, np.array([[0.0, 0.0, level]])) for polygon in polygons)
    if not pieces:
        return Part("flat", pieces)
    hull = shapely.convex_hull(shapely.multipolygons(polygons))
    x, y, kappa, half_width, half_length = outline_rectangle(hull, beside.kappa)
    size = {"width": 2.0 * half_width, "length": 2.0 * half_length}
    return Part("flat", pieces, size, float(kappa), np.array([x, y, level]))
