"""The planes of every volume fitted to all points over which it shows, along its sides and as regular as the points allow.

Each inclined plane is z = c + s d, with d the distance from the line of its side. Two choices are made by what the points say:
which way the planes face (along the volume's axes, or square to the sides, which seldom are quite at right angles), and whether
the eaves on the outline are at one height. Everything is linear in c and s, so each choice is one re-weighted least squares.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...compiled import compiled
from .objective import point_cost
from .prices import PARAMETER_COST
from .scene import Scene
from .sides import Side
from .volumes import (
    ALL,
    DIRECTION,
    LEAN,
    LEVEL,
    OFFSET,
    OPPOSITE,
    SIDES,
    SLOPE,
    SLOPE_HIGH,
    TIE,
    roof_heights,
)

ROUNDS = 3  # of fitting and re-weighting
FEWEST_POINTS = 6  # points; with fewer a volume's planes stay as the search found them
FACING_GAIN = 0.1  # units: planes face other than along the axes only where that explains so much more
LEVEL_SLACK = 0.004  # of the points: what level eaves, or what volumes agree in, may leave unexplained besides the parameters saved
SIGN = (1.0, -1.0, 1.0, -1.0)  # the plane from the left rises to +u, from the right to -u, ...
FLATTEST = 0.02  # rise over run; a flatter plane does not tell which way it faces
SQUARE = 1e-3  # a side that leans less is square to the others


class Wall(NamedTuple):
    """A wall of the outline in a volume's axes: the way it looks out (rad), and how far out that way from the origin it lies (m)."""

    facing: float
    offset: float

    @property
    def depth(self) -> np.ndarray:
        """How deep inside of it places lie: what u, v, 1 are multiplied with (3,)."""
        return np.array([-math.cos(self.facing), -math.sin(self.facing), self.offset])


@dataclass(frozen=True)
class Planes:
    """A volume's planes by place (left, right, front, back, top, over each of `walls`): z = a u + b v + c as rows (k, 3), NaN where it
    has none.

    `cost` is that of their points, `price` that of the parameters of those over walls. They are `design` (k, 3, p) times p unknowns with
    this `covariance` (p, p).
    """

    rows: np.ndarray
    cost: float
    design: np.ndarray
    covariance: np.ndarray
    walls: tuple[Wall, ...] = ()
    price: float = 0.0

    @property
    def inclined(self) -> int:
        """How many planes rise from sides."""
        return int(np.isfinite(self.rows[:LEVEL, 2]).sum())

    @property
    def modes(self) -> np.ndarray:
        """Independent changes (k, 3, p) of the rows, of one standard deviation each."""
        variances, axes = np.linalg.eigh(self.covariance)
        return self.design @ (axes * np.sqrt(np.maximum(variances, 0.0)))


def shown_points(volumes: np.ndarray, scene: Scene) -> list[np.ndarray]:
    """The points (m,) over which each volume shows, by their numbers."""
    n = scene.n
    _, top = roof_heights(volumes, np.ascontiguousarray(scene.U[:, :n]), np.ascontiguousarray(scene.V[:, :n]))
    return [np.nonzero(top == k)[0] for k in range(len(volumes))]


def points_of(volume: np.ndarray, members: np.ndarray, scene: Scene) -> np.ndarray:
    """The points `members` (m,) in a volume's own axes: u, v, z (3, m)."""
    direction = int(volume[DIRECTION])
    return np.array([scene.U[direction][members], scene.V[direction][members], scene.z[members]])


def finished_volume(volume: np.ndarray, sides: list[Side], scene: Scene, members: np.ndarray) -> Planes:
    """One volume's planes from the points `members` (m,) over which it shows."""
    there = np.flatnonzero(volume[OFFSET : OFFSET + LEVEL + 1] < np.inf).tolist()
    points = points_of(volume, members, scene)
    start = planes_as_found(volume, there, points, scene)
    if len(members) < FEWEST_POINTS:
        return start
    base = scene.evidence * PARAMETER_COST
    facing: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    best = fitted(start, design_of(volume, sides, facing, there, level=()), points, scene)
    for pair in (0, 2):
        for way in facings(volume[LEAN : LEAN + SIDES], sides, there, pair):
            leans = (*facing[:pair], *way, *facing[pair + 2 :])
            found = fitted(start, design_of(volume, sides, leans, there, level=()), points, scene)
            if found.cost + FACING_GAIN * base < best.cost - 1e-9:
                best, facing = found, leans
    anchored = tuple(k for k in there if k < LEVEL and sides[k].anchored)
    if len(anchored) > 1:
        square = own_leans(sides, anchored, facing)
        found = fitted(best, design_of(volume, sides, square, there, anchored), points, scene)
        if found.cost <= best.cost + base * (len(anchored) - 1) + LEVEL_SLACK * len(members):
            best = found
    if there == [*range(SIDES)]:
        leans = own_leans(sides, (0, 1, 2, 3), facing)
        found = fitted(best, one_apex(sides, leans), points, scene)
        saved = max(len(set(slope_groups(volume))) - 1, 0)
        if found.cost <= best.cost + base * saved + LEVEL_SLACK * len(members):
            best = found
    return best


def one_apex(sides: list[Side], leans: tuple[float, ...]) -> np.ndarray:
    """The four planes (5, 3, 2) of a pyramid over the sides as linear in its eave's height and its rise."""
    design = np.zeros((5, 3, 2))
    for k in range(SIDES):
        half = 0.5 * (sides[k | 1].at - sides[k & 2].at)
        design[k, 2, 0] = 1.0
        design[k, k // 2, 1] = SIGN[k] / half
        design[k, 1 - k // 2, 1] = leans[k] / half
        design[k, 2, 1] = -SIGN[k] * sides[k].at / half
    return design


def planes_as_found(volume: np.ndarray, there: list[int], points: np.ndarray, scene: Scene) -> Planes:
    """The planes that the search left, along the axes, over their `points` (3, m)."""
    rows = np.full((SIDES + 1, 3), np.nan)
    for k in there:
        rows[k] = (0.0, 0.0, volume[OFFSET + k])
        if k < LEVEL:
            rows[k, k // 2] = SIGN[k] * volume[SLOPE + k]
            rows[k, 1 - k // 2] = volume[SLOPE + k] * volume[LEAN + k]
    cost = cost_of(rows, points, scene.dead, scene.width)
    return Planes(rows, cost, np.zeros((SIDES + 1, 3, 0)), np.zeros((0, 0)))


def found_planes(volume: np.ndarray, scene: Scene) -> Planes:
    """The planes of a volume as the search left them."""
    there = np.flatnonzero(np.isfinite(volume[OFFSET : OFFSET + LEVEL + 1])).tolist()
    return planes_as_found(volume, there, np.zeros((3, 0)), scene)


def facings(found: np.ndarray, sides: list[Side], there: list[int], pair: int) -> list[tuple[float, float]]:
    """Ways (2 leans each) for planes `pair` and the next to face other than along the axis: as `found` (4,), square to their
    sides or both to one of them. A plane that is not `there` has no lean."""
    one, other = (0.0 if abs(side.lean) < SQUARE else side.lean for side in sides[pair : pair + 2])
    ways = [(float(found[pair]), float(found[pair + 1])), (-one, other), (-one, one), (-other, other)]
    low, high = pair in there, pair + 1 in there
    return [way for way in dict.fromkeys((low * a, high * b) for a, b in ways) if any(way)]


def own_leans(sides: list[Side], anchored: tuple[int, ...], facing: tuple[float, ...]) -> tuple[float, ...]:
    """The leans with those of the `anchored` sides square to their own lines."""
    leans = list(facing)
    for k in anchored:
        lean = 0.0 if abs(sides[k].lean) < SQUARE else sides[k].lean
        leans[k] = -lean if k % 2 == 0 else lean
    return tuple(leans)


def design_of(
    volume: np.ndarray, sides: list[Side], leans: tuple[float, ...], there: list[int], level: tuple[int, ...]
) -> np.ndarray:
    """The planes (5, 3, p) as linear in p unknowns: an offset each, one for all sides that are `level`; slopes as tied."""
    groups = slope_groups(volume)
    offsets = [place for place in there if place not in level]
    slopes = list(dict.fromkeys(groups[place] for place in there if place < LEVEL))
    eave, width = len(offsets), len(offsets) + bool(level)
    design = np.zeros((SIDES + 1, 3, width + len(slopes)))
    for place in there:
        design[place, 2, eave if place in level else offsets.index(place)] = 1.0
        if place < LEVEL:
            column = width + slopes.index(groups[place])
            design[place, place // 2, column] = SIGN[place]
            design[place, 1 - place // 2, column] = leans[place]
            if place in level:
                design[place, 2, column] = -SIGN[place] * sides[place].at
    return design


def slope_groups(volume: np.ndarray) -> list[int]:
    """Which slopes are one under the volume's tie."""
    if volume[TIE] == ALL:
        return [0, 0, 0, 0]
    return [0, 0, 2, 2] if volume[TIE] == OPPOSITE else [0, 1, 2, 3]


def fitted(start: Planes, design: np.ndarray, points: np.ndarray, scene: Scene) -> Planes:
    """The planes of `design` (5, 3, p) by biweighted least squares from `start` on `points` (3, m); `start` where they are improper."""
    rows, covariance, cost = least_squares(start.rows, design, points, scene.dead, scene.width)
    return Planes(rows, cost, design, covariance) if proper(rows) else start


@compiled
def least_squares(rows, design, points, dead, width):
    """Rows (5, 3), the unknowns' covariance (p, p) and the points' cost; unknowns that no point determines stay as they were."""
    unity, there = np.zeros((len(rows), 3, 3)), np.isfinite(rows[:, 2])
    for k in range(len(rows)):
        for i in range(3):
            unity[k, i, i] = 1.0
    normal, right = normal_equations(design, unity, rows, there)
    anchor = times(inverse_of(normal, 1e-9), right)
    inverse, share = normal, 0.0
    for turn in range(ROUNDS):
        moments, products, weight, misfit = weighted_moments(rows, points, (dead + width) * (2.0 if turn == 0 else 1.5))
        normal, right = normal_equations(design, moments, products, there)
        ridge, share = 1e-6 * max(np.trace(normal) / len(normal), 1e-6), misfit / max(weight, 1.0)
        inverse = inverse_of(normal, ridge)
        unknowns = times(inverse, right + ridge * anchor)
        rows = np.full_like(rows, np.nan)
        for k in range(len(rows)):
            if there[k]:
                rows[k] = times(design[k], unknowns)
    return rows, inverse * share, cost_of(rows, points, dead, width)


@compiled
def normal_equations(design, moments, products, there):
    """The matrix (p, p) and right side (p,) of least squares for planes (5, 3) that are `design` (5, 3, p) times p unknowns."""
    size = design.shape[2]
    matrix, right = np.zeros((size, size)), np.zeros(size)
    for k in range(len(design)):
        if not there[k]:
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
def inverse_of(matrix, ridge):
    """The inverse of a symmetric matrix (p, p) with no negative eigenvalue, `ridge` added along its diagonal (Gauss and Jordan)."""
    size = len(matrix)
    left, inverse = matrix + ridge * np.eye(size), np.eye(size)
    for k in range(size):
        pivot = left[k, k]
        for j in range(size):
            left[k, j] /= pivot
            inverse[k, j] /= pivot
        for i in range(size):
            factor = left[i, k]
            if i != k and factor != 0.0:
                for j in range(size):
                    left[i, j] -= factor * left[k, j]
                    inverse[i, j] -= factor * inverse[k, j]
    return inverse


@compiled
def times(matrix, vector):
    """Matrix (m, p) times vector (p,), without a library of linear algebra to load."""
    product = np.zeros(len(matrix))
    for i in range(len(matrix)):
        for j in range(len(vector)):
            product[i] += matrix[i, j] * vector[j]
    return product


@compiled
def lowest_row(rows, u, v):
    """Height at u, v of the lowest of planes (5, 3), NaN where there is none, and its index."""
    best, plane = np.inf, 0
    for k in range(len(rows)):
        h = rows[k, 0] * u + rows[k, 1] * v + rows[k, 2]
        if h < best:
            best, plane = h, k
    return best, plane


@compiled
def weighted_moments(rows, points, scale):
    """Of `points` (3, m) about the planes (5, 3), each with a biweight of that scale and with the plane that is lowest there:

    sums (5, 3, 3) of the products of u, v, 1, and (5, 3) of these with z; the sum of the weights, and of the weighted squares
    of what is left.
    """
    moments, products = np.zeros((len(rows), 3, 3)), np.zeros((len(rows), 3))
    total = misfit = 0.0
    at = np.ones(3)
    for i in range(points.shape[1]):
        at[0], at[1], z = points[0, i], points[1, i], points[2, i]
        h, plane = lowest_row(rows, at[0], at[1])
        w = 1.0 - ((z - h) / scale) ** 2
        if w <= 0.0:
            continue
        w *= w
        total += w
        misfit += w * (z - h) ** 2
        for p in range(3):
            products[plane, p] += w * at[p] * z
            for q in range(3):
                moments[plane, p, q] += w * at[p] * at[q]
    return moments, products, total, misfit


@compiled
def cost_of(rows, points, dead, width):
    """What `points` (3, m) cost under the planes (5, 3)."""
    total = 0.0
    for i in range(points.shape[1]):
        h, _ = lowest_row(rows, points[0, i], points[1, i])
        total += point_cost(points[2, i], h, dead, width)
    return total


def proper(rows: np.ndarray, walls: tuple[Wall, ...] = ()) -> bool:
    """Whether every inclined plane rises from its own side or wall, neither too flat nor too steep."""
    left, right, front, back = rows[:SIDES, :2].tolist()
    slopes = [left[0], -right[0], front[1], -back[1]]
    if walls:
        slopes += slopes_over(walls, rows[LEVEL + 1 :])
    return all(FLATTEST < slope < SLOPE_HIGH for slope in slopes if math.isfinite(slope))


def slopes_over(walls: tuple[Wall, ...], rows: np.ndarray) -> list[float]:
    """By how much planes (c, 3) rise from their walls."""
    return [float(row[:2] @ wall.depth[:2]) for wall, row in zip(walls, rows, strict=True)]
