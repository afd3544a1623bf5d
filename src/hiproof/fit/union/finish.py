"""Fit the planes of every volume to all points over which it is visible.

Each inclined plane is z = c + s d, with d the distance from the line of its side. Two choices are
made by the points: which way the planes face (along the volume's axes, or square to the sides,
which seldom are quite at right angles), and whether the eaves on the outline are at one height.
Everything is linear in c and s, so each choice is one re-weighted least squares.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...compiled import compiled
from ...geometry.arrays import copy_row
from .objective import compute_point_cost
from .planes import find_lowest_row
from .prices import PARAMETER_COST
from .scene import Scene
from .sides import Side
from .volumes import (
    ALL_EQUAL,
    DIRECTION,
    LEAN0,
    LEVEL,
    N_SIDES,
    OFFSET0,
    OPPOSITE,
    SLOPE0,
    SLOPE_HIGH,
    TIE,
    compute_roof_heights,
)

ROUNDS = 3  # Rounds of fitting and re-weighting.
FEWEST_FITTED_POINTS = 6  # With fewer points, a volume's planes stay as the search left them.
# Planes face other than along the axes only if that explains so much more (units).
FACING_GAIN = 0.1
# Share of the points that level eaves, or what volumes agree in, may leave unexplained besides the
# parameters saved.
LEVEL_SLACK = 0.004
# The plane from the left rises to +u, the one from the right to -u, and so on.
RISE_SIGN = (1.0, -1.0, 1.0, -1.0)
FLATTEST = 0.02  # A flatter plane (rise over run) has no clear direction.
SQUARE_LEAN = 1e-3  # A side that leans less is square to the others.


class OutlineWall(NamedTuple):
    """A wall of the outline in a volume's axes.

    `facing` is the way that it faces outwards (rad), and `offset` how far out that way from the
    origin it lies (m).
    """

    facing: float
    offset: float

    @property
    def depth(self) -> np.ndarray:
        """The factors (3,) of u, v, 1 that give the depth of a place inside the wall."""
        return np.array([-math.cos(self.facing), -math.sin(self.facing), self.offset])


@dataclass(frozen=True)
class Planes:
    """A volume's planes by place: left, right, front, back, top, over each of `walls`.

    `rows` (k, 3) are a, b, c of z = a u + b v + c, NaN where it has none. `cost` is that of their
    points, `price` that of the parameters of those over walls. The rows are `design` (k, 3, p)
    times p unknowns with this `covariance` (p, p).
    """

    rows: np.ndarray
    cost: float
    design: np.ndarray
    covariance: np.ndarray
    walls: tuple[OutlineWall, ...] = ()
    price: float = 0.0

    @property
    def inclined(self) -> int:
        """The number of planes that rise from sides."""
        return int(np.isfinite(self.rows[:LEVEL, 2]).sum())

    @property
    def modes(self) -> np.ndarray:
        """Independent changes (k, 3, p) of the rows, of one standard deviation each."""
        variances, axes = np.linalg.eigh(self.covariance)
        return self.design @ (axes * np.sqrt(np.maximum(variances, 0.0)))


def find_visible_points(volumes: np.ndarray, scene: Scene) -> list[np.ndarray]:
    """Return the numbers of the points (m,) over which each volume is visible."""
    _, top = compute_roof_heights(volumes, scene.U, scene.V, scene.order)
    return [np.nonzero(top[: scene.n] == k)[0] for k in range(len(volumes))]


def take_points(volume: np.ndarray, members: np.ndarray, scene: Scene) -> np.ndarray:
    """Return the points `members` (m,) in a volume's own axes: u, v, z (3, m)."""
    direction = int(volume[DIRECTION])
    return np.array([scene.U[direction][members], scene.V[direction][members], scene.z[members]])


def fit_volume_planes(
    volume: np.ndarray, sides: list[Side], scene: Scene, members: np.ndarray
) -> Planes:
    """Fit one volume's planes to the points `members` (m,) over which it is visible."""
    numbers = np.flatnonzero(volume[OFFSET0 : OFFSET0 + LEVEL + 1] < np.inf).tolist()
    points = take_points(volume, members, scene)
    start = read_planes(volume, numbers, points, scene)
    if len(members) < FEWEST_FITTED_POINTS:
        return start
    base = scene.evidence * PARAMETER_COST
    facing: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    best = fit_design(start, design_planes(volume, sides, facing, numbers, level=()), points, scene)
    for pair in (0, 2):
        for pair_leans in list_facings(volume[LEAN0 : LEAN0 + N_SIDES], sides, numbers, pair):
            leans = (*facing[:pair], *pair_leans, *facing[pair + 2 :])
            trial = fit_design(
                start, design_planes(volume, sides, leans, numbers, level=()), points, scene
            )
            if trial.cost + FACING_GAIN * base < best.cost - 1e-9:
                best, facing = trial, leans
    anchored = tuple(k for k in numbers if k < LEVEL and sides[k].anchored)
    if len(anchored) > 1:
        square = square_leans(sides, anchored, facing)
        trial = fit_design(
            best, design_planes(volume, sides, square, numbers, anchored), points, scene
        )
        if trial.cost <= best.cost + base * (len(anchored) - 1) + LEVEL_SLACK * len(members):
            best = trial
    if numbers == [*range(N_SIDES)] and all(sides[k].offset < sides[k + 1].offset for k in (0, 2)):
        leans = square_leans(sides, (0, 1, 2, 3), facing)
        trial = fit_design(best, design_pyramid(sides, leans), points, scene)
        n_saved = max(len(set(group_slopes(volume))) - 1, 0)
        if trial.cost <= best.cost + base * n_saved + LEVEL_SLACK * len(members):
            best = trial
    return best


def design_pyramid(sides: list[Side], leans: tuple[float, ...]) -> np.ndarray:
    """Return the design (5, 3, 2) of a pyramid over the sides: eave's height and rise."""
    design = np.zeros((5, 3, 2))
    for k in range(N_SIDES):
        half = 0.5 * (sides[k | 1].offset - sides[k & 2].offset)
        design[k, 2, 0] = 1.0
        design[k, k // 2, 1] = RISE_SIGN[k] / half
        design[k, 1 - k // 2, 1] = leans[k] / half
        design[k, 2, 1] = -RISE_SIGN[k] * sides[k].offset / half
    return design


def read_planes(volume: np.ndarray, numbers: list[int], points: np.ndarray, scene: Scene) -> Planes:
    """Return the planes that the search left, along the axes, over `points` (3, m)."""
    rows = np.full((N_SIDES + 1, 3), np.nan)
    for k in numbers:
        rows[k] = (0.0, 0.0, volume[OFFSET0 + k])
        if k < LEVEL:
            rows[k, k // 2] = RISE_SIGN[k] * volume[SLOPE0 + k]
            rows[k, 1 - k // 2] = volume[SLOPE0 + k] * volume[LEAN0 + k]
    cost = sum_point_costs(rows, points, scene.dead, scene.width)
    return Planes(rows, cost, np.zeros((N_SIDES + 1, 3, 0)), np.zeros((0, 0)))


def read_volume_planes(volume: np.ndarray, scene: Scene) -> Planes:
    """Return the planes of a volume as the search left them."""
    numbers = np.flatnonzero(np.isfinite(volume[OFFSET0 : OFFSET0 + LEVEL + 1])).tolist()
    return read_planes(volume, numbers, np.zeros((3, 0)), scene)


def list_facings(
    found_leans: np.ndarray, sides: list[Side], numbers: list[int], pair: int
) -> list[tuple[float, float]]:
    """List ways for planes `pair` and the next to face other than along the axis.

    A way has two leans: as `found_leans` (4,), square to their sides, or both square to one of
    them. A plane that is not among `numbers` has no lean.
    """
    lean, other = (
        0.0 if abs(side.lean) < SQUARE_LEAN else side.lean for side in sides[pair : pair + 2]
    )
    ways = [
        (float(found_leans[pair]), float(found_leans[pair + 1])),
        (-lean, other),
        (-lean, lean),
        (-other, other),
    ]
    has_first, has_second = pair in numbers, pair + 1 in numbers
    return [
        way for way in dict.fromkeys((has_first * a, has_second * b) for a, b in ways) if any(way)
    ]


def square_leans(
    sides: list[Side], anchored: tuple[int, ...], facing: tuple[float, ...]
) -> tuple[float, ...]:
    """Return the leans with those of the `anchored` sides square to their own lines."""
    leans = list(facing)
    for k in anchored:
        lean = 0.0 if abs(sides[k].lean) < SQUARE_LEAN else sides[k].lean
        leans[k] = -lean if k % 2 == 0 else lean
    return tuple(leans)


def design_planes(
    volume: np.ndarray,
    sides: list[Side],
    leans: tuple[float, ...],
    numbers: list[int],
    level: tuple[int, ...],
) -> np.ndarray:
    """Return the design (5, 3, p) of a volume's planes.

    Its p unknowns are an offset for each plane, one offset for all sides that are `level`, and the
    slopes, tied as the volume's.
    """
    groups = group_slopes(volume)
    offsets = [place for place in numbers if place not in level]
    slopes = list(dict.fromkeys(groups[place] for place in numbers if place < LEVEL))
    eave, width = len(offsets), len(offsets) + bool(level)
    design = np.zeros((N_SIDES + 1, 3, width + len(slopes)))
    for place in numbers:
        design[place, 2, eave if place in level else offsets.index(place)] = 1.0
        if place < LEVEL:
            column = width + slopes.index(groups[place])
            design[place, place // 2, column] = RISE_SIGN[place]
            design[place, 1 - place // 2, column] = leans[place]
            if place in level:
                design[place, 2, column] = -RISE_SIGN[place] * sides[place].offset
    return design


def group_slopes(volume: np.ndarray) -> list[int]:
    """Return which slopes are equal under the volume's tie."""
    if volume[TIE] == ALL_EQUAL:
        return [0, 0, 0, 0]
    return [0, 0, 2, 2] if volume[TIE] == OPPOSITE else [0, 1, 2, 3]


def fit_design(start: Planes, design: np.ndarray, points: np.ndarray, scene: Scene) -> Planes:
    """Fit the planes of `design` (5, 3, p) to `points` (3, m) from `start`.

    Returns `start` if they are improper.
    """
    rows, covariance, cost = solve_least_squares(
        start.rows, design, points, scene.dead, scene.width
    )
    return Planes(rows, cost, design, covariance) if is_proper(rows) else start


@compiled
def solve_least_squares(rows, design, points, dead, width):
    """Solve biweighted least squares for planes, a few rounds from `rows`.

    Returns rows (5, 3), the unknowns' covariance (p, p) and the points' cost. Unknowns that no
    point determines stay as they were.
    """
    unity, is_present = np.zeros((len(rows), 3, 3)), np.isfinite(rows[:, 2])
    for k in range(len(rows)):
        for i in range(3):
            unity[k, i, i] = 1.0
    normal, right = form_normal_equations(design, unity, rows, is_present)
    anchor = multiply(invert_matrix(normal, 1e-9), right)
    inverse, share = normal, 0.0
    for turn in range(ROUNDS):
        moments, products, weight, misfit = sum_moments(
            rows, points, (dead + width) * (2.0 if turn == 0 else 1.5)
        )
        normal, right = form_normal_equations(design, moments, products, is_present)
        trace = 0.0
        for q in range(len(normal)):
            trace += normal[q, q]
        ridge, share = 1e-6 * max(trace / len(normal), 1e-6), misfit / max(weight, 1.0)
        inverse = invert_matrix(normal, ridge)
        unknowns = multiply(inverse, right + ridge * anchor)
        rows = np.full((len(rows), 3), np.nan)
        for k in range(len(rows)):
            if is_present[k]:
                copy_row(rows[k], multiply(design[k], unknowns))
    return rows, inverse * share, sum_point_costs(rows, points, dead, width)


@compiled
def form_normal_equations(design, moments, products, is_present):
    """Return the matrix (p, p) and right side (p,) of least squares for planes (5, 3).

    The planes are `design` (5, 3, p) times p unknowns.
    """
    size = design.shape[2]
    matrix, right = np.zeros((size, size)), np.zeros(size)
    for k in range(len(design)):
        if not is_present[k]:
            continue
        for i in range(3):
            for a in range(size):
                right[a] += design[k, i, a] * products[k, i]
                if design[k, i, a] != 0.0:
                    for j in range(3):
                        for b in range(size):
                            matrix[a, b] += design[k, i, a] * moments[k, i, j] * design[k, j, b]
    return matrix, right


@compiled
def invert_matrix(matrix, ridge):
    """Invert a symmetric matrix (p, p), none of whose eigenvalues is negative.

    It uses the method of Gauss and Jordan. `ridge` is added along the diagonal.
    """
    size = len(matrix)
    rows, inverse = matrix.copy(), np.zeros((size, size))
    for k in range(size):
        rows[k, k] += ridge
        inverse[k, k] = 1.0
    for k in range(size):
        pivot = rows[k, k]
        for j in range(size):
            rows[k, j] /= pivot
            inverse[k, j] /= pivot
        for i in range(size):
            factor = rows[i, k]
            if i != k and factor != 0.0:
                for j in range(size):
                    rows[i, j] -= factor * rows[k, j]
                    inverse[i, j] -= factor * inverse[k, j]
    return inverse


@compiled
def multiply(matrix, vector):
    """Multiply a matrix (m, p) and a vector (p,), without a library to load."""
    product = np.zeros(len(matrix))
    for i in range(len(matrix)):
        for j in range(len(vector)):
            product[i] += matrix[i, j] * vector[j]
    return product


@compiled
def sum_moments(rows, points, scale):
    """Sum up the moments of `points` (3, m) about the lowest of the planes (5, 3).

    Each has a biweight of that scale. Returns sums (5, 3, 3) of the products of u, v, 1, and (5, 3)
    of these with z, the sum of the weights, and that of the weighted squared residuals.
    """
    moments, products = np.zeros((len(rows), 3, 3)), np.zeros((len(rows), 3))
    total = misfit = 0.0
    position = np.ones(3)
    for i in range(points.shape[1]):
        position[0], position[1], z = points[0, i], points[1, i], points[2, i]
        h, plane = find_lowest_row(rows, position[0], position[1])
        w = 1.0 - ((z - h) / scale) ** 2
        if w <= 0.0:
            continue
        w *= w
        total += w
        misfit += w * (z - h) ** 2
        for p in range(3):
            products[plane, p] += w * position[p] * z
            for q in range(3):
                moments[plane, p, q] += w * position[p] * position[q]
    return moments, products, total, misfit


@compiled
def sum_point_costs(rows, points, dead, width):
    """Sum up what `points` (3, m) cost under the planes (5, 3)."""
    total = 0.0
    for i in range(points.shape[1]):
        h, _ = find_lowest_row(rows, points[0, i], points[1, i])
        total += compute_point_cost(points[2, i], h, dead, width)
    return total


def is_proper(rows: np.ndarray, walls: tuple[OutlineWall, ...] = ()) -> bool:
    """Return whether every inclined plane rises from its own side or wall.

    It is neither too flat nor too steep.
    """
    left, right, front, back = rows[:N_SIDES, :2].tolist()
    slopes = [left[0], -right[0], front[1], -back[1]]
    if walls:
        slopes += measure_slopes(walls, rows[LEVEL + 1 :])
    return all(FLATTEST < slope < SLOPE_HIGH for slope in slopes if math.isfinite(slope))


def measure_slopes(walls: tuple[OutlineWall, ...], rows: np.ndarray) -> list[float]:
    """Return by how much planes (c, 3) rise from their walls."""
    return [float(row[:2] @ wall.depth[:2]) for wall, row in zip(walls, rows, strict=True)]
