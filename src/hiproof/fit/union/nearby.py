"""What lies around one volume: moves are judged there, so that their cost follows the volume's size.

A move of one volume changes nothing far from it. What is around the volume is a scene and a list of
volumes like the whole, only smaller, and every move works on it as on the whole. What comes back
counts only where the whole roof is cheaper by it. Compiled.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from .scene import Scene
from .volumes import DIRECTION, U0, U1, V0, V1

NEARBY_M = 5.0  # m around a volume within which its edges may go and its neighbours count
LINES_M = 1.0  # m beyond this within which grid lines are kept: a cell's width
MOST_NEAR = 0.5  # of all points and ghosts; where more of them are near, the whole is looked at


@compiled
def look_around(volumes, scene, k):
    """The numbers (m,) of the base and of the volumes around volume k, and the scene there.

    All numbers and the scene itself where most of it is near.
    """
    direction = int(volumes[k, DIRECTION])
    low_u, high_u = volumes[k, U0] - NEARBY_M, volumes[k, U1] + NEARBY_M
    low_v, high_v = volumes[k, V0] - NEARBY_M, volumes[k, V1] + NEARBY_M
    box = low_u, high_u, low_v, high_v
    new, n, m = number_places(scene, direction, box)
    if m > MOST_NEAR * len(new):
        return np.arange(len(volumes)), scene
    numbers = find_neighbours(volumes, scene.turn, direction, box)
    return numbers, cut_scene(scene, direction, box, new, n, m)


@compiled
def find_neighbours(volumes, turn, direction, box):
    """The numbers (m,) of the base and of the volumes that reach into a box of a direction's axes."""
    numbers, m = np.zeros(len(volumes), np.int64), 1
    c, s = turn[direction, 0], turn[direction, 1]
    for j in range(1, len(volumes)):
        other = int(volumes[j, DIRECTION])
        cosine = turn[other, 0] * c + turn[other, 1] * s
        sine = turn[other, 1] * c - turn[other, 0] * s
        u, v = 0.5 * (volumes[j, U0] + volumes[j, U1]), 0.5 * (volumes[j, V0] + volumes[j, V1])
        half_u = 0.5 * (volumes[j, U1] - volumes[j, U0])
        half_v = 0.5 * (volumes[j, V1] - volumes[j, V0])
        x, y = cosine * u - sine * v, sine * u + cosine * v
        reach_x = abs(cosine) * half_u + abs(sine) * half_v
        reach_y = abs(sine) * half_u + abs(cosine) * half_v
        if box[0] - reach_x < x < box[1] + reach_x and box[2] - reach_y < y < box[3] + reach_y:
            numbers[m] = j
            m += 1
    return numbers[:m]


@compiled
def number_places(scene, direction, box):
    """The new numbers (n + g,) of the points and ghosts in a box, -1 of the others, and how many of each."""
    u, v = scene.U[direction], scene.V[direction]
    new, n, m = np.full(len(u), -1), 0, 0
    for i in range(len(u)):
        if box[0] <= u[i] <= box[1] and box[2] <= v[i] <= box[3]:
            new[i] = m
            m += 1
            n += int(i < scene.n)
    return new, n, m


@compiled
def cut_scene(scene, direction, box, new, n, m):
    """The scene of the `m` points and ghosts that have `new` numbers, `n` of them points."""
    kept, directions = np.nonzero(new >= 0)[0], len(scene.U)
    U, V = np.empty((directions, m)), np.empty((directions, m))
    order = np.empty((directions, 2, m), np.int64)
    for d in range(directions):
        U[d], V[d] = scene.U[d][kept], scene.V[d][kept]
        for axis in range(2):
            q = 0
            for i in scene.order[d, axis]:
                if new[i] >= 0:
                    order[d, axis, q] = new[i]
                    q += 1
    lines, window = np.full(scene.lines.shape, np.inf), scene.window.copy()
    for axis in range(2):
        q, low, high = 0, box[2 * axis], box[2 * axis + 1]
        window[direction, 2 * axis], window[direction, 2 * axis + 1] = low, high
        for x in scene.lines[direction, axis]:
            if low - LINES_M < x < high + LINES_M:
                lines[direction, axis, q] = x
                q += 1
        if q == 0:
            lines[direction, axis, 0] = low
    return Scene(
        U,
        V,
        order,
        scene.z[kept],
        scene.weight[kept],
        scene.shade[kept],
        n,
        scene.low,
        scene.high,
        scene.turn,
        scene.depth,
        scene.corner_u,
        scene.corner_v,
        scene.pitch,
        lines,
        scene.vertices,
        scene.corners,
        scene.leans,
        scene.evidence,
        scene.dead,
        scene.width,
        scene.edge_prices,
        scene.allowed,
        window,
    )


@compiled
def put_back(volumes, numbers, rows):
    """The volumes with `rows` in place of those numbered; there may be fewer rows."""
    changed, kept = volumes.copy(), np.ones(len(volumes), np.bool_)
    for m in range(len(numbers)):
        if m < len(rows):
            changed[numbers[m]] = rows[m]
        else:
            kept[numbers[m]] = False
    return changed[kept]
