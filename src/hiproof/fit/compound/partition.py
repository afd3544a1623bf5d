"""Compiled partition of a plan into rectangles by guillotine cuts, each with the primitive that explains it cheapest."""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from .kernels import (
    CUT,
    CUT_AT_VERTEX,
    KIND_COST,
    MAX_PLANES,
    MIN_SIDE_M,
    gain_by_point,
    kind_of,
    lower_envelope,
    planes_complexity,
    truncated,
)
from .layout import HOLDERS, MAX_HOLDERS, MAX_NODES, NODES, add_holder, ghost_cost

TOO_NARROW = 1e3  # points: what a rectangle narrower than MIN_SIDE_M costs besides
NO_RECTANGLE = np.float32(1e30)  # dearer than anything, and finite for the loops that assume it


@compiled
def partition(layout, cloud, ghosts, grid, pool, gables, gable_counts, tau, evidence):
    """Fill the empty `layout` with the cheapest partition into planes of `pool`, mins of two of them, and `gables`."""
    planes, counts, penalty = primitives(pool, gables, gable_counts, cloud, ghosts, tau, evidence)
    sums = cost_prefix(cloud, ghosts, grid, planes, counts, tau)
    cut_u = evidence * np.where(grid.at_vertex_u, CUT_AT_VERTEX, CUT)
    cut_v = evidence * np.where(grid.at_vertex_v, CUT_AT_VERTEX, CUT)
    cost = partition_costs(sums, penalty, grid, cut_u, cut_v)
    grow_tree(layout, cost, sums, penalty, planes, counts, grid, cut_u, cut_v)


@compiled
def primitives(pool, gables, gable_counts, cloud, ghosts, tau, evidence):
    """Candidates for a rectangle: each plane, each pair of planes that may pay as a min, each gable; with their penalty."""
    n, g = len(pool), len(gables)
    most = n + n * (n - 1) // 2 + g
    planes, counts, penalty = np.zeros((most, MAX_PLANES, 3)), np.ones(most, np.int64), np.zeros(most)
    m = 0
    for i in range(n):
        planes[m, 0] = pool[i]
        penalty[m] = evidence * KIND_COST[kind_of(pool[i])]
        m += 1
    heights, costs = heights_and_costs(pool, cloud, ghosts, tau)
    for i in range(n):
        for j in range(i):
            if (pool[i, 0] - pool[j, 0]) ** 2 + (pool[i, 1] - pool[j, 1]) ** 2 < 0.25**2:
                continue
            if may_pay(heights[i], heights[j], costs[i], costs[j], len(cloud.u), penalty[i], penalty[j]):
                planes[m, 0], planes[m, 1], counts[m] = pool[i], pool[j], 2
                penalty[m] = penalty[i] + penalty[j]
                m += 1
    for k in range(g):
        planes[m], counts[m] = gables[k], gable_counts[k]
        penalty[m] = evidence * planes_complexity(gables[k], gable_counts[k])
        m += 1
    return planes[:m], counts[:m], penalty[:m]


@compiled
def heights_and_costs(pool, cloud, ghosts, tau):
    """Height and cost (k, n + g) of every plane of the pool at the points and, after them, at the ghosts."""
    n = len(cloud.u)
    heights, costs = np.empty((len(pool), n + len(ghosts.u))), np.empty((len(pool), n + len(ghosts.u)))
    for k in range(len(pool)):
        for q in range(n):
            heights[k, q] = pool[k, 0] * cloud.u[q] + pool[k, 1] * cloud.v[q] + pool[k, 2]
            costs[k, q] = truncated(cloud.z[q] - heights[k, q], tau)
        for q in range(len(ghosts.u)):
            heights[k, n + q] = pool[k, 0] * ghosts.u[q] + pool[k, 1] * ghosts.v[q] + pool[k, 2]
            costs[k, n + q] = ghost_cost(ghosts, q, heights[k, n + q])
    return heights, costs


@compiled
def may_pay(heights, other_heights, costs, other_costs, points, price, other_price):
    """Whether the min of two planes can cost less on some rectangle than either of them alone, each at its price.

    It cannot where what a plane saves while it is the lower one, summed over all points and ghosts, is below that price. Nor
    is a pair wanted that shows less than 6 % of the points on either side of its crossing.
    """
    saved = other_saved = 0.0
    lower = 0
    for q in range(len(heights)):
        if heights[q] < other_heights[q]:
            saved += max(other_costs[q] - costs[q], 0.0)
            lower += q < points
        else:
            other_saved += max(costs[q] - other_costs[q], 0.0)
    return saved > price and other_saved > other_price and 0.06 * points <= lower <= 0.94 * points


@compiled
def cost_prefix(cloud, ghosts, grid, planes, counts, tau):
    """Prefix sums (m, nu + 1, nv + 1) over cells of the cost of each primitive, points and ghosts together."""
    m, nu, nv = len(counts), len(grid.u) - 1, len(grid.v) - 1
    sums = np.zeros((m, nu + 1, nv + 1))
    nothing, cost = np.zeros(len(cloud.u)), np.empty(len(cloud.u))
    for k in range(m):
        own = sums[k]
        gain_by_point(cloud, planes[k], counts[k], nothing, tau, cost)
        for q in range(len(cost)):
            own[cloud.i[q] + 1, cloud.j[q] + 1] -= cost[q]
        for q in range(len(ghosts.u)):
            z, _ = lower_envelope(planes[k], counts[k], ghosts.u[q], ghosts.v[q])
            if z < ghosts.low or z > ghosts.high:
                own[ghosts.i[q] + 1, ghosts.j[q] + 1] += ghosts.weight[q]
        for a in range(1, nu + 1):
            running = 0.0
            for c in range(1, nv + 1):
                running += own[a, c]
                own[a, c] = own[a - 1, c] + running
    return sums


@compiled(fastmath=True)
def partition_costs(sums, penalty, grid, cut_u, cut_v):
    """Cost (nu + 1, nu + 1, nv + 1, nv + 1) of the best guillotine partition of every rectangle of cells [a, b) x [c, d).

    Exact, by dynamic programming from narrow to wide. Single precision and innermost loops along rows of d are for the
    processor's sake.
    """
    nu, nv = len(cut_u) - 1, len(cut_v) - 1
    cost = np.empty((nu + 1, nu + 1, nv + 1, nv + 1), np.float32)
    cost[:] = NO_RECTANGLE
    strip = np.zeros((nv + 8) // 8 * 8, np.float32)
    room = np.empty((nv, len(strip)), np.float32)
    for width in range(1, nu + 1):
        for a in range(nu - width + 1):
            b = a + width
            slab = cost[a, b]
            flat = slab.reshape(-1)
            whole_costs(sums, penalty, grid, a, b, strip, room, slab)
            for k in range(a + 1, b):
                left, right, price = cost[a, k].reshape(-1), cost[k, b].reshape(-1), np.float32(cut_u[k])
                for cd in range(len(flat)):
                    flat[cd] = min(flat[cd], left[cd] + right[cd] + price)
            for c in range(nv - 2, -1, -1):
                for k in range(c + 1, nv):
                    price = slab[c, k] + np.float32(cut_v[k])
                    for d in range(k + 1, nv + 1):
                        slab[c, d] = min(slab[c, d], price + slab[k, d])
    return cost


@compiled(fastmath=True)
def whole_costs(sums, penalty, grid, a, b, strip, room, slab):
    """Fill `slab` (nv + 1, nv + 1) with the cost of the best primitive on every rectangle [a, b) x [c, d), left whole.

    `strip` (w,) and `room` (nv, w) are to work in: with rows of w, whole eights, the loops need no remainders, which is worth
    the places they fill in vain.
    """
    nv = len(room)
    room[:] = NO_RECTANGLE
    for m in range(len(penalty)):
        for d in range(nv + 1):
            strip[d] = sums[m, b, d] - sums[m, a, d]
        for c in range(nv):
            price, row = np.float32(penalty[m]) - strip[c], room[c]
            for d in range(len(strip)):
                row[d] = min(row[d], price + strip[d])
    for c in range(nv):
        for d in range(c + 1, nv + 1):
            too_narrow = grid.u[b] - grid.u[a] < MIN_SIDE_M or grid.v[d] - grid.v[c] < MIN_SIDE_M
            slab[c, d] = room[c, d] + np.float32(TOO_NARROW if too_narrow else 0.0)


@compiled
def grow_tree(layout, cost, sums, penalty, planes, counts, grid, cut_u, cut_v):
    """Fill the empty `layout` with the partition that `cost` belongs to; children come after their parent."""
    boxes = np.zeros((MAX_NODES, 4), np.int64)
    boxes[0] = (0, len(grid.u) - 1, 0, len(grid.v) - 1)
    layout.count[NODES] = 1
    node = 0
    while node < layout.count[NODES]:
        a, b, c, d = boxes[node]
        chosen, whole = best_primitive(sums, penalty, a, b, c, d)
        if grid.u[b] - grid.u[a] < MIN_SIDE_M or grid.v[d] - grid.v[c] < MIN_SIDE_M:
            whole += TOO_NARROW
        axis, k, divided = best_cut(cost, cut_u, cut_v, a, b, c, d)
        first = layout.count[NODES]
        # Every open node still needs a holder: cut only while there is room for all of them.
        full = first - layout.count[HOLDERS] >= MAX_HOLDERS - 4 or first + 2 > MAX_NODES
        if whole <= divided or full:
            layout.axis[node] = -1
            layout.holder[node] = add_holder(layout, planes[chosen], counts[chosen])
        else:
            layout.axis[node] = axis
            layout.at[node] = grid.u[k] if axis == 0 else grid.v[k]
            for side in range(2):
                layout.child[node, side] = first + side
                boxes[first + side] = (a, b, c, d)
            boxes[first, 2 * axis + 1] = k
            boxes[first + 1, 2 * axis] = k
            layout.count[NODES] += 2
        node += 1


@compiled
def best_primitive(sums, penalty, a, b, c, d):
    """The primitive that explains the rectangle of cells [a, b) x [c, d) at the least cost, and that cost."""
    best, chosen = np.inf, 0
    for k in range(len(penalty)):
        cost = penalty[k] + sums[k, b, d] - sums[k, a, d] - sums[k, b, c] + sums[k, a, c]
        if cost < best:
            best, chosen = cost, k
    return chosen, best


@compiled
def best_cut(cost, cut_u, cut_v, a, b, c, d):
    """(axis, grid line, cost) of the cheapest cut of the rectangle; the cost is infinite where it has no line inside."""
    best, axis, chosen = np.inf, 0, 0
    for k in range(a + 1, b):
        total = cost[a, k, c, d] + cost[k, b, c, d] + cut_u[k]
        if total < best:
            best, axis, chosen = total, 0, k
    for k in range(c + 1, d):
        total = cost[a, b, c, k] + cost[a, b, k, d] + cut_v[k]
        if total < best:
            best, axis, chosen = total, 1, k
    return axis, chosen, best
