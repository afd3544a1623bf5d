"""Fit shapes that are as long as they are wide: spires of equal sides and onions.

A free plan has the rectangle of the points for its own, which holds for neither: no point lies
where a circle touches it, and a hexagon is longer from corner to corner. Here the middle and what
else the points determine are fitted at once, by distances at right angles.
"""

from __future__ import annotations

import numpy as np

from ..primitives.contract import CX, CY, HALF_LENGTH, HALF_WIDTH, KAPPA, Q0, Q1, Q2, Primitive

# What points determine of each shape. Of a spire, they show no width.
REGULAR = {
    "broach": (CX, CY, KAPPA, Q0, Q1),
    "hexagonal_spire": (CX, CY, KAPPA, Q0, Q1),
    "onion": (CX, CY, HALF_WIDTH, Q0, Q1, Q2),
}
REGULAR_ROUNDS = 6  # Steps to the optimum. The last ones move it by millimetres.
LEAST_REACH_M = 0.12  # Points nearer than this, at right angles, always count.
MEDIANS = 3.0  # Points further off than so many medians of the distances do not count.
WIDTH_ROUNDS = 2  # Rounds in which points are taken from within the plan.
BENDS_STARTED = 4  # Starts of a shape with a top of its own, by how far that bends up.
MOST_MOVE = 0.3  # Share of its half width by which a plan moves or widens at most.
UNKNOWN_M2 = 1e8  # Variance (m2) of what no points show.
STEP = 1e-4  # Step (m, rad or slope) of numerical derivatives.
PLAN_STEP_M = 0.05  # Step (m) over which slopes are measured: as far as points lie off in plan.


def fit_regular(
    points: np.ndarray, shape: Primitive, theta: np.ndarray, free: tuple[int, ...] = ()
) -> np.ndarray:
    """Fit theta (9,) of a shape as long as wide to points (n, 3) from a start.

    Only the numbers `free` are fitted, by default all
    that the points determine.
    """
    shape, free = shape.variant(shape.from_theta(theta)[0]), free or REGULAR[shape.name]
    starts = [theta]
    if shape.minima:  # Its top has few points, which a start that is not near leaves out.
        for bend in np.linspace(*shape.bounds[-1], BENDS_STARTED):
            starts.append(theta.copy())
            starts[-1][shape.theta_size - 1] = bend
    for _ in range(WIDTH_ROUNDS):
        inside = points[np.hypot(*(points[:, :2] - theta[:2]).T) <= theta[HALF_WIDTH]]
        fits = [approach(inside, shape, start, free) for start in starts]
        theta = min(fits, key=lambda one: one[0])[1]
        starts = [theta]
    return theta


def approach(
    points: np.ndarray, shape: Primitive, theta: np.ndarray, free: tuple[int, ...]
) -> tuple[float, np.ndarray]:
    """Move the numbers `free` of theta to where points (n, 3) lie near.

    Returns how far they lie (m, mean), each at most twice LEAST_REACH_M, and theta (9,).
    """
    numbers = list(range(Q1, shape.theta_size))
    lowest, highest = np.transpose(shape.bounds)
    plan, reach_m = [CX, CY, HALF_WIDTH], MOST_MOVE * theta[HALF_WIDTH]
    nearest, farthest = theta[plan] - reach_m, theta[plan] + reach_m
    for _ in range(REGULAR_ROUNDS):
        weights = measure_leans(points, shape, theta)
        off = points[:, 2] - shape.height_at(theta, points[:, :2])
        distances = np.abs(off) * weights
        reach = max(LEAST_REACH_M, MEDIANS * float(np.median(distances))) if len(off) else 0.0
        left = average_distances(distances)
        weights *= distances <= reach
        if np.count_nonzero(weights) < 2 * len(free):
            break
        design = np.column_stack([measure_change(points, shape, theta, k, STEP) for k in free])
        move = np.linalg.lstsq(design * weights[:, None], off * weights, rcond=None)[0]
        theta, half_width = theta.copy(), theta[HALF_WIDTH]
        theta[list(free)] += move
        theta[numbers] = np.clip(theta[numbers], lowest, highest)
        theta[plan] = np.clip(theta[plan], nearest, farthest)
        theta[HALF_LENGTH] *= theta[HALF_WIDTH] / half_width
    return left, theta


def find_covariance(
    points: np.ndarray,
    shape: Primitive,
    theta: np.ndarray,
    free: tuple[int, ...] = (),
    width_variance: float = 0.0,
) -> np.ndarray:
    """Find the covariance (9, 9) of theta whose numbers `free` `fit_regular` finds.

    It follows from the distances at right angles of those points (n, 3) that count. All other
    numbers are taken as known, but for half a width with a variance (m2).
    """
    free = free or REGULAR[shape.name]
    shape = shape.variant(shape.from_theta(theta)[0])
    inside = points[np.isfinite(shape.part(theta).height_at(points[:, :2]))]
    if len(inside) < 2 * len(free):
        return np.diag(np.full(9, UNKNOWN_M2))
    leans = measure_leans(inside, shape, theta)
    off = (inside[:, 2] - shape.height_at(theta, inside[:, :2])) * leans
    counts = np.abs(off) <= max(LEAST_REACH_M, MEDIANS * float(np.median(np.abs(off))))
    changes = [measure_change(inside, shape, theta, k, STEP) for k in free]
    design = np.column_stack(changes)[counts] * leans[counts, None]
    spread = float((off[counts] ** 2).sum()) / max(len(design) - len(free), 1)
    inverse, result = np.linalg.pinv(design.T @ design), np.zeros((9, 9))
    both = [HALF_WIDTH, HALF_LENGTH]
    result[np.ix_(both, both)] = width_variance
    rows = [*free, HALF_LENGTH] if HALF_WIDTH in free else list(free)
    ties = [free.index(HALF_WIDTH if k == HALF_LENGTH else k) for k in rows]
    result[np.ix_(rows, rows)] = spread * inverse[np.ix_(ties, ties)]
    return result


def measure_misfit(points: np.ndarray, shape: Primitive, theta: np.ndarray) -> float:
    """Measure how far points (n, 3) lie from a shape (m, mean), at right angles."""
    off = points[:, 2] - shape.height_at(theta, points[:, :2])
    return average_distances(np.abs(off) * measure_leans(points, shape, theta))


def average_distances(distances: np.ndarray) -> float:
    """Return the mean of distances (n,), each at most twice LEAST_REACH_M."""
    return float(np.minimum(distances, 2.0 * LEAST_REACH_M).mean()) if len(distances) else 0.0


def measure_leans(points: np.ndarray, shape: Primitive, theta: np.ndarray) -> np.ndarray:
    """Measure the distances (n,) at right angles to a shape of points 1 m above it.

    Its slopes at the points (n, 3) are measured over as far as they lie off in plan.
    """
    slopes = (measure_change(points, shape, theta, k, PLAN_STEP_M) for k in (CX, CY))
    return 1.0 / np.hypot(1.0, np.hypot(*slopes))


def measure_change(
    points: np.ndarray, shape: Primitive, theta: np.ndarray, k: int, step: float
) -> np.ndarray:
    """Measure how the heights (n,) of a shape change with number `k` of theta."""
    if k == Q0:
        return np.ones(len(points))
    ends = []
    for way in (-step, step):
        moved = theta.copy()
        moved[[k, HALF_LENGTH] if k == HALF_WIDTH else k] += way
        ends.append(shape.height_at(moved, points[:, :2]))
    return (ends[1] - ends[0]) / (2.0 * step)


def list_heights(shape: Primitive) -> tuple[int, ...]:
    """List the numbers of theta that do not change a shape's plan."""
    return tuple(range(Q0, shape.theta_size))
