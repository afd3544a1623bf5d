"""The planes of every volume fitted to all points over which it shows, along its sides and as regular as the points allow.

Each inclined plane is z = c + s d, with d the distance from the line of its side. Two choices are made by what the points say:
which way the planes face (along the volume's axes, or square to the sides, which seldom are quite at right angles), and whether
the eaves on the outline are at one height. Everything is linear in c and s, so each choice is one re-weighted least squares.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from .scene import Scene
from .sides import Side
from .volumes import (
    ALL,
    DIRECTION,
    LEAN,
    LEVEL,
    OFFSET,
    OPPOSITE,
    PARAMETER_COST,
    SIDES,
    SLOPE,
    SLOPE_HIGH,
    TIE,
    roof_heights,
)

ROUNDS = 3
FEWEST_POINTS = 6
FACING_GAIN = 0.1  # units: planes face other than along the axes only where that explains so much more
LEVEL_SLACK = 0.004  # of a volume's points: what level eaves may leave unexplained besides the parameters they save
SIGN = np.array([1.0, -1.0, 1.0, -1.0])
FLATTEST = 0.02
SQUARE = 1e-3  # a side that leans less is square to the others


@dataclass(frozen=True)
class Planes:
    """A volume's planes by place (left, right, front, back, top): z = a u + b v + c as rows (5, 3), NaN where it has none.

    `modes` (p, 5, 3) are independent changes of one standard deviation each; `cost` is that of their points.
    """

    rows: np.ndarray
    modes: np.ndarray
    cost: float = 0.0


def finished(volumes: np.ndarray, sides: list[list[Side]], scene: Scene) -> list[Planes]:
    """The planes of every volume, in its direction's axes."""
    n = scene.n
    _, top = roof_heights(volumes, np.ascontiguousarray(scene.U[:, :n]), np.ascontiguousarray(scene.V[:, :n]))
    return [
        finished_volume(volume, own, scene, np.nonzero(top == k)[0])
        for k, (volume, own) in enumerate(zip(volumes, sides, strict=True))
    ]


def finished_volume(volume: np.ndarray, sides: list[Side], scene: Scene, members: np.ndarray) -> Planes:
    """One volume's planes from the points `members` (m,) over which it shows."""
    start = planes_as_found(volume)
    there = np.isfinite(volume[OFFSET : OFFSET + LEVEL + 1])
    direction = int(volume[DIRECTION])
    points = np.stack([scene.U[direction][members], scene.V[direction][members], scene.z[members]])
    start = replace(start, cost=cost_of(start.rows, points, scene))
    if len(members) < FEWEST_POINTS:
        return start
    tolerance = scene.dead + scene.width
    base = scene.evidence * PARAMETER_COST
    best, facing = None, None
    for leans in facings(volume[LEAN : LEAN + SIDES], sides, there):
        design = design_of(volume, sides, leans, there, level=())
        found = fitted(start, design, points, scene, tolerance)
        price = FACING_GAIN * base if any(leans) else 0.0
        if best is None or found.cost + price < best.cost - 1e-9:
            best, facing = found, leans
    anchored = tuple(k for k in range(SIDES) if there[k] and sides[k].anchored)
    if len(anchored) > 1:
        square = own_leans(sides, anchored, facing)
        found = fitted(best, design_of(volume, sides, square, there, anchored), points, scene, tolerance)
        if found.cost <= best.cost + base * (len(anchored) - 1) + LEVEL_SLACK * len(members):
            best = found
    if there[:SIDES].all() and not there[LEVEL]:
        leans = own_leans(sides, (0, 1, 2, 3), facing)
        found = fitted(best, one_apex(sides, leans), points, scene, tolerance)
        saved = max(len(set(slope_groups(volume, there))) - 1, 0)
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


def planes_as_found(volume: np.ndarray) -> Planes:
    """The planes that the search left, along the axes."""
    rows = np.full((5, 3), np.nan)
    for k in range(SIDES + 1):
        if volume[OFFSET + k] < np.inf:
            rows[k] = (0.0, 0.0, volume[OFFSET + k])
            if k < LEVEL:
                rows[k, k // 2] = SIGN[k] * volume[SLOPE + k]
                rows[k, 1 - k // 2] = volume[SLOPE + k] * volume[LEAN + k]
    return Planes(rows, np.zeros((0, 5, 3)), np.inf)


def facings(found: np.ndarray, sides: list[Side], there: np.ndarray) -> list[tuple[float, ...]]:
    """Ways (4 leans each) that the planes may face: along the axes, as `found` (4,), each pair square to its sides or one of them."""
    pairs = []
    for low, high in ((0, 1), (2, 3)):
        one, other = (0.0 if abs(lean) < SQUARE else lean for lean in (sides[low].lean, sides[high].lean))
        ways = [(0.0, 0.0), (float(found[low]), float(found[high]))]
        if there[low] or there[high]:
            ways += [(-one, other), (-one, one), (-other, other)]
        pairs.append(list(dict.fromkeys(ways)))
    return [(*u, *v) for u, v in product(*pairs)]


def own_leans(sides: list[Side], anchored: tuple[int, ...], facing: tuple[float, ...]) -> tuple[float, ...]:
    """The leans with those of the `anchored` sides square to their own lines."""
    leans = list(facing)
    for k in anchored:
        lean = 0.0 if abs(sides[k].lean) < SQUARE else sides[k].lean
        leans[k] = -lean if k % 2 == 0 else lean
    return tuple(leans)


def design_of(
    volume: np.ndarray, sides: list[Side], leans: tuple[float, ...], there: np.ndarray, level: tuple[int, ...]
) -> np.ndarray:
    """The planes (5, 3, p) as linear in p unknowns: an offset each, one for all sides that are `level`; slopes as tied."""
    groups = slope_groups(volume, there)
    columns = {place: k for k, place in enumerate(p for p in np.nonzero(there)[0] if p not in level)}
    eave = len(columns)
    width = eave + (1 if level else 0)
    slope_column = {
        group: width + k for k, group in enumerate(dict.fromkeys(groups[k] for k in range(SIDES) if there[k]))
    }
    design = np.zeros((5, 3, width + len(slope_column)))
    for place in np.nonzero(there)[0]:
        design[place, 2, eave if place in level else columns[place]] = 1.0
        if place < LEVEL:
            column = slope_column[groups[place]]
            design[place, place // 2, column] = SIGN[place]
            design[place, 1 - place // 2, column] = leans[place]
            if place in level:
                design[place, 2, column] = -SIGN[place] * sides[place].at
    return design


def slope_groups(volume: np.ndarray, there: np.ndarray) -> list[int]:
    """Which slopes are one under the volume's tie."""
    if volume[TIE] == ALL:
        return [0, 0, 0, 0]
    return [0, 0, 2, 2] if volume[TIE] == OPPOSITE else [0, 1, 2, 3]


def fitted(start: Planes, design: np.ndarray, points: np.ndarray, scene: Scene, tolerance: float) -> Planes:
    """The planes of `design` by biweighted least squares from `start` on `points` (3, m), and their cost."""
    u, v, z = points
    there = np.isfinite(start.rows[:, 2])
    plan = np.stack([u, v, np.ones_like(u)], axis=1)
    rows, modes = start.rows, start.modes
    anchor = np.linalg.lstsq(design[there].reshape(-1, design.shape[2]), rows[there].ravel(), rcond=None)[0]
    for turn in range(ROUNDS):
        active, height = lowest_of(rows, plan)
        weight = np.clip(1.0 - ((z - height) / (tolerance * (2.0 if turn == 0 else 1.5))) ** 2, 0.0, None) ** 2
        x = np.einsum("mi,mip->mp", plan, design[active])
        normal = (x * weight[:, None]).T @ x
        ridge = 1e-6 * max(np.trace(normal) / len(normal), 1e-6)
        inverse = np.linalg.inv(normal + ridge * np.eye(len(normal)))
        unknowns = inverse @ (x.T @ (weight * z) + ridge * anchor)
        new = design @ unknowns
        new[~there] = np.nan
        variance = float((weight * (z - height) ** 2).sum() / max(weight.sum(), 1.0))
        spread = np.linalg.cholesky(inverse) * np.sqrt(variance)
        rows, modes = new, np.moveaxis(design @ spread, 2, 0)
    if not proper(rows):
        return start
    return Planes(rows, modes, cost_of(rows, points, scene))


def cost_of(rows: np.ndarray, points: np.ndarray, scene: Scene) -> float:
    """What `points` (3, m) cost under the planes."""
    u, v, z = points
    _, height = lowest_of(rows, np.stack([u, v, np.ones_like(u)], axis=1))
    r = np.clip((np.abs(z - height) - scene.dead) / scene.width, 0.0, 1.0)
    return float((r**2).sum())


def lowest_of(rows: np.ndarray, plan: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which plane is the lowest at points (m, 3) of u, v, 1, and its height."""
    heights = np.where(np.isfinite(rows[:, 2]), plan @ np.nan_to_num(rows).T, np.inf)
    active = heights.argmin(axis=1)
    return active, heights[np.arange(len(plan)), active]


def proper(rows: np.ndarray) -> bool:
    """Whether every inclined plane rises from its own side, neither too flat nor too steep."""
    slope = SIGN * np.array([rows[0, 0], rows[1, 0], rows[2, 1], rows[3, 1]])
    slope = slope[np.isfinite(slope)]
    return bool((slope > FLATTEST).all() and (slope < SLOPE_HIGH).all())
