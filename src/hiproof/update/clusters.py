"""Connected cells in which the new points contradict the earlier roof.

A cell contradicts it where the difference between the surveys is beyond chance, and where neither
survey has points on the other's surface: leaves, a crane or scaffolding let some points through.
Chance makes single such cells, but hardly ever several side by side.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..geometry.components import label_components
from ..geometry.grid import KEY_OF_CELL
from .cells import MEDIAN_VARIANCE, CellComparison

CELL_SIGMAS = 3.3
"""Standard deviations from which on a cell's difference counts: by chance one in a thousand."""

CELL_CHANCE, TAIL_POWER, FARTHEST_SIGMAS = 0.003, 1.5, 10.0
"""Least chance of such a cell, the power of its score by which it falls, and the score from which
on it falls no more. Roofs are not as smooth as their models, so the tail is long: a normal error
would give a thousandth and fall much faster."""

SHAPES_A_CELL = 6.75
"""Growth of the number of shapes of connected cells (polyominoes: at most 27/4 a cell)."""

KEPT_SHARE = 0.25
"""Share of points on the other survey's surface from which on a cell contradicts
nothing: a third of the pulses passes through a crown."""

BLOCK_M, BLOCK_SHARE = 2.0, 0.75
"""Side (m) of a square, and share of its cells that contradict the roof while none agrees, from
which on no step explains it: a step that lies aside makes a strip."""

HEIGHT_STEP_M = 1.0
"""Range (m) of the earlier heights around a cell from which on there is a step or a wall."""

LOG_LEAST = -600.0  # of a chance; float64 holds no smaller one

PLANE_NEIGHBOURS, FEWEST_LOCAL_POINTS, FEWEST_SURFACE_POINTS = 5, 9, 7
"""Points that a local plane is laid through, points below which one plane goes through all, and
points below which chance makes a surface: seven in a crown lie on a plane once in 500 times."""

ROUGH_M = 0.12
"""Scatter (m) of points about local planes, beyond which they lie on no surface: leaves scatter by
decimetres, roofs by the noise of a scanner and a step here and there."""

USUAL_SLOPE, USUAL_NOISE_M = 1.5, 0.05
"""Slope that planes hardly exceed, against the noise (m) of their points: points in a narrow strip
lie on a steep plane otherwise, however much they scatter."""


STRIP_WIDTH_M, STRIP_SHARE = 1.3, 3.0
"""Width (m) below which, and times its length over its width from which on, a cluster is a strip:
the jib of a crane or scaffolding along a wall, hardly a part of a roof."""


@dataclass(frozen=True)
class ChangedCells:
    """Cells that contradict the earlier roof side by side.

    `members` (m,) are numbers of the comparison's cells, `chance` the probability that a building
    without any change shows such a cluster, `difference_m` the median difference with its
    `sigma_m`, and `is_surface` whether the new points lie on a surface.
    """

    members: np.ndarray
    area_m2: float
    chance: float
    difference_m: float
    sigma_m: float
    is_surface: bool


def find_clusters(
    comparison: CellComparison, stray: float = CELL_CHANCE, has_blocks: bool = False
) -> list[ChangedCells]:
    """Return the clusters of a building, the largest first.

    Cells that one survey left empty by chance do not part a cluster.
    `stray` is the share of cells that contradict an unchanged roof. With `has_blocks` whole blocks
    of them do, whatever height lies around.
    """
    c = comparison
    is_other, cells, result = flag_cells(c, has_blocks), int(c.is_compared.sum()), []
    for sign in (1.0, -1.0):
        for members in group_cells(c, is_other & (sign * c.difference > 0)):
            result.append(describe_cluster(c, members, cells, stray))
    return sorted(result, key=lambda cluster: (-len(cluster.members), cluster.members[0]))


def group_cells(
    comparison: CellComparison, is_chosen: np.ndarray, beside: np.ndarray = KEY_OF_CELL
) -> Iterator[np.ndarray]:
    """Yield the members of each group of chosen cells (k,) that lie `beside` each other.

    Cells that one survey left empty by chance do not part a group.
    """
    keys = comparison.cells.astype(np.int64) @ KEY_OF_CELL
    linked = np.flatnonzero(is_chosen | ~comparison.is_compared)
    labels = label_cells(keys[linked], beside)
    for label in np.unique(labels[is_chosen[linked]]):
        members = linked[labels == label]
        yield members[is_chosen[members]]


def measure_roof(comparison: CellComparison, members: np.ndarray) -> float:
    """Return the area (m2) of cells `members` (m,) in which points form a roof, 0 for none."""
    chosen = np.isin(comparison.number, members)
    if not forms_roof(comparison.points[chosen]):
        return 0.0
    return measure_area(comparison, comparison.number[chosen])


def measure_area(comparison: CellComparison, numbers: np.ndarray) -> float:
    """Return the area (m2) that points in the cells `numbers` (n,) stand for."""
    return float((1 / comparison.n_new[numbers]).sum()) * comparison.cell_m2


def forms_roof(points: np.ndarray) -> bool:
    """Return whether points (n, 3) lie on a surface that is no strip."""
    return measure_roughness(points) < ROUGH_M and not is_strip(points)


def flag_cells(comparison: CellComparison, has_blocks: bool = False) -> np.ndarray:
    """Return whether (k,) each cell contradicts the earlier roof, as in `find_clusters`."""
    c = comparison
    with np.errstate(invalid="ignore"):
        score = np.where(c.is_compared, np.abs(c.difference) / c.sigma, 0.0)
    result = (score > CELL_SIGMAS) & (np.maximum(c.kept, c.known) <= KEPT_SHARE)
    if result.any():
        doubted = np.flatnonzero(result & ~find_blocks(c, result) if has_blocks else result)
        result[doubted] = ~is_known_around(c, doubted)
    return result


def find_blocks(comparison: CellComparison, is_other: np.ndarray) -> np.ndarray:
    """Return whether (k,) cells lie in a block of cells that are `is_other` (k,)."""
    c, keys = comparison, comparison.cells.astype(np.int64) @ KEY_OF_CELL
    side = max(2, round(BLOCK_M / c.cell_m))
    inside = np.mgrid[:side, :side].reshape(2, -1).T @ KEY_OF_CELL
    blocks = np.unique(keys[is_other, None] - inside)[:, None] + inside
    is_full = np.isin(blocks, keys[is_other]).mean(axis=1) >= BLOCK_SHARE
    is_full &= ~np.isin(blocks, keys[c.is_compared & ~is_other]).any(axis=1)
    return is_other & np.isin(keys, blocks[is_full])


def is_known_around(comparison: CellComparison, members: np.ndarray) -> np.ndarray:
    """Return whether (m,) the earlier survey shows the new height nearby.

    Nearby is in or around each cell of `members` (m,).

    At a step either survey sees now one side and now the other, or the wall between them. So a
    height does not count that lies among those of the earlier points in the cells around.
    """
    c = comparison
    place = {cell: k for k, cell in enumerate(map(tuple, c.cells.tolist()))}
    order = np.argsort(c.number_old, kind="stable")
    over, ends = c.over_old[order], np.searchsorted(c.number_old[order], range(len(c.cells) + 1))
    result = np.zeros(len(members), bool)
    for n, k in enumerate(members):
        i, j = c.cells[k].tolist()
        around = [place.get((i + u, j + v)) for u in (-1, 0, 1) for v in (-1, 0, 1)]
        heights = np.concatenate([over[ends[q] : ends[q + 1]] for q in around if q is not None])
        near = CELL_SIGMAS * c.sigma[k]
        result[n] = heights.min(initial=np.inf) - near <= c.new[k] <= heights.max(
            initial=-np.inf
        ) + near and (np.ptp(heights) > HEIGHT_STEP_M or np.abs(heights - c.new[k]).min() <= near)
    return result


def label_cells(keys: np.ndarray, beside: np.ndarray) -> np.ndarray:
    """Return the label (k,) of the connected group of each cell, by their numbers `keys` (k,).

    Cells are connected of which one is `beside` the other: with KEY_OF_CELL they share a side, with
    AROUND_KEYS a side or a corner.
    """
    pairs = [np.intersect1d(keys + side, keys, return_indices=True)[1:] for side in beside]
    return label_components(len(keys), np.hstack(pairs))


def describe_cluster(
    comparison: CellComparison, members: np.ndarray, cells: int, stray: float = CELL_CHANCE
) -> ChangedCells:
    """Return the cluster of cells `members` (m,) among so many `cells` of a building."""
    d, s = comparison.difference[members], comparison.sigma[members]
    chosen = find_points(comparison, members, float(np.median(d)))
    points, numbers = comparison.points[chosen], comparison.number[chosen]
    return ChangedCells(
        members,
        measure_area(comparison, numbers),
        compute_chance(len(members), float((np.abs(d) / s).min()), cells, stray),
        float(np.median(d)),
        float(np.sqrt(MEDIAN_VARIANCE * np.mean(s**2) / len(members))),
        forms_roof(points),
    )


def find_points(comparison: CellComparison, members: np.ndarray, difference: float) -> np.ndarray:
    """Return whether (n,) each of the new points belongs to a cluster.

    Those of the cells around it are among them where they lie nearer to its height over the earlier
    roof, by `difference`, than to that roof: a cell at its edge holds points of both.
    """
    c = comparison
    low, high = c.cells[members].min(axis=0) - 1, c.cells[members].max(axis=0) + 1
    box = np.flatnonzero(((c.cells >= low) & (c.cells <= high)).all(axis=1))
    apart = np.abs(c.cells[box, None] - c.cells[members][None]).max(axis=2).min(axis=1)
    around = np.isin(c.number, box[apart <= 1]) & (np.abs(c.over / difference - 1) < 0.5)
    return np.asarray(np.isin(c.number, members) | around)


def is_strip(points: np.ndarray, cell_m: float = 0.0) -> bool:
    """Return whether points (n, 2 or more) lie in a long and narrow strip of the plan.

    Each may be the mean of points in a cell of `cell_m`.
    """
    spread = np.linalg.eigvalsh(np.cov(points[:, :2].T)) + cell_m**2 / 12
    width, length = np.sqrt(12 * np.maximum(spread, 0.0))  # of a strip with even points
    return bool(width < STRIP_WIDTH_M and length > STRIP_SHARE * width)


def compute_chance(size: int, score: float, cells: int, stray: float = CELL_CHANCE) -> float:
    """Return a bound on the chance of `size` connected cells among `cells`.

    Each of them has at least that `score`.

    Every shape may lie anywhere, and each of its cells reaches the score by chance: `stray` is that
    of CELL_SIGMAS.

    >>> round(compute_chance(1, 3.3, 100), 3), round(compute_chance(4, 3.3, 100), 7)
    (0.3, 2.5e-06)
    """
    tail = TAIL_POWER * math.log(CELL_SIGMAS / min(score, FARTHEST_SIGMAS))
    cell = math.log(max(stray, CELL_CHANCE)) + tail
    log = math.log(cells) + (size - 1) * math.log(SHAPES_A_CELL) + size * cell
    return math.exp(min(0.0, max(log, LOG_LEAST)))


def measure_roughness(points: np.ndarray) -> float:
    """Return the median scatter (m) of points (n, 3) about local planes.

    A plane goes through the neighbours of a point.

    It is that of no surface where there are too few points.
    """
    if len(points) < FEWEST_SURFACE_POINTS:
        return math.inf
    from scipy.spatial import KDTree  # only where a building may have changed

    neighbours = PLANE_NEIGHBOURS if len(points) >= FEWEST_LOCAL_POINTS else len(points)
    near = points[KDTree(points).query(points, neighbours)[1]]
    near = near - near.mean(axis=1, keepdims=True)
    xy, z = near[:, :, :2], near[:, :, 2:]
    across = xy.transpose(0, 2, 1)
    ridge = (USUAL_NOISE_M / USUAL_SLOPE) ** 2 * np.eye(2)
    slopes = np.linalg.solve(across @ xy + ridge, across @ z)
    scatter = np.sqrt(((z - xy @ slopes) ** 2).sum(axis=(1, 2)) / (neighbours - 3))
    return float(np.median(scatter))
