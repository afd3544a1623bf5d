"""The shift of a footprint beside its roof, and its uncertainty.

First the footprint is slid to where it holds most points: its area is the same everywhere, so that
is where an outline of its shape is most likely. Then each side that has free ground before it is
put where the points across it put it (outline/settle.py), and all together tell the shift, and how
far the roof reaches beyond the footprint on every side. A side that a neighbour's roof goes on
beyond tells nothing, so a house in a row is not moved along the row. A roof much larger than its
footprint leaves no free ground before its walls: where the sides do not agree, the footprint is
grown all around.

A shift moves all sides alike, while overhangs may differ from side to side. So a roof that reaches
beyond its footprint everywhere is no shift: some side of it must end behind one of the footprint.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import shapely

from ..compiled import compiled
from ..geometry.grid import count_cells
from ..geometry.point_in_polygon import find_inside
from ..geometry.rings import counterclockwise
from .outline.lines import make_lines
from .outline.settle import compute_span, side_offsets
from .registration import COARSE_STEP, RASTER_PITCH_M, make_cell, make_shift_grid

FARTHEST_M = 3.0  # a footprint is moved at most
AROUND_M = 4.0  # of points that are asked for around it
PITCH_M = 0.1  # m by which corners of a footprint do not matter
# that are slid over the footprint: a bound on time, for all that comes after looks at every point
SLID_POINTS = 600
# that are tried all around the footprint; eaves reach no farther over walls
OVERHANGS_M = (0.0, 0.5, 1.0)
# points; with fewer every shift holds as many; m: shorter sides tell no offset
LEAST_POINTS, LEAST_SIDE_M = 20, 1.5
# before a side there may be so many points of those behind it
FREE_FROM_M, FREE_TO_M, FREE_SHARE = 0.4, 1.0, 0.25
SIDE_M, SIDE_LENGTH_M = 0.08, 4.0  # standard deviation of a side of this length
REACH_SIGMA_M = 0.5  # how far roofs usually reach beyond footprints, or stay behind
PRIOR = np.diag([1.0 / FARTHEST_M**2] * 2 + [1.0 / REACH_SIGMA_M**2])
# of putting each side where its points are, from the last shift; m that counts as no shift
ROUNDS, NEAR_M = 3, 0.2
# m; standard deviations; m that sides may disagree by; share of the border that must be free
LEAST_SHIFT_M, SIGMAS, MOST_DISAGREEMENT_M, LEAST_FREE = 0.3, 4.0, 0.25, 0.5
# share where an overhang all around is assumed: else it takes in the roofs of neighbours
LEAST_FREE_OVERHUNG = 0.85
# m by which a moved footprint's roof ends behind one of its sides: one that reaches beyond all of
# them, however unequally, may stand over these walls
LEAST_BEHIND_M = 0.25
# free sides: two directions and one to check them; share of the points outside, below which the
# footprint fits
LEAST_SIDES, LEAST_OUTSIDE = 3, 0.01
FEW = 10  # one point in so many is asked first whether points lie outside
LEAST_BEYOND_M = 0.3  # m that the roof's sides must lie off the footprint's to be told


@dataclass(frozen=True)
class Shift:
    """The place of a footprint's roof.

    `xy` (2,) m is its shift from the footprint with standard deviations `sigma` (2,), infinite
    along which nothing is known. `beyond` (m) is how far the roof reaches over the moved footprint,
    negative where it stays behind, with `beyond_sigma`, and `disagreement` (m) that of the sides.
    `behind` (m) is how far the roof ends behind that side of the unmoved footprint where it does
    most.
    """

    xy: np.ndarray = field(default_factory=lambda: np.zeros(2))
    sigma: np.ndarray = field(default_factory=lambda: np.full(2, math.inf))
    beyond: float = 0.0
    beyond_sigma: float = math.inf
    disagreement: float = math.inf
    behind: float = 0.0

    @property
    def is_none(self) -> bool:
        """Whether the footprint is known to lie where its roof is."""
        small = float(np.hypot(*self.xy)) < NEAR_M and float(self.sigma.max()) < NEAR_M
        return small and self.disagreement < MOST_DISAGREEMENT_M

    @property
    def is_clear(self) -> bool:
        """Whether the footprint should be moved."""
        length = float(np.hypot(*self.xy))
        is_determined = length > 0 and float(np.hypot(*(self.sigma * self.xy / length)))
        return bool(
            LEAST_SHIFT_M <= length <= FARTHEST_M
            and length > SIGMAS * is_determined
            and self.disagreement < MOST_DISAGREEMENT_M
            and self.behind > LEAST_BEHIND_M
        )

    @property
    def is_size_clear(self) -> bool:
        """Whether the roof surely is larger than the footprint, or smaller.

        It reaches beyond it on all sides, or stays behind it.
        """
        agreed = self.disagreement < MOST_DISAGREEMENT_M
        return bool(agreed and abs(self.beyond) > max(LEAST_BEYOND_M, SIGMAS * self.beyond_sigma))


def find_shift(xy: np.ndarray, footprint: shapely.Polygon) -> Shift:
    """Find the shift of `footprint` onto roof points `xy` (n, 2).

    Points lie in it and AROUND_M around it, in one local frame in metres.

    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0.2, 12, 0.4), np.arange(0.2, 8,
    ...     0.4)))
    >>> shift = find_shift(np.column_stack([x, y]), shapely.box(1.0, -0.5, 13.0, 7.5))
    >>> shift.is_clear, bool(np.abs(shift.xy - [-1.0, 0.5]).max() < 0.1)
    (True, True)
    """
    ring = counterclockwise(shapely.get_exterior_ring(shapely.simplify(footprint, PITCH_M)))[:-1]
    if len(xy) < LEAST_POINTS or len(ring) < 3:
        return Shift()
    xy, lines = np.ascontiguousarray(xy), make_lines(ring)
    density = len(xy) / max(shapely.Polygon(ring).area, 1.0)
    shift = by_sides(xy, ring, lines, np.zeros(2), 0.0, density)
    if shift is not None and shift.is_none:
        return shift
    if are_cut_off(xy, footprint):
        return Shift()
    for overhang in OVERHANGS_M:
        shift = settled_shift(xy, ring, lines, density, footprint, overhang)
        if shift.disagreement < MOST_DISAGREEMENT_M:
            return shift
        if not overhang and not is_alone(xy, footprint):
            break
    return Shift()


def is_alone(xy: np.ndarray, footprint: shapely.Polygon) -> bool:
    """Return whether points cover no more area than one roof may.

    That is the footprint's area with the largest overhang.
    """
    covered = count_cells(np.floor(xy))
    return bool(
        covered
        <= shapely.area(shapely.buffer(footprint, OVERHANGS_M[-1] + 0.5, join_style="mitre"))
    )


def settled_shift(
    xy: np.ndarray,
    ring: np.ndarray,
    lines: np.ndarray,
    density: float,
    footprint: shapely.Polygon,
    overhang: float,
) -> Shift:
    """Return the shift by the sides of a grown footprint.

    It is grown by `overhang` (m), and starts where it holds most points.
    """
    shift = Shift(count_points_within(xy, footprint, overhang))
    for _ in range(ROUNDS):
        sides = by_sides(xy, ring, lines, shift.xy, overhang, density)
        if sides is None:
            return Shift()
        is_settled = np.abs(sides.xy - shift.xy).max() < 0.02
        shift = sides
        if is_settled:
            break
    return shift


def are_cut_off(xy: np.ndarray, footprint: shapely.Polygon) -> bool:
    """Return whether points were cut off at the footprint.

    Such a cut looks like a roof that ends there; mostly a few of the points lie beyond it.
    """
    for subset in (xy[::FEW], xy):
        outside = ~find_inside(footprint, subset[:, 0], subset[:, 1])
        if np.count_nonzero(outside) / len(xy) >= LEAST_OUTSIDE:
            return False
    return True


def count_points_within(xy: np.ndarray, footprint: shapely.Polygon, overhang: float) -> np.ndarray:
    """Return the shift (2,) at which the grown footprint holds most of `xy`.

    It is grown by `overhang` (m). The search is coarse, then fine, and the shortest shift wins
    where several hold as many.
    """
    grown = shapely.buffer(footprint, overhang, join_style="mitre")
    cell, best = make_cell(xy[:: max(1, len(xy) // SLID_POINTS)], [grown]), np.zeros(2, int)
    for step, reach_m in ((COARSE_STEP, FARTHEST_M), (1, COARSE_STEP * RASTER_PITCH_M)):
        pitches = best + make_shift_grid(step, reach_m)
        shifts = RASTER_PITCH_M * pitches
        costs = cell.sums(pitches).sum(axis=0) + 0.1 * (shifts**2).sum(axis=1)
        best = pitches[int(np.argmin(costs))]
    return RASTER_PITCH_M * best


def by_sides(
    xy: np.ndarray,
    ring: np.ndarray,
    lines: np.ndarray,
    start: np.ndarray,
    overhang: float,
    density: float,
) -> Shift | None:
    """Return the shift and reach on which all free sides agree best.

    The footprint is slid by `start` and grown by `overhang` (m). It is None where there are too few
    sides.
    """
    ends = np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)
    length = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    normals = np.column_stack([np.cos(lines[:, 0]), np.sin(lines[:, 0])])
    from_lines = normals @ start + overhang
    distances, ends = lines[:, 1] + from_lines, ends + start
    free = free_sides(xy, normals, distances, ends) & (length >= LEAST_SIDE_M)
    lengths = length[free]
    minimum = LEAST_FREE_OVERHUNG if overhang else LEAST_FREE
    if len(lengths) < LEAST_SIDES or lengths.sum() <= minimum * length.sum():
        return None
    normals, sigma = normals[free], SIDE_M * np.sqrt(SIDE_LENGTH_M / lengths)
    targets = side_offsets(xy, normals, distances[free], ends[free], density) + from_lines[free]
    design = np.column_stack([normals, np.ones(len(lengths))])
    weight = 1.0 / sigma**2
    inverse = np.linalg.inv((design.T * weight) @ design + PRIOR)
    solution = inverse @ (design.T @ (weight * targets))
    gap = targets - design @ solution
    disagreement = math.sqrt(float((gap**2 * lengths).sum() / lengths.sum()))
    spread = np.sqrt(np.diag(inverse)) * max(1.0, math.sqrt(float((weight * gap**2).mean())))
    behind = -float(targets.min())
    return Shift(
        solution[:2], spread[:2], float(solution[2]), float(spread[2]), disagreement, behind
    )


@compiled
def free_sides(xy, normals, distances, ends):
    """Return which of the footprint's sides (m,) are free.

    They have points behind them and hardly any before, where roofs of neighbours would go on.
    """
    previous, behind = np.zeros(len(normals)), np.zeros(len(normals))
    for m in range(len(normals)):
        x, y = normals[m]
        lower, upper = compute_span(normals[m], ends[m])
        for k in range(len(xy)):
            depth = distances[m] - x * xy[k, 0] - y * xy[k, 1]
            if -FREE_TO_M < depth < FREE_TO_M and lower <= x * xy[k, 1] - y * xy[k, 0] <= upper:
                previous[m] += depth < -FREE_FROM_M
                behind[m] += depth > FREE_FROM_M
    return (behind >= FREE_TO_M - FREE_FROM_M) & (previous <= FREE_SHARE * behind)
