"""Estimate how well points determine the unknowns of a roof, and the places of its sides."""

from __future__ import annotations

import math

import numpy as np

from ...compiled import compiled
from ...geometry.arrays import measure_range
from ..misfit import compute_point_cost
from .draw import compute_height
from .price import (
    OVER_M,
    list_points,
    list_view,
    sum_normal_equations,
    widen,
)
from .tables import (
    FAR_M,
    LINE_COUNT,
    N_SIDES,
    UNKNOWN_COUNT,
    VOLUME_COUNT,
    VOLUME_PLANES,
    Tables,
    copy_tables,
    make_tables,
)

ONE_LINE = 1e-4  # Lines whose coefficients differ less (m, radians) are one.
SHOWN_M = 0.5  # Distance (m) next to a side in which points need its volume, unless it is hidden.
MOVED_M = 1.0  # Furthest (m) that a side is moved to see how well points determine its place.
MOVES = 50  # Steps in which it is moved each way.
NATS_A_POINT = 3.0  # Log-likelihood that a point makes if it is explained.
LEAST_NEED = 0.3  # A point that costs so much more without a volume needs it.
FEWEST_NEEDED = 3  # Fewer such points show nothing.
# Standard deviation (m) of a swath's place in plan, which no point of a building determines: roofs
# lie so far beside their outline.
REGISTERED_PLAN_M = 0.03
# Standard deviation (m) of a swath's height, which no point of a building determines.
REGISTERED_M = 0.01
POINT_SIGMA_M = 0.03  # Standard deviation (m) of points in plan, of their swath and in their beam.
LEAST_KNOWN = 0.05  # A place so likely at the end of the way is not determined.
TINY = 1e-12  # Numerically nothing.
LOOSE_POINTS = 1e-6  # Weight (points) of an unknown that no point determines.


def find_anchored(roof: Tables, site) -> np.ndarray:
    """Return which lines (l,) of a roof are lines of the outline."""
    lines = roof.lines[: roof.counts[LINE_COUNT], None, :3]
    gaps = [np.abs(lines - sign * site.lines[None, :, :3]).max(axis=2) for sign in (1.0, -1.0)]
    return (np.minimum(*gaps) < ONE_LINE).any(axis=1)


def estimate_covariance(roof: Tables, site) -> tuple[Tables, np.ndarray]:
    """Return a roof whose planes share no unknowns, and the covariance (f, f) of these.

    Three things make errors of a plane: the noise of the points that its shared unknowns have, the
    registration of swaths, and what is shared though it is not equal. The last shows where opposite
    planes by themselves would lie elsewhere, further than noise explains.
    """
    free, shared, pairs = free_planes(roof)
    boxes = np.array([[-np.inf, np.inf, -np.inf, np.inf]])
    view, points, n = list_view(free, boxes), list_points(site, boxes), len(shared)
    matrix, vector = np.zeros((n, n)), np.zeros(n)
    explained, squares = sum_normal_equations(
        free, site, view, points, np.arange(n), matrix, vector
    )
    noise = invert_shared(matrix, shared)
    variance = max(squares / max(explained - roof.counts[UNKNOWN_COUNT], 1), TINY)
    planes = np.concatenate([roof.planes[k, : roof.n_planes[k]] for k in view])
    moved = np.zeros((n, 3))  # what a shift and a rise of the points change
    moved[: len(planes), :2] = -REGISTERED_PLAN_M * planes[:, :2]
    moved[: len(planes), 2] = REGISTERED_M
    residual = matrix - matrix @ noise @ matrix
    misfit = vector - matrix @ free.values[:n]
    spread = variance * np.linalg.inv(moved.T @ residual @ moved + variance * np.eye(3))
    shift = spread @ moved.T @ misfit / variance
    unshared = measure_unshared(
        matrix, misfit - residual @ moved @ shift, variance * residual, pairs
    )
    change = noise @ matrix @ moved
    registered = change @ (spread + np.outer(shift, shift)) @ change.T
    return free, variance * noise + registered + np.outer(unshared, unshared)


def measure_unshared(
    matrix: np.ndarray, misfit: np.ndarray, covariance: np.ndarray, pairs: np.ndarray
) -> np.ndarray:
    """Return how far (f,) unknowns lie from where those of opposite planes would by themselves.

    `misfit` (f,) is the gradient at the shared ones, with its `covariance` (f, f) if that is noise.
    What a pair has more than noise counts (James and Stein 1961).
    """
    inverse = invert_shared(matrix, pairs)
    unshared, owners = inverse @ misfit, pairs // 2
    squares = np.bincount(owners, unshared * misfit)
    expected = np.bincount(owners, np.diag(inverse @ covariance))
    kept = np.maximum(1.0 - expected / np.maximum(squares, TINY), 0.0)
    return unshared * kept[owners]


def invert_shared(matrix: np.ndarray, shared: np.ndarray) -> np.ndarray:
    """Return the inverse (f, f) of normal equations of unknowns that have `shared` (f,) values."""
    ties = np.eye(shared.max() + 1)[shared]
    loose = LOOSE_POINTS * np.eye(ties.shape[1])
    return ties @ np.linalg.inv(ties.T @ matrix @ ties + loose) @ ties.T


def free_planes(roof: Tables) -> tuple[Tables, np.ndarray, np.ndarray]:
    """Return a copy of a roof with a height and a slope for each plane.

    With it come the unknown (f,) of the roof that each of these was, and the numbers (f,) that they
    have if only opposite planes of a volume share: twice that of the pair, and one more for slopes.
    """
    is_plane = np.arange(VOLUME_PLANES) < roof.n_planes[: roof.counts[VOLUME_COUNT], None]
    places = owners, _ = np.nonzero(is_plane)
    heights, slopes, n = roof.heights[places], roof.slopes[places], len(owners)
    lines = roof.lines[np.abs(roof.plane_lines[places]) - 1]
    angles = np.arctan2(lines[:, 1], lines[:, 0])
    turns = np.round((angles - angles[np.searchsorted(owners, owners)]) * (4.0 / math.pi)) % 4
    keys = np.column_stack([owners, heights, slopes, turns])
    pairs = 2 * np.unique(keys, axis=0, return_inverse=True)[1].ravel()
    shared = np.concatenate([heights, np.where(slopes < 0, heights, slopes)])
    free = make_tables(len(roof.sides), len(roof.lines), 2 * VOLUME_PLANES * len(roof.sides))
    copy_tables(roof, free)
    free.heights[places] = np.arange(n)
    free.slopes[places] = np.where(slopes < 0, slopes, n + np.arange(n))
    free.values[: 2 * n] = roof.values[shared]
    free.counts[UNKNOWN_COUNT] = 2 * n
    return free, shared, np.concatenate([pairs, pairs + 1])


@compiled
def estimate_side_sigmas(roof, inner, outer, site, k, anchored):
    """Return the standard deviations (4,) of the places of volume k's sides.

    A side is hidden, and has an infinite one, if no points next to it need its volume. One that is
    `anchored` (4,) to the outline has none, nor has an end out of sight, which is the outline's.
    `inner` and `outer` are room for copies of the roof.
    """
    sigmas = np.full(N_SIDES, np.inf)
    if roof.boxes[k, 1] - roof.boxes[k, 0] >= FAR_M:
        return np.zeros(N_SIDES)
    boxes = widen(roof.boxes[k], MOVED_M).reshape(1, 4)
    view, points = list_view(roof, boxes), list_points(site, boxes)
    moved = (np.arange(2 * MOVES + 1) - MOVES) * MOVED_M / MOVES
    for s in range(N_SIDES):
        move_side(roof, inner, k, s, -MOVED_M)
        move_side(roof, outer, k, s, MOVED_M)
        half, needed, cost = roof.half_planes[k, s], 0, np.zeros(len(moved))
        for m in range(len(points)):
            i = points[m]
            x, y = site.x[i], site.y[i]
            depth = half[0] * x + half[1] * y + half[2]
            if i >= site.n or abs(depth) > MOVED_M:
                continue
            with_it, _, _ = compute_height(outer, view, x, y, OVER_M)
            without, _, _ = compute_height(inner, view, x, y, OVER_M)
            if with_it == without:
                continue
            gain = compute_point_cost(site.z[i], with_it, site.dead, site.width)
            gain -= compute_point_cost(site.z[i], without, site.dead, site.width)
            needed += int(gain < -LEAST_NEED and 0.0 <= depth < SHOWN_M)
            for q in range(len(moved)):
                cost[q] += gain if -depth <= moved[q] else 0.0
        if needed >= FEWEST_NEEDED:
            sigmas[s] = 0.0 if anchored[s] else weigh_places(cost, moved)
    return sigmas


@compiled
def move_side(roof, copy, k, s, out):
    """Set `copy` to the roof with side s of volume k moved out (m)."""
    copy_tables(roof, copy)
    half = copy.half_planes[k, s]
    half[2] += out
    box = copy.boxes[k]
    box[0], box[1] = box[0] - MOVED_M, box[1] + MOVED_M
    box[2], box[3] = box[2] - MOVED_M, box[3] + MOVED_M


@compiled
def weigh_places(cost, moved):
    """Return the standard deviation (m) of a side by what it costs (points) where it is moved.

    `cost` and `moved` (m) are (n,). It is infinite if the side may lie at either end of these.
    """
    weight = np.exp(-NATS_A_POINT * (cost - measure_range(cost)[0]))
    if max(weight[0], weight[-1]) > LEAST_KNOWN * measure_range(weight)[1]:
        return np.inf
    return np.sqrt((weight * moved**2).sum() / weight.sum() + POINT_SIGMA_M**2)
