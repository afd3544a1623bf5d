"""Bare ground inside a footprint.

It may be a yard that is no hole, a wing pulled down, or the roof of a garage below ground.

Where ground points lie densely and roof points do not, nothing stands. What is cut out are
right-angled pieces along the footprint's main direction: of all rectangles the one that holds most
bare ground for the roof and the unseen places in it (Kadane's maximum sum in two dimensions), its
sides put where the roof points begin, then the next. Tall walls hide a strip of the ground beside
them from a scanner that looks aslant, so a side runs on over places without any points.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from ..geometry.grid import count_cells
from ..geometry.point_in_polygon import find_inside
from .candidates.planes import bound_rows, find_best_rectangle
from .direction import main_direction

NODE_M, MOST_NODES = 0.5, 200
"""Distance (m) between the places that are classified, and places along a side at most: the time
grows with their cube.
"""

BARE_REACH_M = 0.9
"""Distance (m) to ground points within which ground is seen: city runs know one in a
square metre.
"""

NEAREST_ROOF_M, FARTHEST_ROOF_M = 0.35, 1.0
"""Bounds (m) of the distance to roof points within which a place is roof: about the distance
between them.
"""

ROOF_COST, UNSEEN_COST = 2.0, 0.25
"""What a place that is roof, or has no points, takes off one of bare ground: a yard holds no roof,
but unseen strips.
"""

NEEDLESS_M = 0.2
"""Distance (m) within which corners of an outline do not matter where only places far from it are
asked for.
"""

LEAST_AREA_M2, LEAST_WIDTH_M = 8.0, 2.0
"""Bare ground below which nothing is said: footprints lie beside their walls by half a metre, and
lightwells are built over.
"""

LEAST_LOST_M2 = 2.0
"""Bare ground that is cut out where a roof stood before: smaller places are chimneys and edges."""

MOST_ROOF, LEAST_SEEN = 0.12, 0.5
"""Shares of a rectangle's places that may be roof, and that must be bare ground."""

RUN_ON_M = 2.5
"""Distance (m) that a side is moved at most over places without points: a wall 6 m high hides as
much from 23 degrees off.
"""

DENSE, BEYOND_M = 0.4, 1.0
"""Share of the points of a full row with which a roof begins, and how far (m) a cut ends out of the
outline.
"""

MOST_PIECES = 6
"""Rectangles that are looked for; a yard of more corners is cut roughly."""

MOST_CUT_DIRECTIONS = 3
"""Directions that are tried: the footprint's, then those of edges that it does not follow."""

OUTLINE_EDGE_M = 1.5
"""Distance (m) from the outline within which an edge of bare ground is the outline's own."""

THIN_M = 0.6
"""Width (m) of what is left between a cut and the outline below which it is cut off, too: half a
metre is not to be told.
"""

MOST_CUT = 0.75
"""Share of the footprint above which nothing is cut: rather the building is gone, or the footprint
is not its own.
"""


@dataclass(frozen=True)
class BareGround:
    """The `outline` without its bare ground, and the area (m2) cut off.

    The outline is None where what is left is no single building.
    """

    outline: shapely.Polygon | None
    area_m2: float


def find_bare_ground(
    outline: shapely.Polygon,
    roof: np.ndarray,
    ground: np.ndarray,
    was_roof: bool = False,
) -> BareGround | None:
    """Return the bare ground inside `outline`, None where there is little.

    Where it is known that it `was_roof`, less is enough, in any direction, and most of the outline
    may be bare.

    roof: (n, 2 or more) points of roofs, trees and whatever else stands high; ground: (m, 2 or
    more) points of the ground; all in one frame in metres.
    """
    least_m2 = LEAST_LOST_M2 if was_roof else LEAST_AREA_M2
    inner = shapely.buffer(shapely.simplify(outline, NEEDLESS_M), -LEAST_WIDTH_M / 2)
    mask = find_inside(inner, ground[:, 0], ground[:, 1])
    if count_cells(np.floor(ground[mask, :2])) < LEAST_SEEN * least_m2 / 2 or len(roof) == 0:
        return None
    cuts = [lay_pieces(outline, roof, ground, main_direction(outline), least_m2)]
    if cuts[0].remainder is outline and not was_roof:
        return None
    while cuts[-1].left_m2 >= least_m2 / 2 and len(cuts) < MOST_CUT_DIRECTIONS:
        cuts.append(lay_pieces(outline, roof, ground, cuts[-1].edge_angle, least_m2))
    best = min(cuts, key=lambda cut: cut.left_m2)
    if best.remainder is outline:
        return None
    area = outline.area - best.remainder.area
    parts = sorted(shapely.get_parts(best.remainder), key=shapely.area, reverse=True)
    least_left_m2 = LEAST_AREA_M2 if was_roof else (1 - MOST_CUT) * outline.area
    is_one = bool(parts) and parts[0].area > max(0.9 * best.remainder.area, least_left_m2)
    return BareGround(parts[0], outline.area - parts[0].area) if is_one else BareGround(None, area)


@dataclass(frozen=True)
class BareCut:
    """The `remainder` of an outline without pieces along a direction.

    `left_m2` is the bare ground that it still holds, and `edge_angle` the direction of the longest
    edge between roof and bare ground.
    """

    remainder: shapely.Geometry
    left_m2: float
    edge_angle: float


def lay_pieces(
    outline: shapely.Polygon, roof: np.ndarray, ground: np.ndarray, angle: float, least_m2: float
) -> BareCut:
    """Cut pieces of `least_m2` of bare ground along the direction `angle` (rad) from an outline."""
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    scene = ClassifiedPoints.of(
        shapely.transform(outline, lambda xy: xy @ turn), roof[:, :2] @ turn, ground[:, :2] @ turn
    )
    rows, columns = np.nonzero(scene.value == 1.0)
    bare = np.column_stack([scene.x[columns], scene.y[rows]])
    edge_angle = angle + find_longest_edge(bare, scene.node, scene.outline) if len(bare) else angle
    pieces = list(scene.pieces(least_m2))
    if not pieces:
        return BareCut(outline, len(bare) * scene.node**2, edge_angle)
    remainder = subtract_pieces(scene.outline, pieces)
    left = find_inside(remainder, *bare.T).sum() * scene.node**2
    return BareCut(shapely.transform(remainder, lambda xy: xy @ turn.T), float(left), edge_angle)


def find_longest_edge(bare: np.ndarray, node: float, outline: shapely.Polygon) -> float:
    """Return the direction (rad) of the longest straight edge of places (n, 2) in an outline.

    Places are `node` (m) apart, and edges along the outline do not count.
    """
    area = shapely.union_all(shapely.buffer(shapely.points(bare), node, cap_style="square"))
    ring = shapely.simplify(max(shapely.get_parts(area), key=shapely.area).exterior, 2 * node)
    ends = shapely.get_coordinates(ring)
    steps, middles = np.diff(ends, axis=0), (ends[1:] + ends[:-1]) / 2
    is_inner = shapely.distance(outline.exterior, shapely.points(middles)) > OUTLINE_EDGE_M
    x, y = steps[np.argmax(np.hypot(*steps.T) * is_inner)]
    return math.atan2(y, x)


def subtract_pieces(outline: shapely.Polygon, pieces: list[shapely.Polygon]) -> shapely.Geometry:
    """Return the outline less the pieces and less thin rests beside them.

    Rests are thinner than THIN_M.
    """
    remainder = shapely.difference(outline, shapely.union_all(pieces))
    thick = shapely.buffer(remainder, -THIN_M / 2, join_style="mitre")
    thick = shapely.buffer(thick, THIN_M / 2 + 1e-6, join_style="mitre", mitre_limit=3.0)
    # what was thin before is the outline's own, and stays
    thin = shapely.difference(remainder, thick)
    buffer = shapely.buffer(shapely.union_all(pieces), 1e-3)
    members = [part for part in shapely.get_parts(thin) if not shapely.intersects(part, buffer)]
    return shapely.union_all([shapely.intersection(remainder, thick), *members])


@dataclass
class ClassifiedPoints:
    """Places in the footprint's main directions, `node` (m) apart.

    `value` (rows, columns) is 1 for bare ground, negative for roof and unseen places, 0 outside.
    `x` and `y` are their coordinates.
    """

    outline: shapely.Polygon
    roof: np.ndarray
    ground: np.ndarray
    spacing: float
    node: float
    x: np.ndarray
    y: np.ndarray
    value: np.ndarray

    @classmethod
    def of(cls, outline: shapely.Polygon, roof: np.ndarray, ground: np.ndarray) -> ClassifiedPoints:
        """Classify all places over the outline."""
        lower, upper = np.array(outline.bounds).reshape(2, 2)
        node = max(NODE_M, float((upper - lower).max()) / MOST_NODES)
        x, y = (np.arange(lower[k] + node / 2, upper[k], node) for k in (0, 1))
        grid_x, grid_y = np.meshgrid(x, y)
        places = np.column_stack([grid_x.ravel(), grid_y.ravel()])
        inside = find_inside(outline, places[:, 0], places[:, 1])
        value = np.zeros(len(places))
        spacing = float(np.clip(estimate_spacing(roof), NEAREST_ROOF_M, FARTHEST_ROOF_M))
        is_roof = are_near(places[inside], roof, spacing)
        is_seen = are_near(places[inside], ground, BARE_REACH_M)
        value[inside] = np.where(is_roof, -ROOF_COST, np.where(is_seen, 1.0, -UNSEEN_COST))
        return cls(outline, roof, ground, spacing, node, x, y, value.reshape(grid_x.shape))

    def pieces(self, least_m2: float) -> Iterator[shapely.Polygon]:
        """Yield rectangles of at least `least_m2` of bare ground, the largest first."""
        least_width_m = min(LEAST_WIDTH_M, least_m2 / 2)
        reach, column = np.empty(len(self.value) + 1), np.empty(self.value.shape[1])
        for _ in range(MOST_PIECES):
            bound_rows(self.value, reach)
            total, top, bottom, left, right = find_best_rectangle(self.value, 0.0, reach, column)
            block = self.value[top:bottom, left:right]
            inside = block != 0
            if total * self.node**2 < least_m2 * LEAST_SEEN or not inside.any():
                return
            visible, roof = (
                (block == 1.0).sum() / inside.sum(),
                (block == -ROOF_COST).sum() / inside.sum(),
            )
            self.value[top:bottom, left:right] = np.where(inside, -ROOF_COST, 0.0)
            corners = self.x[left], self.y[top], self.x[right - 1], self.y[bottom - 1]
            if visible < LEAST_SEEN or roof > MOST_ROOF:
                continue
            box = np.array(corners) + self.node / 2 * np.array([-1, -1, 1, 1])
            piece = shapely.box(*(self.side(box, k) for k in range(4)))
            part = shapely.intersection(piece, self.outline)
            width = min(np.ptp(shapely.get_coordinates(part), axis=0)) if not part.is_empty else 0.0
            if part.area >= least_m2 and width >= least_width_m:
                yield piece

    def side(self, box: np.ndarray, k: int) -> float:
        """Return the place to which side `k` of `box` belongs.

        `box` is (xmin, ymin, xmax, ymax). The side goes before the roof that begins beside it, out
        of the outline where none does up to its end, else it stays.
        """
        axis, sign = k % 2, -1.0 if k < 2 else 1.0
        lower, upper = box[1 - axis] + 0.25 * self.spacing, box[3 - axis] - 0.25 * self.spacing
        across = self.roof[:, 1 - axis]
        # positive outwards
        along = sign * (self.roof[(across > lower) & (across < upper), axis] - box[k])
        nearby = np.sort(along[(along > -RUN_ON_M / 2) & (along < RUN_ON_M + self.spacing)])
        begins = first_dense(
            nearby, self.spacing, DENSE * (box[3 - axis] - box[1 - axis]) / self.spacing
        )
        to_end = sign * (self.outline.bounds[k] - box[k])
        if begins is not None:
            return float(box[k] + sign * min(begins - 0.5 * self.spacing, to_end + BEYOND_M))
        return float(self.outline.bounds[k] + sign * BEYOND_M if to_end <= RUN_ON_M else box[k])


def first_dense(sorted_along: np.ndarray, spacing: float, largest: float) -> float | None:
    """Return the innermost place from which points lie as densely as a roof's.

    None where they do not.
    """
    largest = max(2, math.ceil(largest))
    if len(sorted_along) < largest:
        return None
    width = sorted_along[largest - 1 :] - sorted_along[: len(sorted_along) - largest + 1]
    dense = np.flatnonzero(width <= spacing)
    return float(sorted_along[dense[0]]) if len(dense) else None


def are_near(places: np.ndarray, points: np.ndarray, distance_m: float) -> np.ndarray:
    """Return whether each of `places` (m, 2) lies nearer than `distance_m` to one of the points."""
    from scipy.spatial import cKDTree  # only where there is ground inside a footprint

    nearest_m, _ = cKDTree(points).query(places, distance_upper_bound=distance_m)
    return nearest_m < distance_m


def estimate_spacing(roof: np.ndarray) -> float:
    """Return the distance (m) between roof points, were they even.

    It follows from the square metres that hold any.
    """
    cells = count_cells(np.floor(roof))
    return math.sqrt(max(cells, 1) / len(roof))
