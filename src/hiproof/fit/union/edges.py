"""Move the edges of rectangles to where the objective is lowest. Compiled.

The misfit depends on one edge as a running sum over the points in order of their distance.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from ...geometry.arrays import find_place
from ..prices import BASE_COST
from .around import compute_roof_everywhere
from .objective import BASE_SHARE, compute_costs, price_loose_edges
from .volumes import (
    DIRECTION,
    LEVEL,
    OFFSET0,
    SLOPE0,
    U0,
    U1,
    V0,
    V1,
    price_volume,
)

BEYOND_OUTLINE_M = 0.6  # An edge so far (m) outside the outline is not visible.
VERTEX_REACH_M = 1.5  # Corners of the outline within this distance (m) are places for an edge.
SMALL_STEPS = 4  # Steps tried to either side of an edge.
SMALL_STEP_M = 0.1  # Length of such a step (m).
NO_GAIN = 1e-6  # Change of the objective that is numerically none.


@compiled
def move_edges(volumes, scene, k, value, context):
    """Move each edge of volume k to its best place, in place.

    Returns the objective.
    """
    everywhere, roof_without = (
        compute_roof_everywhere(volumes, scene.U, scene.V, k, context),
        context.roof_without,
    )
    cost_without, gain, bare = (
        compute_costs(roof_without, scene),
        compute_costs(everywhere, scene),
        np.zeros(len(roof_without)),
    )
    base, always_bare = volumes[0, OFFSET0 + LEVEL], 0.0
    for i in range(len(gain)):
        gain[i] = gain[i] - cost_without[i] if everywhere[i] != roof_without[i] else 0.0
    for i in range(scene.n, len(bare)):
        if roof_without[i] == base:
            always_bare += scene.weight[i]
            bare[i] = scene.weight[i] if everywhere[i] != base else 0.0
    fixed = cost_without.sum()
    for j in range(1, len(volumes)):
        fixed += scene.unit * price_volume(volumes[j])
    sums, places = np.empty((3, len(gain))), np.empty(count_most_places(scene, len(volumes)))
    for edge in range(4):
        m = list_edge_places(volumes, scene, k, edge, places)
        start, opposite = volumes[k, U0 + edge], volumes[k, U0 + (edge ^ 1)]
        sign = -1.0 if edge % 2 == 0 else 1.0
        count = sum_outward(volumes, scene, k, edge, gain, bare, sums)
        distance, gains, covered = sums[0, :count], sums[1, :count], sums[2, :count]
        best, best_place = value - NO_GAIN, start
        for q in range(m):
            t = places[q]
            if sign * (t - opposite) <= 0.0:
                continue
            p = find_place(distance, sign * t)
            while p < len(distance) and distance[p] == sign * t:
                p += 1
            trial = fixed + (gains[p - 1] if p > 0 else 0.0)
            if always_bare - (covered[p - 1] if p > 0 else 0.0) > BASE_SHARE * scene.n:
                trial += scene.unit * BASE_COST
            if trial < best:
                volumes[k, U0 + edge] = t
                trial += price_loose_edges(volumes, scene)
            if trial < best:
                best, best_place = trial, t
        volumes[k, U0 + edge] = best_place
        value = value if best_place == start else best
    return value


@compiled
def sum_outward(volumes, scene, k, edge, gain, bare, sums):
    """Sum up what an edge of volume k gains on its way out from the opposite one.

    Fills the rows of `sums` with the distances of the points and unobserved cells that it passes,
    ascending, and with the sums of `gain` and of `bare` up to each. Returns how many it passes.
    """
    direction = int(volumes[k, DIRECTION])
    u, v, order = scene.U[direction], scene.V[direction], scene.order[direction, edge // 2]
    x, across = (u, v) if edge < 2 else (v, u)
    cross_low, cross_high = (
        (volumes[k, V0], volumes[k, V1]) if edge < 2 else (volumes[k, U0], volumes[k, U1])
    )
    sign, opposite, count = (
        (-1.0 if edge % 2 == 0 else 1.0),
        volumes[k, U0 + (edge ^ 1)],
        len(order),
    )
    distance, gains, covered = sums[0], sums[1], sums[2]
    first, last = 0, count  # of the order, where the way begins: found by halving
    while first < last:
        q = (first + last) // 2
        if sign * (x[order[q if edge % 2 == 1 else count - 1 - q]] - opposite) >= 0.0:
            last = q
        else:
            first = q + 1
    gained = bared = 0.0
    m = 0
    for q in range(first, count):
        i = order[q if edge % 2 == 1 else count - 1 - q]
        if cross_low <= across[i] <= cross_high:
            gained += gain[i]
            bared += bare[i]
            distance[m], gains[m], covered[m] = sign * x[i], gained, bared
            m += 1
    return m


@compiled
def count_most_places(scene, count):
    """Count the places of an edge of one of `count` volumes at most."""
    return scene.lines.shape[2] + scene.vertices.shape[2] + 2 * SMALL_STEPS + 3 * count + 1


@compiled
def list_edge_places(volumes, scene, k, edge, places):
    """Fill `places` with the places for an edge, and count them.

    They are corners of the outline, grid lines, small steps, other volumes' edges and ridges, and a
    place outside.
    """
    direction, axis, start = int(volumes[k, DIRECTION]), edge // 2, volumes[k, U0 + edge]
    lines, vertices = scene.lines[direction, axis], scene.vertices[direction, axis]
    m, last = 0, lines[0]
    for x in vertices:
        if abs(x - start) < VERTEX_REACH_M:
            places[m] = x
            m += 1
    for x in lines:
        if x < np.inf:
            places[m] = last = x
            m += 1
    for q in range(-SMALL_STEPS, SMALL_STEPS + 1):
        if q != 0:
            places[m] = start + SMALL_STEP_M * q
            m += 1
    for j in range(1, len(volumes)):
        if j != k and int(volumes[j, DIRECTION]) == direction:
            places[m], places[m + 1] = volumes[j, U0 + 2 * axis], volumes[j, U1 + 2 * axis]
            m += 2
            rising, falling = volumes[j, OFFSET0 + 2 * axis], volumes[j, OFFSET0 + 2 * axis + 1]
            if rising < np.inf and falling < np.inf:
                places[m] = (falling - rising) / (
                    volumes[j, SLOPE0 + 2 * axis] + volumes[j, SLOPE0 + 2 * axis + 1]
                )
                m += 1
    places[m] = lines[0] - BEYOND_OUTLINE_M if edge % 2 == 0 else last + BEYOND_OUTLINE_M
    return m + 1
