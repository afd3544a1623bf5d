"""Copy a volume along one of its sides to where points are unexplained: dormers come in rows."""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from ..misfit import compute_point_cost
from .draw import is_near
from .price import compute_costs, list_points
from .tables import (
    N_SIDES,
    VOLUME_COUNT,
    add_line,
    copy_volume,
    find_lowest_plane,
    place_volume,
    read_line,
)

MOST_COPIED_M = 8.0  # Size (m) of the largest volume that is copied.
REACH_M = 20.0  # Farthest (m) that it is.
STEP_M = 0.2  # Distance (m) between the places that are tried.


@compiled
def list_copies(roof, site, box, unexplained):
    """List moves (n, 3) of volumes near a box, each with its number and the shift (2,) in metres.

    The first makes that volume explain most of the points in the box that cost more than
    `unexplained`, counting what they then cost.
    """
    points = list_points(site, box.reshape(1, 4))
    points = points[: np.searchsorted(points, site.n)]
    costs = compute_costs(roof, site, np.arange(roof.counts[VOLUME_COUNT]), points)
    points, costs = points[costs > unexplained], costs[costs > unexplained]
    count, most = 0, 2 * roof.counts[VOLUME_COUNT] + 1
    found, gains = np.empty((most, 3)), np.zeros(most)
    for k in range(roof.counts[VOLUME_COUNT]):
        x0, x1, y0, y1 = roof.boxes[k]
        is_small = max(x1 - x0, y1 - y0) <= MOST_COPIED_M
        if roof.n_planes[k] == 0 or not is_small or not is_near(roof.boxes[k], box, REACH_M):
            continue
        for side in range(0, N_SIDES, 2):
            a, b, _ = read_line(roof, roof.sides[k, side])
            for step in range(-int(REACH_M / STEP_M), int(REACH_M / STEP_M) + 1):
                x, y = step * STEP_M * a, step * STEP_M * b
                gain = measure_gain(roof, site, k, x, y, points, costs)
                if gain > gains[count]:
                    gains[count] = gain
                    found[count, 0], found[count, 1], found[count, 2] = k, x, y
            count += gains[count] > 0.0
    return found[:count][np.argsort(-gains[:count], kind="mergesort")]


@compiled
def measure_gain(roof, site, k, x, y, points, costs):
    """Return what points (n,) that have `costs` (n,) save below volume k moved by x, y (m)."""
    gain = 0.0
    for m in range(len(points)):
        i = points[m]
        u, v, is_inside = site.x[i] - x, site.y[i] - y, True
        for s in range(N_SIDES):
            half = roof.half_planes[k, s]
            is_inside &= half[0] * u + half[1] * v + half[2] >= 0.0
        if is_inside:
            height, _ = find_lowest_plane(roof, k, u, v)
            gain += costs[m] - compute_point_cost(site.z[i], height, site.dead, site.width)
    return gain


@compiled
def add_copy(roof, k, x, y):
    """Add volume k once more, with its heights and slopes, x and y (m) away. Returns its number."""
    copy = roof.counts[VOLUME_COUNT]
    roof.counts[VOLUME_COUNT] = copy + 1
    copy_volume(roof, k, copy)
    for s in range(N_SIDES):
        a, b, c = read_line(roof, roof.sides[k, s])
        roof.sides[copy, s] = add_line(roof, a, b, c - a * x - b * y)
    for p in range(roof.n_planes[k]):
        a, b, c = read_line(roof, roof.plane_lines[k, p])
        roof.plane_lines[copy, p] = add_line(roof, a, b, c - a * x - b * y)
    place_volume(roof, copy)
    return copy
