"""Two surveys of one building compared in cells of half a metre to two.

Each cell has the median height over the earlier roof of either survey. Their difference has
a standard deviation that follows from the scatter of the points in the cell, from their number, and
from how much unchanged roofs differ, cell by cell and as a whole.

Heights over a roof do not regard where exactly its steps lie.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely

from ..geometry.grid import count_cells, number_cells
from ..model import Part, Roof
from ..model.heights import find_highest

CELL_SIDES_M = (0.5, 1.0, 2.0)
"""Sides (m) of cells: half and all of the square root of the smallest change that is looked for (4
m2) and half of that, and for sparse surveys. The smallest counts in which both surveys have
POINTS_A_CELL."""

POINTS_A_CELL = 1.5  # by chance 1 - exp(-1.5) = 78 % of the cells then hold points

LEAST_FILLED = 0.7  # share of the cells that hold points; lines far apart leave more of them empty

FEWEST_OCCUPIED = 0.1  # share of the cells that hold points in the sparsest survey

INSIDE_M = 0.4
"""Points nearer to the outline (m) may be returns of walls and gutters, or lie beside the roof
because the surveys are not in line."""

MEDIAN_VARIANCE = np.pi / 2
"""Variance of a median over that of a mean, for normal errors."""

SAME_SIGMAS = 3.0
"""Points within so many standard deviations of a surface lie on it."""


@dataclass(frozen=True)
class SurveyNoise:
    """How much unchanged roofs differ between surveys.

    Standard deviations are in metres.

    `point` is that of a single point about its cell's median, `cell` that of two cells' medians
    beyond what the points explain, and `roof` that of a whole roof. `stray` is the share of cells
    that contradict unchanged roofs, by things on them or steps beside them.
    """

    point: float = 0.05
    cell: float = 0.04
    roof: float = 0.03
    stray: float = 0.003

    @property
    def variance(self) -> float:
        """Variance (m2) of a cell's difference beyond what its points explain."""
        return self.cell**2 + self.roof**2


@dataclass(frozen=True)
class CellComparison:
    """The cells (k, 2) of a building in which at least one survey has points.

    `outline_m2` is the building's area, as far as it is known to either.
    `old` and `new` (k,) are median heights over the earlier roof, NaN without points; `n_old` and
    `n_new` the numbers of points. `sigma` (k,) is the standard deviation of `new - old`. `kept`
    (k,) is the share of the new points on the old surface, `known` that of the old points on the
    new one. `number` (n,) is the cell of each of the new `points` (n, 3), which are about the
    roof's origin and lie `over` (n,) the earlier roof. `number_old` and `over_old` (m,) are the
    same of the old points.
    """

    cell_m: float
    outline_m2: float
    cells: np.ndarray
    old: np.ndarray
    new: np.ndarray
    n_old: np.ndarray
    n_new: np.ndarray
    sigma: np.ndarray
    kept: np.ndarray
    known: np.ndarray
    points: np.ndarray
    number: np.ndarray
    over: np.ndarray
    number_old: np.ndarray
    over_old: np.ndarray

    @property
    def difference(self) -> np.ndarray:
        """The new height minus the old one (k,), NaN where one is missing."""
        return self.new - self.old

    @property
    def is_compared(self) -> np.ndarray:
        """Whether (k,) both surveys have points in a cell."""
        return (self.n_old > 0) & (self.n_new > 0)

    @property
    def cell_m2(self) -> float:
        """The area (m2) that a cell with new points stands for.

        A cell may reach beyond the building, and another hold no points by chance.
        """
        return self.outline_m2 / len(self.cells) / predict_occupancy(self.n_new)

    @property
    def centres(self) -> np.ndarray:
        """The middles (k, 2) of the cells, about the roof's origin."""
        return (self.cells + 0.5) * self.cell_m


def shrink_outline(outline: shapely.Polygon) -> shapely.Geometry:
    """Return the outline without the strip along its walls.

    A narrow building keeps more of it.
    """
    for margin in (INSIDE_M, INSIDE_M / 2):
        inner = shapely.buffer(outline, -margin)
        if inner.area > 0.4 * outline.area:
            return inner
    return outline


def compare_points(
    roof: Roof,
    old: np.ndarray | None,
    new: np.ndarray,
    noise: SurveyNoise,
    cell_m: float | None = None,
) -> CellComparison:
    """Compare the `old` and `new` points (n, 3) of a building.

    Both are in its roof's frame. Without old points the earlier roof itself stands for them. The
    side of the cells follows from the points where `cell_m` does not give it.
    """
    inner, outline_m2 = shrink_outline(roof.outline), roof.outline.area
    surveys = [select_inner(roof, inner, xyz) for xyz in (old, new) if xyz is not None]
    new, r_new = surveys[-1]
    cell_m = cell_m or choose_cell(inner, *(xyz for xyz, _ in surveys))
    cells, number = number_cells(
        np.floor(np.concatenate([xyz[:, :2] for xyz, _ in surveys]) / cell_m)
    )
    in_old, in_new = np.split(number, [len(number) - len(new)])
    m_new, s_new, n_new = summarise_cells(in_new, r_new, len(cells), noise.point)
    if old is None:
        r_old, n_old, (m_old, v_old) = r_new[:0], np.ones_like(n_new), np.zeros((2, len(cells)))
        outline_m2 = min(outline_m2, len(cells) * cell_m**2)
    else:
        r_old = surveys[0][1]
        m_old, s_old, n_old = summarise_cells(in_old, r_old, len(cells), noise.point)
        s_new = np.fmin(s_new, np.fmax(s_old, 2 * noise.point))  # as an unchanged roof scatters
        v_old = s_old**2
    with np.errstate(divide="ignore", invalid="ignore"):
        sampling = MEDIAN_VARIANCE * (v_old / n_old + s_new**2 / n_new)
    sigma = np.sqrt(np.where(np.isfinite(sampling), sampling, np.inf) + noise.variance)
    near = SAME_SIGMAS * np.hypot(noise.point, noise.cell)
    return CellComparison(
        cell_m,
        outline_m2,
        cells,
        m_old,
        m_new,
        n_old,
        n_new,
        sigma,
        compute_share_near(in_new, r_new, m_old, near),
        compute_share_near(in_old, r_old, m_new, near),
        new,
        in_new,
        r_new,
        in_old,
        r_old,
    )


def choose_cell(inner: shapely.Geometry, *surveys: np.ndarray) -> float:
    """Return the side (m) of the cells for the points (n, 3) of surveys.

    Points lie inside `inner`. It follows from the density of the sparsest survey, where that has
    points, and from how far lines of points lie apart.
    """
    wide = CELL_SIDES_M[-1]
    all_cells = [number_cells(np.floor(xyz[:, :2] / wide))[0] for xyz in surveys]
    count = count_cells(np.concatenate(all_cells))
    area = min(wide**2, inner.area / max(count, 1))  # that is inside, of a cell
    areas = [max(len(cells) * area, 1e-9) for cells in all_cells]

    def is_filled(xyz: np.ndarray, area_m2: float, side: float) -> bool:
        return len(xyz) * side**2 >= POINTS_A_CELL * area_m2 and (
            count_cells(np.floor(xyz[:, :2] / side)) * side**2 >= LEAST_FILLED * area_m2
        )

    for side in CELL_SIDES_M[:-1]:
        if all(is_filled(*survey, side) for survey in zip(surveys, areas, strict=True)):
            return side
    return wide


def predict_occupancy(counts: np.ndarray) -> float:
    """Return the share of cells that hold points, from the `counts` (k,) of points.

    Points fall by chance (Poisson): with m points a cell, 1 - exp(-m) of the cells hold any.

    >>> [round(predict_occupancy(np.array(counts)), 3) for counts in ([0, 1, 2, 2], [9, 9])]
    [0.676, 1.0]
    """
    mean = m = float(counts.sum() / max((counts > 0).sum(), 1))
    for _ in range(50):
        m = mean * -math.expm1(-m)
    return max(-math.expm1(-m), FEWEST_OCCUPIED)


def select_inner(
    roof: Roof, inner: shapely.Geometry, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the points (m, 3) inside `inner`, and their heights (m,) over the roof."""
    shapely.prepare(inner)
    points = points[shapely.intersects_xy(inner, points[:, :2])]
    residuals = measure_residuals(roof, points)
    known = np.isfinite(residuals)
    return points[known], residuals[known]


def summarise_cells(
    number: np.ndarray, values: np.ndarray, count: int, least: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the median, the scatter and the number of the `values` (n,) in each cell.

    The scatter is 1.48 times the median deviation, and at least `least`. Empty cells have NaN.
    """
    from scipy.ndimage import median

    n = np.bincount(number, minlength=count)
    occupied, middle, scatter = np.flatnonzero(n), *np.full((2, count), np.nan)
    if len(occupied):
        middle[occupied] = median(values, number, occupied)
        deviation = np.abs(values - middle[number])
        scatter[occupied] = np.maximum(1.4826 * median(deviation, number, occupied), least)
    return middle, scatter, n


def compute_share_near(
    number: np.ndarray, values: np.ndarray, surface: np.ndarray, near: float
) -> np.ndarray:
    """Return the share (k,) of each cell's values (n,) near its surface.

    Near is within `near` (m) of its `surface` (k,).
    """
    n = np.bincount(number, minlength=len(surface))
    with np.errstate(invalid="ignore"):
        close = np.abs(values - surface[number]) <= near
    return np.bincount(number, weights=close, minlength=len(surface)) / np.maximum(n, 1)


STEP_REACH_M = 0.4
"""How far (m) a step or an edge of the roof may lie from where the model has it: two standard
deviations of the horizontal difference between two surveys, which is 0.2 m."""

ON_SURFACE_M = 0.1
"""Distance (m) from the surface below a point within which the point lies on it, whatever shows
nearby: two standard deviations of the points of two surveys, which are 0.05 m each."""

DIRECTIONS = np.array([(np.cos(a), np.sin(a)) for a in np.arange(8) * np.pi / 4])


def measure_residuals(roof: Roof, points: np.ndarray) -> np.ndarray:
    """Return the height (n,) of points (n, 3) over the roof, in the roof's frame.

    It is that over the surface below a point where the point lies on it. Otherwise the nearest in
    height counts of all surfaces that show within STEP_REACH_M. The height is NaN beside the roof.
    """
    result = points[:, 2] - find_pieces(roof, points[:, :2])[0]
    other = np.flatnonzero(np.abs(result) > ON_SURFACE_M)
    result[other] = measure_nearest(roof, points[other], result[other])
    return np.where(np.isfinite(result), result, np.nan)


def find_pieces(roof: Roof, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the height (n,) of the roof at `xy` (n, 2), and the piece that shows there."""
    return find_highest([Part("", (piece,)) for piece in roof.pieces], xy)


def measure_nearest(roof: Roof, points: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Return the height (n,) of points (n, 3) over the surface nearest in height.

    `own` (n,) is that over the surface below them; others show within STEP_REACH_M.
    """
    xy = points[:, :2]
    around = (xy + STEP_REACH_M * DIRECTIONS[:, None, :]).reshape(-1, 2)
    found, top = find_pieces(roof, around)
    heights = np.array([piece.height_at(xy) for piece in roof.pieces])
    over = points[:, 2] - heights[top.reshape(len(DIRECTIONS), -1), np.arange(len(points))]
    over[~np.isfinite(found).reshape(over.shape)] = np.inf
    over = np.concatenate([own[None], over])
    return over[np.abs(over).argmin(axis=0), np.arange(len(points))]


def find_slopes(roof: Roof, xy: np.ndarray) -> np.ndarray:
    """Return the gradient (n, 2) of the roof at `xy` (n, 2), NaN beside it."""
    result = np.full((len(xy), 2), np.nan)
    if not len(xy):
        return result
    heights, top = find_pieces(roof, xy)
    for number, piece in enumerate(roof.pieces):
        mask = (top == number) & np.isfinite(heights)
        if mask.any():
            z = xy[mask] @ piece.planes[:, :2].T + piece.planes[:, 2]
            result[mask] = piece.planes[z.argmin(axis=1), :2]
    return result
