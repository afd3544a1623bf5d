"""A roof under construction as arrays, and its compiled improvement: refine, overlay, polish.

A layout is a binary tree of cuts whose leaves hold a min of planes each, covered in painter's order by overlays (rectangles
with a min of planes of their own). What holds planes, leaf or overlay, is a holder. Planes live in one table, so that two
holders may share one. Units, frame and the cost of points and structure are those of `kernels`.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np
from numba import njit

from .kernels import (
    CUT,
    FLAT,
    KIND_COST,
    MAX_PLANES,
    MIN_SIDE_M,
    OVERLAY,
    REUSED_PLANE,
    best_candidate,
    fit_plane,
    fit_symmetric_gable,
    is_symmetric_gable,
    kind_of,
    members_of,
    planes_complexity,
    truncated,
)

MAX_HOLDERS = 96
MAX_NODES = 2 * MAX_HOLDERS
MAX_TABLE = MAX_HOLDERS * MAX_PLANES
MAX_OVERLAYS = 6

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


@njit(cache=True)
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


@njit(cache=True)
def best_primitive(sums, penalty, a, b, c, d):
    best, chosen = np.inf, 0
    for k in range(len(penalty)):
        cost = penalty[k] + sums[b, d, k] - sums[a, d, k] - sums[b, c, k] + sums[a, c, k]
        if cost < best:
            best, chosen = cost, k
    return chosen


@njit(cache=True)
def grow_tree(layout, choice, sums, penalty, planes, counts, grid):
    """Fill the empty `layout` with the partition that dynamic programming chose; children come after their parent."""
    boxes = np.zeros((MAX_NODES, 4), np.int64)
    boxes[0] = (0, len(grid.u) - 1, 0, len(grid.v) - 1)
    layout.count[NODES] = 1
    node = 0
    while node < layout.count[NODES]:
        a, b, c, d = boxes[node]
        how = choice[a, b, c, d]
        first = layout.count[NODES]
        # Every open node still needs a holder: cut only while there is room for all of them.
        if how == 0 or first - layout.count[HOLDERS] >= MAX_HOLDERS - 4 or first + 2 > MAX_NODES:
            k = best_primitive(sums, penalty, a, b, c, d)
            layout.axis[node] = -1
            layout.holder[node] = add_holder(layout, planes[k], counts[k])
        else:
            axis, k = (0, how) if how > 0 else (1, -how)
            layout.axis[node] = axis
            layout.at[node] = grid.u[k] if axis == 0 else grid.v[k]
            for side in range(2):
                layout.child[node, side] = first + side
                boxes[first + side] = (a, b, c, d)
            boxes[first, 2 * axis + 1] = k
            boxes[first + 1, 2 * axis] = k
            layout.count[NODES] += 2
        node += 1


@njit(cache=True)
def descend(layout, node, u, v):
    """Holder of the leaf under `node` that (u, v) falls into."""
    while layout.axis[node] >= 0:
        x = u if layout.axis[node] == 0 else v
        node = layout.child[node, 0 if x < layout.at[node] else 1]
    return layout.holder[node]


@njit(cache=True)
def in_rectangle(rect, u, v):
    return rect[0] <= u < rect[1] and rect[2] <= v < rect[3]


@njit(cache=True)
def holder_at(layout, u, v):
    for q in range(layout.count[OVERLAYS] - 1, -1, -1):
        if in_rectangle(layout.rect[layout.overlays[q]], u, v):
            return layout.overlays[q]
    return descend(layout, layout.count[ROOT], u, v)


@njit(cache=True)
def height_of(layout, h, u, v):
    """Height of holder `h` and the index k of its active plane."""
    best, active = np.inf, 0
    for k in range(layout.planes_of[h]):
        p = layout.table[layout.plane_of[h, k]]
        z = p[0] * u + p[1] * v + p[2]
        if z < best:
            best, active = z, k
    return best, active


@njit(cache=True)
def evaluate(layout, u, v):
    """Height (n,), holder (n,) and active plane k (n,) of the layout at `u`, `v` (n,)."""
    z, holder, active = np.empty(len(u)), np.empty(len(u), np.int64), np.empty(len(u), np.int64)
    for i in range(len(u)):
        h = holder_at(layout, u[i], v[i])
        holder[i] = h
        z[i], active[i] = height_of(layout, h, u[i], v[i])
    return z, holder, active


@njit(cache=True)
def ghost_cost(ghosts, q, z):
    return ghosts.weight[q] if z < ghosts.low or z > ghosts.high else 0.0


@njit(cache=True)
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


@njit(cache=True)
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


@njit(cache=True)
def objective(layout, cloud, ghosts, tau, evidence):
    """Cost of all points and ghosts plus that of the structure: what every step lowers."""
    total = evidence * complexity(layout)
    for i in range(len(cloud.u)):
        z, _ = height_of(layout, holder_at(layout, cloud.u[i], cloud.v[i]), cloud.u[i], cloud.v[i])
        total += truncated(cloud.z[i] - z, tau)
    for q in range(len(ghosts.u)):
        z, _ = height_of(layout, holder_at(layout, ghosts.u[q], ghosts.v[q]), ghosts.u[q], ghosts.v[q])
        total += ghost_cost(ghosts, q, z)
    return total


# --- refine -----------------------------------------------------------------------------------------------------------


@njit(cache=True)
def refine(layout, cloud, grid, pool, tau, evidence):
    """Move every cut to where its two sides cost least, then refit every leaf on its own points."""
    leaf_of = move_cuts(layout, cloud, grid, tau, evidence)
    for node in range(layout.count[NODES]):
        if layout.axis[node] < 0:
            members = np.nonzero(leaf_of == node)[0]
            if len(members) >= 3:
                refine_leaf(layout, layout.holder[node], cloud, members, pool, tau, evidence)


@njit(cache=True)
def move_cuts(layout, cloud, grid, tau, evidence):
    """Move every cut from the root down; returns the leaf (n,) of every point, -1 under an overlay."""
    node_of = np.full(len(cloud.u), layout.count[ROOT])
    for i in range(len(cloud.u)):
        for q in range(layout.count[OVERLAYS]):
            if in_rectangle(layout.rect[layout.overlays[q]], cloud.u[i], cloud.v[i]):
                node_of[i] = -1
    stack = np.empty(MAX_NODES, np.int64)
    stack[0], depth = layout.count[ROOT], 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if layout.axis[node] < 0:
            continue
        members = np.nonzero(node_of == node)[0]
        move_cut(layout, node, cloud, members, grid, tau, evidence)
        x = cloud.u if layout.axis[node] == 0 else cloud.v
        for i in members:
            node_of[i] = layout.child[node, 0 if x[i] < layout.at[node] else 1]
        stack[depth], stack[depth + 1] = layout.child[node, 1], layout.child[node, 0]
        depth += 2
    return node_of


@njit(cache=True)
def move_cut(layout, node, cloud, members, grid, tau, evidence):
    """Best position of a cut within 0.9 m, midway between points; a footprint vertex within 0.8 m is worth 0.4 units."""
    if len(members) == 0:
        return
    axis, start = layout.axis[node], layout.at[node]
    x_all = cloud.u if axis == 0 else cloud.v
    x = np.sort(x_all[members])
    order = members[np.argsort(x_all[members], kind="mergesort")]
    below = np.zeros(len(x) + 1)  # cost of the first q points going below instead of above
    for q in range(len(order)):
        i = order[q]
        low, _ = height_of(
            layout, descend(layout, layout.child[node, 0], cloud.u[i], cloud.v[i]), cloud.u[i], cloud.v[i]
        )
        high, _ = height_of(
            layout, descend(layout, layout.child[node, 1], cloud.u[i], cloud.v[i]), cloud.u[i], cloud.v[i]
        )
        below[q + 1] = below[q] + truncated(cloud.z[i] - low, tau) - truncated(cloud.z[i] - high, tau)
    best, position = below[np.searchsorted(x, start)], start
    for q in range(len(x) + 1):
        middle = x[0] - 0.2 if q == 0 else x[-1] + 0.2 if q == len(x) else 0.5 * (x[q - 1] + x[q])
        if abs(middle - start) < 0.9 and below[q] < best - 1e-6:
            best, position = below[q], middle
    lines, at_vertex = (grid.u, grid.at_vertex_u) if axis == 0 else (grid.v, grid.at_vertex_v)
    snapped = position
    for q in range(len(lines)):
        if at_vertex[q] and abs(lines[q] - position) < 0.8:
            cost = below[np.searchsorted(x, lines[q])]
            if cost <= best + 0.4 * evidence:
                best, snapped = cost - 0.4 * evidence, lines[q]
    layout.at[node] = snapped


@njit(cache=True)
def envelope_cost(cloud, members, planes, count, tau):
    total = 0.0
    for i in members:
        best = np.inf
        for k in range(count):
            z = planes[k, 0] * cloud.u[i] + planes[k, 1] * cloud.v[i] + planes[k, 2]
            best = min(best, z)
        total += truncated(cloud.z[i] - best, tau)
    return total


@njit(cache=True)
def refit_envelope(cloud, members, planes, count, tau, evidence):
    """Alternate between giving each point to its active plane and refitting the planes; planes without points go."""
    planes = planes.copy()
    active = np.empty(len(members), np.int64)
    for _ in range(3):
        for q in range(len(members)):
            i = members[q]
            best = np.inf
            for k in range(count):
                z = planes[k, 0] * cloud.u[i] + planes[k, 1] * cloud.v[i] + planes[k, 2]
                if z < best:
                    best, active[q] = z, k
        kept = 0
        for k in range(count):
            own = members[active == k]
            if len(own) >= 3:
                planes[kept], _ = fit_plane(cloud, own, planes[k], tau, evidence)
                kept += 1
        if kept == 0:
            return planes, count
        count = kept
    return planes, count


@njit(cache=True)
def refine_leaf(layout, h, cloud, members, pool, tau, evidence):
    """Refit the planes of holder `h`, try a symmetric gable and one more plane of the pool; keep what lowers the cost."""
    count = layout.planes_of[h]
    planes = np.zeros((MAX_PLANES, 3))
    for k in range(count):
        planes[k] = layout.table[layout.plane_of[h, k]]
    cost = envelope_cost(cloud, members, planes, count, tau) + evidence * planes_complexity(planes, count)
    fitted, fitted_count = refit_envelope(cloud, members, planes, count, tau, evidence)
    fitted_cost = envelope_cost(cloud, members, fitted, fitted_count, tau)
    fitted_cost += evidence * planes_complexity(fitted, fitted_count)
    if fitted_cost <= cost:
        planes, count, cost = fitted, fitted_count, fitted_cost
    if count == 2:
        gable, ok = fit_symmetric_gable(cloud, members, planes, tau)
        if ok:
            gable_cost = envelope_cost(cloud, members, gable, 2, tau) + evidence * planes_complexity(gable, 2)
            if gable_cost < cost:
                planes[:2], cost = gable, gable_cost
    if count < MAX_PLANES:
        count = add_plane(cloud, members, planes, count, pool, cost, tau, evidence)
    for k in range(count):
        if k >= layout.planes_of[h]:
            layout.plane_of[h, k] = layout.count[TABLE]
            layout.count[TABLE] += 1
        layout.table[layout.plane_of[h, k]] = planes[k]
    layout.planes_of[h] = count


@njit(cache=True)
def add_plane(cloud, members, planes, count, pool, cost, tau, evidence):
    """Append to `planes` the pool plane that lowers the cost most as a further one of the min; returns the new count."""
    separate = 0.0
    for k in range(count):
        separate += KIND_COST[kind_of(planes[k])]
    best, chosen = cost - 1e-6, -1
    for m in range(len(pool)):
        planes[count] = pool[m]
        with_it = envelope_cost(cloud, members, planes, count + 1, tau)
        with_it += evidence * (separate + KIND_COST[kind_of(pool[m])])
        if with_it < best:
            best, chosen = with_it, m
    if chosen < 0:
        return count
    planes[count] = pool[chosen]
    return count + 1


# --- overlays ---------------------------------------------------------------------------------------------------------


@njit(cache=True)
def current_costs(layout, cloud, tau):
    z, _, _ = evaluate(layout, cloud.u, cloud.v)
    costs = np.empty(len(z))
    for i in range(len(z)):
        costs[i] = truncated(cloud.z[i] - z[i], tau)
    return costs


@njit(cache=True)
def add_overlay(layout, cloud, few, grid, candidates, tau, evidence):
    """Cover the roof with the one rectangle of one plane that explains unexplained points best; False when none pays.

    Candidates are compared on the points of `few`; the chosen one is fitted, and judged, on all.
    """
    if layout.count[OVERLAYS] >= MAX_OVERLAYS:
        return False
    gain = np.empty((len(grid.u) - 1, len(grid.v) - 1))
    bounds, counts = np.full(len(candidates), np.inf), np.ones(len(candidates), np.int64)
    stacked = candidates.reshape((len(candidates), 1, 3))
    least = 0.9 * evidence * (OVERLAY + FLAT) * len(few.u) / len(cloud.u)
    _, m, box = best_candidate(few, stacked, counts, bounds, current_costs(layout, few, tau), tau, least, gain)
    if m < 0:
        return False
    current = current_costs(layout, cloud, tau)
    plane, _ = fit_plane(cloud, members_of(cloud, box), candidates[m], tau, evidence)
    rect = np.array([grid.u[box[0]], grid.u[box[1]], grid.v[box[2]], grid.v[box[3]]])
    benefit = np.empty(len(cloud.u))
    for i in range(len(cloud.u)):
        r = cloud.z[i] - plane[0] * cloud.u[i] - plane[1] * cloud.v[i] - plane[2]
        benefit[i] = current[i] - truncated(r, tau)
    score = 0.0
    for _ in range(2):
        for edge in range(4):
            score = move_edge(rect, edge, cloud, grid, benefit)
    if score < evidence * (OVERLAY + KIND_COST[kind_of(plane)]):
        return False
    h = add_holder(layout, plane.reshape((1, 3)), 1)
    if h < 0:
        return False
    layout.rect[h] = rect
    layout.overlays[layout.count[OVERLAYS]] = h
    layout.count[OVERLAYS] += 1
    return True


@njit(cache=True)
def move_edge(rect, edge, cloud, grid, benefit):
    """Move one edge of `rect` (in place) within 0.6 m to where the benefit inside is largest; returns that benefit."""
    lines, at_vertex = (grid.u, grid.at_vertex_u) if edge < 2 else (grid.v, grid.at_vertex_v)
    start, opposite = rect[edge], rect[edge ^ 1]
    tries = np.empty(13 + len(lines))
    count = 13
    for q in range(13):
        tries[q] = start + 0.1 * (q - 6)
    for q in range(len(lines)):
        if at_vertex[q] and abs(lines[q] - start) < 0.6:
            tries[count] = lines[q]
            count += 1
    tries = np.sort(tries[:count])
    best = -np.inf
    trial = rect.copy()
    for t in tries:
        if (opposite - t if edge % 2 == 0 else t - opposite) < MIN_SIDE_M:
            continue
        trial[edge] = t
        total = 0.0
        for i in range(len(benefit)):
            if in_rectangle(trial, cloud.u[i], cloud.v[i]):
                total += benefit[i]
        if total > best + 1e-9:
            best, rect[edge] = total, t
    return best


# --- settle -----------------------------------------------------------------------------------------------------------


@njit(cache=True)
def settle(layout, cloud, ghosts, grid, tau, evidence):
    """With overlays and shared planes in place: move cuts and overlay edges, refit every plane on all points it answers for."""
    move_cuts(layout, cloud, grid, tau, evidence)
    for index in range(layout.count[OVERLAYS]):
        move_overlay(layout, index, cloud, grid, tau)
    value = objective(layout, cloud, ghosts, tau, evidence)
    _, holder, active = evaluate(layout, cloud.u, cloud.v)
    alive = is_alive(layout)
    for h in range(layout.count[HOLDERS]):
        if alive[h]:
            value = refit_holder(layout, h, holder, active, cloud, ghosts, tau, evidence, value)


@njit(cache=True)
def refit_holder(layout, h, holder, active, cloud, ghosts, tau, evidence, value):
    """Refit the planes of holder `h`, as a pair where they are a symmetric gable; returns the objective, never higher."""
    rows = layout.plane_of[h, : layout.planes_of[h]].copy()
    old = layout.table[rows]
    if is_symmetric_gable(old, len(rows)):
        fitted, ok = fit_symmetric_gable(cloud, np.nonzero(holder == h)[0], old, tau)
        if ok:
            for k in range(2):
                layout.table[rows[k]] = fitted[k]
    else:
        answering = np.empty(len(holder), np.int64)
        for i in range(len(holder)):
            answering[i] = layout.plane_of[holder[i], active[i]]
        for k in range(len(rows)):
            members = np.nonzero(answering == rows[k])[0]
            if len(members) >= 3:
                layout.table[rows[k]], _ = fit_plane(cloud, members, old[k], tau, evidence)
    changed = objective(layout, cloud, ghosts, tau, evidence)
    if changed < value:
        return changed
    for k in range(len(rows)):
        layout.table[rows[k]] = old[k]
    return value


@njit(cache=True)
def move_overlay(layout, index, cloud, grid, tau):
    """Move the edges of one overlay to where it gains most over what lies below it, points under later ones left out."""
    h = layout.overlays[index]
    benefit = np.zeros(len(cloud.u))
    order, count = layout.overlays.copy(), layout.count[OVERLAYS]
    for i in range(len(benefit)):
        u, v = cloud.u[i], cloud.v[i]
        covered = False
        for q in range(index + 1, count):
            covered |= in_rectangle(layout.rect[order[q]], u, v)
        if covered:
            continue
        layout.count[OVERLAYS] = index
        below, _ = height_of(layout, holder_at(layout, u, v), u, v)
        layout.count[OVERLAYS] = count
        own, _ = height_of(layout, h, u, v)
        benefit[i] = truncated(cloud.z[i] - below, tau) - truncated(cloud.z[i] - own, tau)
    for edge in range(4):
        move_edge(layout.rect[h], edge, cloud, grid, benefit)


# --- polish -----------------------------------------------------------------------------------------------------------

DROP_CUT, DROP_PLANE, DROP_OVERLAY, TIE_PLANES, TAKE_PLANES = range(5)


@njit(cache=True)
def polish(layout, cloud, ghosts, tau, evidence):
    """Greedily take the simplification that lowers the objective most; each is judged on the points it touches only."""
    share_equal_planes(layout)
    for _ in range(40):
        state = current_state(layout, cloud, ghosts, tau)
        base = complexity(layout)
        best, move, plane = -1e-6, (-1, 0, 0), np.zeros(3)
        best, move = try_cuts(layout, cloud, ghosts, state, base, tau, evidence, best, move)
        best, move = try_planes(layout, cloud, ghosts, state, base, tau, evidence, best, move)
        best, move = try_overlays(layout, cloud, ghosts, state, base, tau, evidence, best, move)
        best, move = try_takes(layout, cloud, ghosts, state, base, tau, evidence, best, move)
        best, move, plane = try_ties(layout, cloud, ghosts, state, base, tau, evidence, best, move)
        if move[0] < 0:
            return
        apply_move(layout, move, plane)


@njit(cache=True)
def share_equal_planes(layout):
    """Let holders whose planes are equal to the micrometre use one row of the table."""
    for h in range(layout.count[HOLDERS]):
        for k in range(layout.planes_of[h]):
            row = layout.plane_of[h, k]
            for other in range(row):
                if np.max(np.abs(layout.table[other] - layout.table[row])) < 1e-6:
                    layout.plane_of[h, k] = other
                    break


# What every point (cloud first, ghosts after) costs now, and who answers for it.
State = namedtuple("State", "u v holder active cost")


@njit(cache=True)
def point_cost(layout, h, q, u, v, cloud, ghosts, tau):
    """Cost of point `q` (a ghost when beyond the cloud) under holder `h`."""
    z, _ = height_of(layout, h, u, v)
    n = len(cloud.u)
    return truncated(cloud.z[q] - z, tau) if q < n else ghost_cost(ghosts, q - n, z)


@njit(cache=True)
def current_state(layout, cloud, ghosts, tau):
    u, v = np.concatenate((cloud.u, ghosts.u)), np.concatenate((cloud.v, ghosts.v))
    _, holder, active = evaluate(layout, u, v)
    cost = np.empty(len(u))
    for q in range(len(u)):
        cost[q] = point_cost(layout, holder[q], q, u[q], v[q], cloud, ghosts, tau)
    return State(u, v, holder, active, cost)


@njit(cache=True)
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


@njit(cache=True)
def try_cuts(layout, cloud, ghosts, state, base, tau, evidence, best, move):
    """Replace a cut by one of its sides."""
    alive = np.zeros(MAX_NODES, np.bool_)
    alive[layout.count[ROOT]] = True
    for node in range(layout.count[NODES]):
        if not alive[node] or layout.axis[node] < 0:
            continue
        alive[layout.child[node, 0]] = alive[layout.child[node, 1]] = True
    for node in range(layout.count[NODES]):
        if not alive[node] or layout.axis[node] < 0:
            continue
        for side in range(2):
            gone = np.zeros(MAX_HOLDERS, np.bool_)
            mark_below(layout, layout.child[node, 1 - side], gone)
            keep = layout.child[node, side]
            delta = 0.0
            for q in range(len(state.u)):
                if gone[state.holder[q]]:
                    h = descend(layout, keep, state.u[q], state.v[q])
                    delta += point_cost(layout, h, q, state.u[q], state.v[q], cloud, ghosts, tau) - state.cost[q]
            undo = graft(layout, node, keep)
            delta += evidence * (complexity(layout) - base)
            layout.axis[node], layout.at[node], layout.holder[node] = undo[0], undo[1], undo[2]
            layout.child[node, 0], layout.child[node, 1] = undo[3], undo[4]
            if delta < best:
                best, move = delta, (DROP_CUT, node, keep)
    return best, move


@njit(cache=True)
def graft(layout, node, keep):
    """Let `node` become a copy of its child `keep`; returns what it was."""
    undo = (layout.axis[node], layout.at[node], layout.holder[node], layout.child[node, 0], layout.child[node, 1])
    layout.axis[node], layout.at[node], layout.holder[node] = layout.axis[keep], layout.at[keep], layout.holder[keep]
    layout.child[node, 0], layout.child[node, 1] = layout.child[keep, 0], layout.child[keep, 1]
    return undo


@njit(cache=True)
def is_alive(layout):
    """alive[h]: holder h is reachable, as a leaf or as an overlay."""
    alive = np.zeros(MAX_HOLDERS, np.bool_)
    mark_below(layout, layout.count[ROOT], alive)
    for q in range(layout.count[OVERLAYS]):
        alive[layout.overlays[q]] = True
    return alive


@njit(cache=True)
def remove_plane(layout, h, k):
    """Take plane `k` out of holder `h` by moving the others up; returns its table row."""
    row = layout.plane_of[h, k]
    for q in range(k, layout.planes_of[h] - 1):
        layout.plane_of[h, q] = layout.plane_of[h, q + 1]
    layout.planes_of[h] -= 1
    return row


@njit(cache=True)
def try_planes(layout, cloud, ghosts, state, base, tau, evidence, best, move):
    """Take one plane out of a min."""
    alive = is_alive(layout)
    for h in range(layout.count[HOLDERS]):
        if not alive[h] or layout.planes_of[h] < 2:
            continue
        rows = layout.plane_of[h].copy()
        for k in range(layout.planes_of[h]):
            remove_plane(layout, h, k)
            delta = evidence * (complexity(layout) - base)
            for q in range(len(state.u)):
                if state.holder[q] == h and state.active[q] == k:
                    delta += point_cost(layout, h, q, state.u[q], state.v[q], cloud, ghosts, tau) - state.cost[q]
            layout.plane_of[h] = rows
            layout.planes_of[h] += 1
            if delta < best:
                best, move = delta, (DROP_PLANE, h, k)
    return best, move


@njit(cache=True)
def remove_overlay(layout, index):
    for q in range(index, layout.count[OVERLAYS] - 1):
        layout.overlays[q] = layout.overlays[q + 1]
    layout.count[OVERLAYS] -= 1


@njit(cache=True)
def try_overlays(layout, cloud, ghosts, state, base, tau, evidence, best, move):
    """Take one overlay off."""
    for index in range(layout.count[OVERLAYS]):
        order = layout.overlays.copy()
        gone = order[index]
        remove_overlay(layout, index)
        delta = evidence * (complexity(layout) - base)
        for q in range(len(state.u)):
            if state.holder[q] == gone:
                h = holder_at(layout, state.u[q], state.v[q])
                delta += point_cost(layout, h, q, state.u[q], state.v[q], cloud, ghosts, tau) - state.cost[q]
        layout.overlays[:] = order
        layout.count[OVERLAYS] += 1
        if delta < best:
            best, move = delta, (DROP_OVERLAY, index, 0)
    return best, move


@njit(cache=True)
def try_takes(layout, cloud, ghosts, state, base, tau, evidence, best, move):
    """Let one holder take over all planes of another."""
    alive = is_alive(layout)
    for h in range(layout.count[HOLDERS]):
        if not alive[h]:
            continue
        own, own_count = layout.plane_of[h].copy(), layout.planes_of[h]
        under = np.nonzero(state.holder == h)[0]
        for g in range(layout.count[HOLDERS]):
            if not alive[g] or g == h:
                continue
            layout.plane_of[h], layout.planes_of[h] = layout.plane_of[g], layout.planes_of[g]
            delta = evidence * (complexity(layout) - base)
            for q in under:
                delta += point_cost(layout, h, q, state.u[q], state.v[q], cloud, ghosts, tau) - state.cost[q]
            layout.plane_of[h], layout.planes_of[h] = own, own_count
            if delta < best:
                best, move = delta, (TAKE_PLANES, h, g)
    return best, move


@njit(cache=True)
def try_ties(layout, cloud, ghosts, state, base, tau, evidence, best, move):
    """Replace two planes by one fitted to the points of both, wherever they are used."""
    n = len(cloud.u)
    rows = np.empty(n, np.int64)
    for i in range(n):
        rows[i] = layout.plane_of[state.holder[i], state.active[i]]
    used, plane = np.unique(rows), np.zeros(3)
    for first in range(len(used)):
        for second in range(first):
            a, b = used[first], used[second]
            members = np.nonzero((rows == a) | (rows == b))[0]
            if not nearly_one_plane(layout, cloud, rows, members, a, b):
                continue
            more = a if 2 * np.sum(rows[members] == a) > len(members) else b
            fitted, _ = fit_plane(cloud, members, layout.table[more], tau, evidence)
            delta = tie_delta(layout, cloud, ghosts, state, base, tau, evidence, a, b, fitted)
            if delta < best:
                best, move, plane = delta, (TIE_PLANES, a, b), fitted
    return best, move, plane


@njit(cache=True)
def nearly_one_plane(layout, cloud, rows, members, a, b):
    """Two active points each at least, and a mean gap under 0.6 m over the points of both."""
    of_a, gap = 0, 0.0
    d = layout.table[a] - layout.table[b]
    for i in members:
        of_a += rows[i] == a
        gap += abs(d[0] * cloud.u[i] + d[1] * cloud.v[i] + d[2])
    return of_a >= 2 and len(members) - of_a >= 2 and gap < 0.6 * len(members)


@njit(cache=True)
def users_of(layout, a, b):
    """uses[h]: holder h has table row `a` or `b`; False in the second place when some holder has both."""
    uses, apart = np.zeros(MAX_HOLDERS, np.bool_), True
    for h in range(layout.count[HOLDERS]):
        has_a = has_b = False
        for k in range(layout.planes_of[h]):
            has_a |= layout.plane_of[h, k] == a
            has_b |= layout.plane_of[h, k] == b
        uses[h] = has_a or has_b
        apart &= not (has_a and has_b)
    return uses, apart


@njit(cache=True)
def tie_delta(layout, cloud, ghosts, state, base, tau, evidence, a, b, fitted):
    """Change of the objective when rows `a` and `b` become one plane `fitted`; infinite when one min has both."""
    uses, apart = users_of(layout, a, b)
    if not apart:
        return np.inf
    plane_a, plane_b, plane_of = layout.table[a].copy(), layout.table[b].copy(), layout.plane_of.copy()
    tie(layout, a, b, fitted)
    delta = evidence * (complexity(layout) - base)
    for q in range(len(state.u)):
        if uses[state.holder[q]]:
            cost = point_cost(layout, state.holder[q], q, state.u[q], state.v[q], cloud, ghosts, tau)
            delta += cost - state.cost[q]
    layout.table[a], layout.table[b], layout.plane_of[:] = plane_a, plane_b, plane_of
    return delta


@njit(cache=True)
def tie(layout, a, b, fitted):
    layout.table[a] = fitted
    for h in range(layout.count[HOLDERS]):
        for k in range(layout.planes_of[h]):
            if layout.plane_of[h, k] == b:
                layout.plane_of[h, k] = a


@njit(cache=True)
def apply_move(layout, move, plane):
    kind, first, second = move
    if kind == DROP_CUT:
        graft(layout, first, second)
    elif kind == DROP_PLANE:
        remove_plane(layout, first, second)
    elif kind == DROP_OVERLAY:
        remove_overlay(layout, first)
    elif kind == TAKE_PLANES:
        layout.plane_of[first], layout.planes_of[first] = layout.plane_of[second], layout.planes_of[second]
    else:
        tie(layout, first, second, plane)
