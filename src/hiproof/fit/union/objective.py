"""Compute a roof's cost in points: misfit, volumes, visible steps. Compiled.

    sum over points of min((max(|dz| - dead, 0) / width)^2, 1)
    + sum over unobserved cells of their weight, where the roof leaves the points' range of heights,
      and a little where it is high although no point was seen around: what is hidden is lower
    + evidence * (volumes + offsets + slopes + visible edges)

The price of edges is in steps.py.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from .around import compute_roof_with
from .prices import BASE_COST
from .steps import gather_walls, list_near, price_edge
from .volumes import LEVEL, OFFSET0, compute_roof_heights, is_allowed, price_volume

BASE_SHARE = 0.01  # The base costs nothing if it is visible on less of the outline's area.


@compiled
def compute_point_cost(z_point, z_roof, dead, width):
    r = max(abs(z_point - z_roof) - dead, 0.0) / width
    r *= r
    return r if r < 1.0 else 1.0


@compiled
def compute_cell_cost(z_roof, weight, shade, z_low, z_high):
    return (
        weight
        if (z_roof < z_low) | (z_roof > z_high)
        else shade * (z_roof - z_low) / (z_high - z_low)
    )


@compiled
def compute_costs(z, scene):
    """Return the cost (n + g,) of every point and cell under roof heights `z`.

    The heights are (n + g,).
    """
    cost, n = np.empty(len(z)), scene.n
    for i in range(n):
        cost[i] = compute_point_cost(scene.z[i], z[i], scene.dead, scene.width)
    cell_heights, weight, shade, cell_costs = z[n:], scene.weight[n:], scene.shade[n:], cost[n:]
    for i in range(len(cell_heights)):
        cell_costs[i] = compute_cell_cost(
            cell_heights[i], weight[i], shade[i], scene.low, scene.high
        )
    return cost


@compiled
def compute_objective(volumes, scene, limit):
    """Compute the roof's cost.

    It is infinite if a shape is not allowed, and once it is known to exceed `limit`.
    """
    for k in range(1, len(volumes)):
        if not is_allowed(volumes[k], scene.allowed):
            return np.inf
    z, _ = compute_roof_heights(volumes, scene.U, scene.V, scene.order)
    return compute_roof_cost(volumes, scene, z, limit)


@compiled
def compute_objective_with(volumes, scene, k, context, limit):
    """Compute the objective of a roof of which volume k alone changed."""
    if k > 0 and not is_allowed(volumes[k], scene.allowed):
        return np.inf
    z = compute_roof_with(volumes, scene.U, scene.V, k, context)
    return compute_roof_cost(volumes, scene, z, limit)


@compiled
def compute_roof_cost(volumes, scene, z, limit):
    """Compute the cost of a roof with heights `z` (n + g,).

    It is infinite once it is known to exceed `limit`.
    """
    total, bare, base = compute_costs(z, scene).sum(), 0.0, volumes[0, OFFSET0 + LEVEL]
    for k in range(1, len(volumes)):
        total += scene.evidence * price_volume(volumes[k])
    for i in range(scene.n, len(z)):
        if z[i] == base:
            bare += scene.weight[i]
    if bare > BASE_SHARE * scene.n:
        total += scene.evidence * BASE_COST
    total += price_edges(volumes, scene, limit - total)
    return total if total <= limit else np.inf


@compiled
def price_edges(volumes, scene, limit):
    """Sum up the price of all edges; infinite once it is known to exceed `limit`."""
    if limit < 0.0:
        return np.inf
    walls, neighbours, total = gather_walls(scene), list_near(volumes, scene.turn, -1), 0.0
    for k in range(1, len(volumes)):
        for edge in range(4):
            if total > limit:
                return np.inf
            total += scene.evidence * price_edge(volumes, walls, k, edge, neighbours)
    return total


def is_base_visible(volumes: np.ndarray, scene) -> bool:
    """Return whether the base roofs a noticeable share of the outline."""
    _, top = compute_roof_heights(volumes, scene.U, scene.V, scene.order)
    return bool(scene.weight[scene.n :][top[scene.n :] == 0].sum() > BASE_SHARE * scene.n)
