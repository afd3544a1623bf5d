"""Compute what points and unobserved cells cost under a roof. Compiled.

sum over points of min((max(|dz| - dead, 0) / width)^2, 1)
+ sum over unobserved cells of their weight, where the roof leaves the points' range of heights,
  and a little where it is high although no point was seen around: what is hidden is lower
"""

from __future__ import annotations

import numpy as np

from ..compiled import compiled


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
