"""Judge roofs by points, with one shape in place of several parts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely

from ...geometry.rings import OVERLAY_GRID_M
from ...model import Part, Piece
from ...model.heights import find_highest
from ...primitives.cants import list_cants
from ..direction import outline_rectangle
from .custom import MOST_DISTANCE_M, cut_part
from .regions import list_polygons, unite_outlines
from .shown import absorb_slivers

COMPARED_M = 0.01  # Misfits (m, mean of distances) are compared to this.
PART_NATS = 4.0  # Each part that a shape replaces beyond one is worth so many nats.
# The shape explains a part's points as well if their mean distance grows by no more (m).
AS_WELL_M = 0.02
REPLACED_SHARE = 0.6  # Share of a part's points over which a shape has to lie to replace it.
BARE_M2 = 0.3  # Smaller bare places (m2) go to a neighbour.
NO_HEIGHTS = np.zeros(0)  # What is not seen has no heights.


@dataclass(frozen=True)
class JudgedRoof:
    """A roof of `parts` and the points (n, 3) inside its `outline`."""

    parts: list[Part]
    points: np.ndarray
    outline: shapely.Polygon

    @cached_property
    def highest(self) -> tuple[np.ndarray, np.ndarray]:
        """The roof's height (n,) at each point, and the number of the part that has it."""
        return find_highest(self.parts, self.points[:, :2])

    def measure_distances(self, cap_m: float) -> np.ndarray:
        """Return how far (m) each point lies from the roof (n,), at most `cap_m`."""
        return np.minimum(np.abs(self.points[:, 2] - self.highest[0]), cap_m)


def scale_cap(slope: float) -> float:
    """Return from which distance (m) on points count alike, on a slope."""
    return MOST_DISTANCE_M * math.hypot(1.0, slope)


def measure_slope(shape: Part) -> float:
    """Return the rise of a curved shape over half of its width."""
    return 2.0 * shape.parameters.get("height", 0.0) / shape.parameters["width"]


def replace_parts(
    roof: JudgedRoof, shape: Part, trimmed: JudgedRoof | None = None
) -> tuple[float, JudgedRoof]:
    """Return the roof with `shape` in place of the parts that it explains as well.

    With it comes what that gains (nats), by the points of those parts and of the shape. Parts of
    the `trimmed` roof take the place of the roof's own beside the shape.
    """
    kept_roof = trimmed or roof
    z, top = roof.points[:, 2], kept_roof.highest[1]
    over, _ = find_highest([shape], roof.points[:, :2])
    within = np.isfinite(over)
    cap = scale_cap(measure_slope(shape))
    old_gaps, new_gaps = roof.measure_distances(cap), np.minimum(np.abs(z - over), cap)
    numbers = []
    for k in np.unique(top[within]).tolist():
        own, inside = top == k, (top == k) & within
        if (
            inside.sum() >= REPLACED_SHARE * own.sum()
            and new_gaps[inside].mean() <= old_gaps[inside].mean() + AS_WELL_M
        ):
            numbers.append(k)
    replaced = [kept_roof.parts[k] for k in numbers]
    kept = [part for k, part in enumerate(kept_roof.parts) if k not in numbers]
    judged, options = within | np.isin(top, numbers), []
    if not judged.any():
        return 0.0, roof
    for parts in cover_bare_places(roof, [*kept, shape], replaced):
        new = JudgedRoof(parts, roof.points, roof.outline)
        options.append((measure_gain(roof, new, judged, cap), new))
    return max(options, key=lambda option: option[0])


def measure_gain(roof: JudgedRoof, new: JudgedRoof, judged: np.ndarray, cap_m: float) -> float:
    """Measure how much likelier (nats) a new roof is, by the points `judged` (n,).

    Their distances count up to `cap_m`. Fewer parts are worth something, too.
    """
    old_misfit, new_misfit = (one.measure_distances(cap_m)[judged].mean() for one in (roof, new))
    nats = np.count_nonzero(judged) * math.log(
        (old_misfit + COMPARED_M) / (new_misfit + COMPARED_M)
    )
    return nats + PART_NATS * (count_shapes(roof.parts) - count_shapes(new.parts))


def trim_parts(roof: JudgedRoof, shape: Part) -> JudgedRoof:
    """Return the roof without what its parts cover under a shape.

    Parts that lie under it for the most part stay whole: it may replace them.
    """
    under, parts = unite_outlines([shape]), []
    for part in roof.parts:
        pieces = [
            Piece(polygon, piece.planes)
            for piece in part.pieces
            for polygon in list_polygons(
                shapely.difference(piece.outline, under, grid_size=OVERLAY_GRID_M)
            )
        ]
        left = sum(piece.outline.area for piece in pieces)
        is_under = left <= (1.0 - REPLACED_SHARE) * part.area
        parts.append(part if is_under else replace(part, pieces=tuple(pieces)))
    return JudgedRoof(parts, roof.points, roof.outline)


def count_shapes(parts: list[Part]) -> int:
    """Count parts, and their planes over walls that cut their corners off."""
    return len(parts) + sum(len(list_cants(part.parameters)) for part in parts)


def cover_bare_places(
    roof: JudgedRoof, parts: list[Part], replaced: list[Part]
) -> Iterator[list[Part]]:
    """Yield roofs that cover what only the `replaced` parts did.

    The last of the `parts` is the new shape. It has the bare places itself, or a neighbour has
    them, or a flat part under the shape, if they are not small.
    """
    under = unite_outlines(replaced)
    bare = shapely.difference(under, unite_outlines(parts), grid_size=OVERLAY_GRID_M)
    places = make_flat(list_polygons(bare), parts[-1])
    if not places.pieces:
        yield parts
        return
    *others, shape = parts
    wider = list_polygons(unite_outlines([shape, *replaced]))
    if len(wider) == 1:
        yield [*others, cut_part(shape, wider[0])]
    absorbed = absorb_slivers(parts, places, math.inf)
    if absorbed is not None:
        yield absorbed
    if (absorbed is None and len(wider) > 1) or bare.area > BARE_M2:
        here = roof.points[shapely.contains_xy(bare, *roof.points[:, :2].T), 2]
        yield [make_flat(list_polygons(under), parts[-1], here), *parts]


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
