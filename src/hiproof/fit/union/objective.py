"""Compute a roof's cost in points: misfit and volumes. Compiled.

    sum over points of min((max(|dz| - dead, 0) / width)^2, 1)
    + sum over unobserved cells of their weight, where the roof leaves the points' range of heights,
      and a little where it is high although no point was seen around: what is hidden is lower
    + unit * (volumes + offsets + slopes + edges on lines of their own)

What is seen of edges is priced by `fit.roof`, which draws them.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from ..prices import BASE_COST, LOOSE_COST
from .around import compute_roof_with
from .volumes import DIRECTION, LEVEL, OFFSET0, U0, compute_roof_heights, is_allowed, price_volume

SAME_LINE_M = 1e-6  # Edges nearer (m) than this to a line lie on it.
BORDER_M = 0.2  # An edge within this distance (m) of the outline's bounds ends the roof.
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
def compute_objective(volumes, scene):
    """Compute the roof's cost. It is infinite if a shape is not allowed."""
    for k in range(1, len(volumes)):
        if not is_allowed(volumes[k], scene.allowed):
            return np.inf
    z, _ = compute_roof_heights(volumes, scene.U, scene.V)
    return compute_roof_cost(volumes, scene, z)


@compiled
def compute_objective_with(volumes, scene, k, context):
    """Compute the objective of a roof of which volume k alone changed."""
    if k > 0 and not is_allowed(volumes[k], scene.allowed):
        return np.inf
    z = compute_roof_with(volumes, scene.U, scene.V, k, context)
    return compute_roof_cost(volumes, scene, z)


@compiled
def compute_roof_cost(volumes, scene, z):
    """Compute the cost of a roof with heights `z` (n + g,)."""
    total, bare, base = compute_costs(z, scene).sum(), 0.0, volumes[0, OFFSET0 + LEVEL]
    for k in range(1, len(volumes)):
        total += scene.unit * price_volume(volumes[k])
    for i in range(scene.n, len(z)):
        if z[i] == base:
            bare += scene.weight[i]
    if bare > BASE_SHARE * scene.n:
        total += scene.unit * BASE_COST
    return total + price_loose_edges(volumes, scene)


@compiled
def price_loose_edges(volumes, scene):
    """Sum up what edges on lines of their own cost."""
    count = 0
    for k in range(1, len(volumes)):
        for edge in range(4):
            count += is_loose(volumes, scene, k, edge)
    return scene.unit * LOOSE_COST * count


@compiled
def is_loose(volumes, scene, k, edge):
    """Return whether no corner of the outline and no other volume gives an edge's place.

    An edge outside the outline is not visible.
    """
    direction, axis, place = int(volumes[k, DIRECTION]), edge // 2, volumes[k, U0 + edge]
    vertices = scene.vertices[direction, axis]
    last = np.searchsorted(vertices, np.inf) - 1
    if place < vertices[0] + BORDER_M or place > vertices[last] - BORDER_M:
        return False
    if vertices[np.searchsorted(vertices, place - SAME_LINE_M)] < place + SAME_LINE_M:
        return False
    for j in range(1, len(volumes)):
        if j != k and int(volumes[j, DIRECTION]) == direction:
            for other in range(2 * axis, 2 * axis + 2):
                if abs(volumes[j, U0 + other] - place) < SAME_LINE_M:
                    return False
    return True


def is_base_visible(volumes: np.ndarray, scene, count_points: bool = False) -> bool:
    """Return whether the base is alone, or roofs a noticeable share of the outline.

    Where it ends at the border of a block, points count, each as half (`count_points`).
    """
    _, top = compute_roof_heights(volumes, scene.U, scene.V)
    cells = scene.weight[scene.n :][top[scene.n :] == 0].sum()
    points = 0.5 * np.count_nonzero(top[: scene.n] == 0) * count_points
    return len(volumes) == 1 or bool(max(cells, points) > BASE_SHARE * scene.n)
