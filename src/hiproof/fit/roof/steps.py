"""Price the steps of a drawn roof: those that are low, and those beside a narrow strip."""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from ..prices import LOW_STEP_UNITS, NARROW_M, NARROW_UNITS
from .draw import ONE_PLACE_M, SEEN_STEP_M, compute_heights
from .tables import find_lowest_plane

LOW_STEP_TOP_M = 0.5  # Steps lower than this (m) cost by the metre.
STEP_SAMPLE_M = 0.5  # Distance (m) of the places in which the height of a step is measured.
ONE_LINE = 1e-3  # Sine of the angle between an edge and a wall on one line.
EDGE_OFFSET_M = 0.01  # Distance (m) from an edge in which the roof beside it is measured.


@compiled
def list_steps(roof, drawing, view, site, box):
    """Return the stretches (n, 3) of steps in a `box`: x and y of a middle, and what it costs.

    Edges are cut at multiples of a length from the foot of the line that they lie on, so that one
    stretch is the same however far a fragment reaches.
    """
    edges, count = sample_edges(roof, drawing, site, box), 0
    heights, below = np.empty(len(edges)), np.empty(len(edges), np.int64)
    compute_heights(roof, view, edges[:, 0].copy(), edges[:, 1].copy(), 0.0, heights, below)
    for i in range(len(edges)):
        step = edges[i, 2] - heights[i]
        if SEEN_STEP_M < step < np.inf:
            edges[count], heights[count], below[count] = edges[i], heights[i], below[i]
            count += 1
    out, narrow = np.empty((count, 3)), count_narrow_sides(roof, view, site, edges[:count], below)
    for i in range(count):
        low = LOW_STEP_UNITS if edges[i, 2] - heights[i] < LOW_STEP_TOP_M else 0.0
        out[i, 0], out[i, 1] = edges[i, 0], edges[i, 1]
        out[i, 2] = edges[i, 3] * (low + NARROW_UNITS * narrow[i])
    return out


@compiled
def count_narrow_sides(roof, view, site, edges, below):
    """Count the sides (n,) of steps on which the volume beside them ends within NARROW_M.

    Along the line of a wall it may. `edges` (n, 7) are those of `sample_edges`, and `below` are the
    volumes under them.
    """
    n, counts = len(edges), np.zeros(len(edges))
    for reach in (NARROW_M, -NARROW_M):
        x, y = edges[:, 0] + reach * edges[:, 5], edges[:, 1] - reach * edges[:, 4]
        heights = np.empty(n)
        compute_heights(roof, view, x, y, 0.0, heights, np.empty(n, np.int64))
        for i in range(n):
            k = below[i] if reach > 0.0 else int(edges[i, 6])
            own, _ = find_lowest_plane(roof, k, x[i], y[i])
            goes_on = own - SEEN_STEP_M <= heights[i] <= own + LOW_STEP_TOP_M
            is_narrow = not (goes_on and is_inside(site, x[i], y[i]))
            counts[i] += is_narrow and not lies_on_wall(site, edges[i])
    return counts


@compiled
def lies_on_wall(site, edge):
    """Return whether an edge (7,) lies along an edge of the outline, or beyond it."""
    for m in range(len(site.lines)):
        a, b, c, _, _, is_wall = site.lines[m]
        is_parallel = abs(a * edge[4] + b * edge[5]) < ONE_LINE
        if is_wall and is_parallel and abs(a * edge[0] + b * edge[1] + c) < 2.0 * EDGE_OFFSET_M:
            return True
    return False


@compiled
def is_inside(site, x, y):
    """Return whether a place lies in a convex part of the outline."""
    boxes, rings, sizes = site.part_boxes, site.parts, site.part_sizes
    for part in range(len(sizes)):
        inside = boxes[part, 0] <= x <= boxes[part, 1] and boxes[part, 2] <= y <= boxes[part, 3]
        last = sizes[part] - 1
        x0, y0 = rings[part, last, 0], rings[part, last, 1]
        for i in range(last + 1 if inside else 0):
            x1, y1 = rings[part, i, 0], rings[part, i, 1]
            inside &= (x1 - x0) * (y - y0) >= (y1 - y0) * (x - x0)
            x0, y0 = x1, y1
        if inside:
            return True
    return False


@compiled
def sample_edges(roof, drawing, site, box):
    """Return places (n, 7) inside the outline, just outside the edges of fragments in a box.

    They are x, y, the fragment's height there, the length (m) of the stretch, the direction of the
    edge (2), and the fragment's volume.
    """
    most = 0
    for f in range(drawing.count[0]):
        around = 2.0 * (drawing.boxes[f, 1] - drawing.boxes[f, 0])
        around += 2.0 * (drawing.boxes[f, 3] - drawing.boxes[f, 2])
        most += 2 * drawing.sizes[f] + int(around / STEP_SAMPLE_M)
    rows, count = np.empty((most, 7)), 0
    for f in range(drawing.count[0]):
        size, row = drawing.sizes[f], roof.planes[drawing.owners[f, 0], drawing.owners[f, 1]]
        x0, y0 = drawing.rings[f, size - 1, 0], drawing.rings[f, size - 1, 1]
        for i in range(size):
            x1, y1 = drawing.rings[f, i, 0], drawing.rings[f, i, 1]
            length = np.sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2)
            a, b = (x1 - x0) / max(length, ONE_PLACE_M), (y1 - y0) / max(length, ONE_PLACE_M)
            u, v = 0.5 * (x0 + x1) + EDGE_OFFSET_M * b, 0.5 * (y0 + y1) - EDGE_OFFSET_M * a
            if length > 2.0 * ONE_PLACE_M and is_inside(site, u, v):
                start = a * x0 + b * y0
                first, last = np.floor(start / STEP_SAMPLE_M), (start + length) / STEP_SAMPLE_M
                for q in range(int(np.ceil(last) - first)):
                    low = max(STEP_SAMPLE_M * (first + q) - start, 0.0)
                    high = min(STEP_SAMPLE_M * (first + q + 1.0) - start, length)
                    t = 0.5 * (low + high)
                    x, y = x0 + t * a + EDGE_OFFSET_M * b, y0 + t * b - EDGE_OFFSET_M * a
                    if box[0] < x < box[1] and box[2] < y < box[3]:
                        rows[count, 0], rows[count, 1], rows[count, 3] = x, y, high - low
                        rows[count, 2] = row[0] * x + row[1] * y + row[2]
                        rows[count, 4], rows[count, 5] = a, b
                        rows[count, 6] = drawing.owners[f, 0]
                        count += 1
            x0, y0 = x1, y1
    return rows[:count]
