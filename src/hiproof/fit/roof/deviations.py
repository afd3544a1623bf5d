"""Estimate how well points determine the unknowns of a roof, and the places of its sides."""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from ...geometry.arrays import measure_range
from ..union.objective import compute_point_cost
from .draw import compute_height
from .price import (
    OVER_M,
    list_points,
    list_unknowns,
    list_view,
    sum_normal_equations,
)
from .tables import FAR_M, LINE_COUNT, N_SIDES, Tables, copy_tables

ONE_LINE = 1e-4  # Lines whose coefficients differ less (m, radians) are one.
SHOWN_M = 0.5  # Distance (m) next to a side in which points need its volume, unless it is hidden.
MOVED_M = 1.0  # Furthest (m) that a side is moved to see how well points determine its place.
MOVES = 50  # Steps in which it is moved each way.
NATS_A_POINT = 3.0  # Log-likelihood that a point makes if it is explained.
LEAST_NEED = 0.3  # A point that costs so much more without a volume needs it.
FEWEST_NEEDED = 3  # Fewer such points show nothing.
POINT_SIGMA_M = 0.03  # Standard deviation (m) of points in plan, of their swath and in their beam.
LEAST_KNOWN = 0.05  # A place so likely at the end of the way is not determined.
LOOSE_POINTS = 1e-6  # Weight (points) of an unknown that no point determines.


def find_anchored(roof: Tables, site) -> np.ndarray:
    """Return which lines (l,) of a roof are lines of the outline."""
    lines = roof.lines[: roof.counts[LINE_COUNT], None, :3]
    gaps = [np.abs(lines - sign * site.lines[None, :, :3]).max(axis=2) for sign in (1.0, -1.0)]
    return (np.minimum(*gaps) < ONE_LINE).any(axis=1)


@compiled
def estimate_covariance(roof, site):
    """Return the covariance (u, u) of the unknowns, from the points that the roof explains."""
    box = np.array([-np.inf, np.inf, -np.inf, np.inf])
    view, points = list_view(roof, box), list_points(site, box)
    places, count = list_unknowns(roof, site, box)
    matrix, vector = np.zeros((count, count)), np.zeros(count)
    explained, squares = sum_normal_equations(roof, site, view, points, places, matrix, vector)
    for q in range(count):
        matrix[q, q] += LOOSE_POINTS
    return np.linalg.inv(matrix) * (squares / max(explained - count, 1))


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
    box = roof.boxes[k] + np.array([-MOVED_M, MOVED_M, -MOVED_M, MOVED_M])
    view, points = list_view(roof, box), list_points(site, box)
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
