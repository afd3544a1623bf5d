"""The common shift between footprints and roofs of a data set.

It comes with its uncertainty.

A missing datum grid, or another epoch, moves all footprints alike. So all of them vote at once: for
each shift the cost of the roof points is summed, where a point costs little inside the footprints
and more outside, with a soft edge. Costs are summed by fixed squares of the world and then over all
squares, in a fixed order. Neither work tiles nor the order of files or points changes the result.
The scatter between squares gives the standard deviation.

Point density, overhangs and single wrong footprints change the depth of the minimum, not its place:
an overhang on opposite sides cancels, and a point far outside costs no more than one just outside.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from ..geometry.grid import number_cells

FARTHEST_SHIFT_M = 4.8
"""Longest common shift (m) that is looked for.

Missing grids move things by 0.5 to 4 m; farther off, houses of a row match the footprints of their
neighbours.
"""

SMALLEST_SHIFT_M, SIGMAS, MOST_SIGMA_M = 0.3, 4.0, 0.15
"""A common shift is applied from this length (m) on, if it is so many standard deviations long and
these are no larger. Outlines of surveys lie 0.1 to 0.2 m from their roofs without any error of the
datum.
"""

LEAST_SQUARES, LEAST_FOOTPRINTS = 15, 5
"""Squares with roof points, and footprints, below which the scatter between squares says too
little.
"""

LEAST_AGREEMENT, OTHER_M = 1.0, 1.0
"""Gain (standard deviations) that the shift must have over every one farther than OTHER_M (m) from
it: rows of equal houses fit each other's footprints nearly as well.
"""

RASTER_PITCH_M = 0.2
"""Pitch (m) of the raster on which footprints are shifted, and step of the fine search."""

COARSE_STEP = 3
"""Pitches between the shifts of the first search."""

EVERY = 4
"""One point in so many takes part in the first search."""

BLUR_M, STRAY = 0.25, math.exp(-4.0)
"""Width (m) of a soft edge, as in fit/outline; density far outside over that inside: points of
walls and neighbours.
"""

SQUARE_M = 50.0
"""Side (m) of the squares whose scatter is measured: a few houses each."""

RASTER_MARGIN = round((FARTHEST_SHIFT_M + 1.2) / RASTER_PITCH_M)
"""Pitches of raster around the points, so that no shift leads out of it."""

MOST_SAMPLE_POINTS = 30_000
"""Points of a cell that are used, evenly thinned: more do not change a shift by a centimetre."""


@dataclass(frozen=True)
class Registration:
    """The common shift of the footprints onto the roofs.

    `xy` is in m, east and north, with standard deviations `sigma` (m).

    `squares` had roof points; `agreement` is how much better the shift is than any other one that
    is far from it, in standard deviations of the sum over the squares. `is_confirmed` says that
    something other than roofs shows the same shift.
    """

    xy: tuple[float, float] = (0.0, 0.0)
    sigma: tuple[float, float] = (math.inf, math.inf)
    footprints: int = 0
    squares: int = 0
    agreement: float = 0.0
    is_confirmed: bool = False

    @property
    def length(self) -> float:
        return math.hypot(*self.xy)

    @property
    def is_clear(self) -> bool:
        """Whether the footprints should be moved."""
        return self.is_confirmed or (
            self.is_likely
            and self.squares >= LEAST_SQUARES
            and self.footprints >= LEAST_FOOTPRINTS
            and self.agreement > LEAST_AGREEMENT
        )

    @property
    def is_likely(self) -> bool:
        """Whether the footprints used lie beside their roofs, however few they are."""
        sigma = max(self.sigma)
        return sigma <= MOST_SIGMA_M and self.length >= max(SMALLEST_SHIFT_M, SIGMAS * sigma)

    @property
    def shift(self) -> tuple[float, float]:
        """The shift (m) of the footprints: the common one if it is clear, else none."""
        return self.xy if self.is_clear else (0.0, 0.0)

    def to_dict(self) -> dict[str, Any]:
        """Return the result for run.json, and whether it was applied."""
        is_determined = self.squares > 0 and all(map(math.isfinite, self.sigma))
        return {
            "shift_m": list(self.xy),
            "sigma_m": list(self.sigma) if is_determined else None,
            "footprints": self.footprints,
            "squares": self.squares,
            "agreement": self.agreement,
            "applied": self.is_clear,
        }

    @staticmethod
    def from_dict(values: dict[str, Any]) -> Registration:
        sigma = values["sigma_m"] or (math.inf, math.inf)
        return Registration(
            tuple(values["shift_m"]),
            tuple(sigma),
            values["footprints"],
            values["squares"],
            values["agreement"],
        )


@dataclass(frozen=True)
class Cell:
    """Roof points of a part of the world on a raster, sorted.

    They lie in the `squares` (n,) and at the `nodes` (n,).

    `costs` (k,) are those of a point at each node, `row` the nodes of a row, and `low` the place of
    the first node.
    """

    low: tuple[float, float]
    squares: np.ndarray
    nodes: np.ndarray
    costs: np.ndarray
    row: int

    def sums(self, shifts: np.ndarray, every: int = 1) -> np.ndarray:
        """Return costs (squares, m) of one point in `every`, by square.

        Footprints move by `shifts` (m, 2) pitches.
        """
        squares, nodes = self.squares[::every], self.nodes[::every]
        moves = (shifts @ [self.row, 1]).tolist()
        return np.column_stack(
            [np.bincount(squares, weights=self.costs[nodes - move]) for move in moves]
        )


def register(cells: Iterable[tuple[np.ndarray, list[shapely.Polygon]]]) -> Registration:
    """Estimate the common shift from the `cells` of a data set.

    A cell is roof points (n, 2) and the footprints around them.

    Coordinates are world metres. The cells must not overlap; their order does not matter, nor that
    of the points.

    >>> houses = [shapely.box(x, y, x + 12, y + 8) for x in range(0, 200, 40) for y in range(0,
    ...     200, 40)]
    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0, 200, 0.5), np.arange(0, 200,
    ...     0.5)))
    >>> on_roof = (x % 40 < 12) & (y % 40 < 8)
    >>> moved = [shapely.transform(house, lambda xy: xy - [1.2, -0.8]) for house in houses]
    >>> found = register([(np.column_stack([x, y])[on_roof] + 0.25, moved)])
    >>> found.is_clear, bool(np.abs(np.subtract(found.xy, [1.2, -0.8])).max() < 0.3)
    (True, True)
    """
    pairs = [
        (make_cell(xy, polygons), len(polygons)) for xy, polygons in cells if len(xy) and polygons
    ]
    if not pairs:
        return Registration()
    pairs.sort(key=lambda pair: pair[0].low)
    result, footprints = [cell for cell, _ in pairs], sum(count for _, count in pairs)
    coarse = make_shift_grid(COARSE_STEP, FARTHEST_SHIFT_M)
    by_square = sum_costs(result, coarse, EVERY)
    best = coarse[int(np.argmin(by_square.sum(axis=0)))]
    fine = best + make_shift_grid(1, COARSE_STEP * RASTER_PITCH_M)
    best = fine[int(np.argmin(sum_costs(result, fine).sum(axis=0)))]
    gains = by_square[:, RASTER_PITCH_M * np.hypot(*(coarse - best).T) > OTHER_M] - sum_costs(
        result, best[None], EVERY
    )
    xy, sigma = settle(result, best)
    return Registration(xy, sigma, footprints, len(gains), agreement(gains))


def agreement(gains: np.ndarray) -> float:
    """Return the smallest sum of gains (squares, others) over squares.

    It is in standard deviations of that sum.
    """
    scatter = np.sqrt(((gains - gains.mean(axis=0)) ** 2).sum(axis=0))
    return round(float(np.min(gains.sum(axis=0) / np.maximum(scatter, 1e-9))), 3)


def settle(cells: list[Cell], best: np.ndarray) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the minimum (m) beside `best`, with deviations.

    A parabola goes through its surroundings, and the scatter between squares gives the deviations.
    """
    surroundings = np.array(
        [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, -1], [1, -1], [-1, 1]]
    )
    costs = sum_costs(cells, best + surroundings)
    position, plus_x, minus_x, plus_y, minus_y, combined, neither, item, other = costs.sum(axis=0)
    slopes = np.column_stack([costs[:, 1] - costs[:, 2], costs[:, 3] - costs[:, 4]]) / 2
    cross = (combined + neither - item - other) / 4
    bend = np.array(
        [[plus_x + minus_x - 2 * position, cross], [cross, plus_y + minus_y - 2 * position]]
    )
    if not (np.linalg.eigvalsh(bend) > 0).all():
        return round_shift(best), (math.inf, math.inf)
    inverse = np.linalg.inv(bend)
    move = -inverse @ slopes.sum(axis=0)
    gap = slopes - slopes.mean(axis=0)
    sigma = np.sqrt(np.diag(inverse @ (gap.T @ gap) @ inverse))
    return round_shift(best + move / max(1.0, float(np.hypot(*move)))), round_shift(sigma)


def sum_costs(cells: list[Cell], shifts: np.ndarray, every: int = 1) -> np.ndarray:
    """Return the costs (squares, m) of all cells, one after the other."""
    return np.concatenate([cell.sums(shifts, every) for cell in cells])


def round_shift(pitches: np.ndarray) -> tuple[float, float]:
    """Return metres, to the millimetre, as the run's files give them."""
    x, y = (round(float(value) * RASTER_PITCH_M, 3) for value in pitches)
    return x, y


def make_shift_grid(step: int, reach_m: float) -> np.ndarray:
    """Return shifts (m, 2), `step` pitches apart, at most `reach_m` long."""
    limit = round(reach_m / RASTER_PITCH_M / step)
    along = step * np.arange(-limit, limit + 1)
    shifts = np.stack(np.meshgrid(along, along, indexing="ij"), axis=-1).reshape(-1, 2)
    return shifts[np.hypot(*shifts.T) * RASTER_PITCH_M <= reach_m + 1e-9]


def make_cell(xy: np.ndarray, polygons: list[shapely.Polygon]) -> Cell:
    """Return the points in a fixed order, thinned, on a raster of costs.

    The raster holds what a point costs around them.
    """
    from scipy import ndimage  # a third of a second, for runs with footprints alone

    xy = np.unique(np.asarray(xy, float)[:, :2], axis=0)
    xy = xy[:: -(-len(xy) // MOST_SAMPLE_POINTS)]
    lower = np.floor(xy.min(axis=0) / RASTER_PITCH_M) - RASTER_MARGIN
    shape = (np.ceil(xy.max(axis=0) / RASTER_PITCH_M) + RASTER_MARGIN - lower).astype(int) + 1
    inside = rasterise(polygons, lower, shape)
    inside = ndimage.gaussian_filter(inside, BLUR_M / RASTER_PITCH_M, truncate=3.0)
    i, j = (np.rint(xy / RASTER_PITCH_M) - lower).astype(int).T
    _, squares = number_cells(np.floor(xy / SQUARE_M))
    inside *= 1.0 - STRAY
    inside += STRAY
    costs = np.negative(np.log(inside, out=inside), out=inside)
    return Cell(
        (float(lower[0]), float(lower[1])),
        squares,
        i * shape[1] + j,
        costs.ravel(),
        int(shape[1]),
    )


def rasterise(polygons: list[shapely.Polygon], lower: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Return 1 at raster nodes (columns, rows) in any of the polygons, else 0.

    `lower` (2,) are the first node's pitches.
    """
    inside = np.zeros(shape, np.float32)
    for polygon in polygons:
        box = np.reshape(polygon.bounds, (2, 2)) / RASTER_PITCH_M - lower
        first = np.clip(np.ceil(box[0]), 0, shape).astype(int)
        last = np.clip(np.floor(box[1]) + 1, 0, shape).astype(int)
        if (last > first).all():
            x, y = (
                RASTER_PITCH_M * (lower[axis] + np.arange(first[axis], last[axis]))
                for axis in (0, 1)
            )
            shapely.prepare(polygon)
            mask = shapely.contains_xy(polygon, *np.meshgrid(x, y, indexing="ij"))
            inside[first[0] : last[0], first[1] : last[1]][mask] = 1.0
    return inside
