"""A roof under construction as arrays: its tree of cuts, its holders of planes, its height and its objective, compiled.

A layout is a binary tree of cuts whose leaves hold a min of planes each, covered in painter's order by overlays (rectangles
with a min of planes of their own). What holds planes, leaf or overlay, is a holder. Planes live in one table, so that two
holders may share one. Units, frame and the cost of points and structure are those of `kernels`.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ...compiled import compiled
from .kernels import (
    CUT,
    KIND_COST,
    MAX_PLANES,
    OVERLAY,
    REUSED_PLANE,
    kind_of,
    planes_complexity,
    truncated,
)

MAX_HOLDERS = 96
MAX_NODES = 2 * MAX_HOLDERS
MAX_TABLE = MAX_HOLDERS * MAX_PLANES
MAX_OVERLAYS = 12

# axis[n]: -1 a leaf, 0 a cut at u = at[n], 1 at v = at[n]; child[n]: below and above the cut; holder[n]: of a leaf.
# plane_of[h, k], planes_of[h]: rows of `table` and their number. rect[h] = (u0, u1, v0, v1) of an overlay's holder.
# overlays[q]: holders in painter's order. count = [nodes, holders, table rows, overlays, root node].
Layout = namedtuple("Layout", "axis at child holder plane_of planes_of table rect overlays count")
NODES, HOLDERS, TABLE, OVERLAYS, ROOT = range(5)


def empty_layout() -> Layout:
    """A layout with room for everything and nothing in it."""
    return Layout(
        axis=np.full(MAX_NODES, -1, np.int64),
        at=np.zeros(MAX_NODES),
        child=np.zeros((MAX_NODES, 2), np.int64),
        holder=np.zeros(MAX_NODES, np.int64),
        plane_of=np.zeros((MAX_HOLDERS, MAX_PLANES), np.int64),
        planes_of=np.zeros(MAX_HOLDERS, np.int64),
        table=np.zeros((MAX_TABLE, 3)),
        rect=np.zeros((MAX_HOLDERS, 4)),
        overlays=np.zeros(MAX_OVERLAYS, np.int64),
        count=np.zeros(5, np.int64),
    )


def single_plane_layout(plane) -> Layout:
    """One leaf over everything with one plane."""
    layout = empty_layout()
    layout.count[NODES] = 1
    add_holder(layout, np.array([plane], float), 1)
    return layout


@compiled
def add_holder(layout, planes, count):
    """Append a holder with its own copies of `planes`; returns its index, or -1 when there is no room."""
    h, row = layout.count[HOLDERS], layout.count[TABLE]
    if h >= MAX_HOLDERS or row + count > MAX_TABLE:
        return -1
    for k in range(count):
        layout.table[row + k] = planes[k]
        layout.plane_of[h, k] = row + k
    layout.planes_of[h] = count
    layout.count[HOLDERS] += 1
    layout.count[TABLE] += count
    return h


@compiled
def descend(layout, node, u, v):
    """Holder of the leaf under `node` that (u, v) falls into."""
    while layout.axis[node] >= 0:
        x = u if layout.axis[node] == 0 else v
        node = layout.child[node, 0 if x < layout.at[node] else 1]
    return layout.holder[node]


@compiled
def in_rectangle(rect, u, v):
    return rect[0] <= u < rect[1] and rect[2] <= v < rect[3]


@compiled
def holder_at(layout, u, v):
    rect = layout.rect
    for q in range(layout.count[OVERLAYS] - 1, -1, -1):
        h = layout.overlays[q]
        if rect[h, 0] <= u < rect[h, 1] and rect[h, 2] <= v < rect[h, 3]:
            return h
    return descend(layout, layout.count[ROOT], u, v)


@compiled
def height_of(layout, h, u, v):
    """Height of holder `h` and the index k of its active plane."""
    best, active = np.inf, 0
    table = layout.table
    for k in range(layout.planes_of[h]):
        row = layout.plane_of[h, k]
        z = table[row, 0] * u + table[row, 1] * v + table[row, 2]
        if z < best:
            best, active = z, k
    return best, active


@compiled
def evaluate(layout, u, v):
    """Height (n,), holder (n,) and active plane k (n,) of the layout at `u`, `v` (n,)."""
    z, holder, active = np.empty(len(u)), np.empty(len(u), np.int64), np.empty(len(u), np.int64)
    for i in range(len(u)):
        h = holder_at(layout, u[i], v[i])
        holder[i] = h
        z[i], active[i] = height_of(layout, h, u[i], v[i])
    return z, holder, active


@compiled
def ghost_cost(ghosts, q, z):
    return ghosts.weight[q] if z < ghosts.low or z > ghosts.high else 0.0


@compiled
def holder_complexity(layout, h, seen):
    """Complexity of holder `h`; planes already `seen` (table rows, updated) count as reused."""
    count, fresh, total = layout.planes_of[h], 0, 0.0
    own = np.zeros((MAX_PLANES, 3))
    for k in range(count):
        row = layout.plane_of[h, k]
        own[k] = layout.table[row]
        if seen[row]:
            total += REUSED_PLANE
        else:
            fresh += 1
            total += KIND_COST[kind_of(own[k])]
    for k in range(count):
        seen[layout.plane_of[h, k]] = True
    return planes_complexity(own, count) if fresh == count else total


@compiled
def complexity(layout):
    """Units of complexity of everything reachable from the root and of the overlays."""
    seen = np.zeros(MAX_TABLE, np.bool_)
    stack = np.empty(MAX_NODES, np.int64)
    stack[0], depth, total = layout.count[ROOT], 1, 0.0
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if layout.axis[node] < 0:
            total += holder_complexity(layout, layout.holder[node], seen)
        else:
            total += CUT
            stack[depth], stack[depth + 1] = layout.child[node, 1], layout.child[node, 0]
            depth += 2
    for q in range(layout.count[OVERLAYS]):
        total += OVERLAY + holder_complexity(layout, layout.overlays[q], seen)
    return total


@compiled
def objective(layout, cloud, ghosts, tau, evidence):
    """Cost of all points and ghosts plus that of the structure: what every step lowers."""
    _, holder, _ = evaluate(layout, cloud.u, cloud.v)
    _, ghost_holder, _ = evaluate(layout, ghosts.u, ghosts.v)
    return known_objective(layout, holder, ghost_holder, cloud, ghosts, tau, evidence)


@compiled
def known_objective(layout, holder, ghost_holder, cloud, ghosts, tau, evidence):
    """`objective` where the holders (n,) of the points and (g,) of the ghosts are known already."""
    total = evidence * complexity(layout)
    for i in range(len(holder)):
        z, _ = height_of(layout, holder[i], cloud.u[i], cloud.v[i])
        total += truncated(cloud.z[i] - z, tau)
    for q in range(len(ghost_holder)):
        z, _ = height_of(layout, ghost_holder[q], ghosts.u[q], ghosts.v[q])
        total += ghost_cost(ghosts, q, z)
    return total


@compiled
def mark_below(layout, node, below):
    """below[h] = True for the holders of all leaves under `node`."""
    stack = np.empty(MAX_NODES, np.int64)
    stack[0], depth = node, 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if layout.axis[node] < 0:
            below[layout.holder[node]] = True
        else:
            stack[depth], stack[depth + 1] = layout.child[node, 0], layout.child[node, 1]
            depth += 2


@compiled
def is_alive(layout):
    """alive[h]: holder h is reachable, as a leaf or as an overlay."""
    alive = np.zeros(MAX_HOLDERS, np.bool_)
    mark_below(layout, layout.count[ROOT], alive)
    for q in range(layout.count[OVERLAYS]):
        alive[layout.overlays[q]] = True
    return alive
