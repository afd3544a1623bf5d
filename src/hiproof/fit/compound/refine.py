"""Compiled improvement of a layout: cuts move, leaves are refitted, overlays cover outliers, all settle together."""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from .kernels import (
    FLAT,
    KIND_COST,
    MAX_PLANES,
    MIN_SIDE_M,
    OVERLAY,
    best_candidate,
    fit_plane,
    fit_symmetric_gable,
    is_symmetric_gable,
    kind_of,
    members_of,
    planes_complexity,
    truncated,
)
from .layout import (
    HOLDERS,
    MAX_NODES,
    MAX_OVERLAYS,
    NODES,
    OVERLAYS,
    ROOT,
    TABLE,
    add_holder,
    descend,
    evaluate,
    height_of,
    holder_at,
    in_rectangle,
    is_alive,
    known_objective,
)


@compiled
def refine(layout, cloud, grid, pool, tau, evidence):
    """Move every cut to where its two sides cost least, then refit every leaf on its own points."""
    leaf_of = move_cuts(layout, cloud, grid, tau, evidence)
    for node in range(layout.count[NODES]):
        if layout.axis[node] < 0:
            members = np.nonzero(leaf_of == node)[0]
            if len(members) >= 3:
                refine_leaf(layout, layout.holder[node], cloud, members, pool, tau, evidence)


@compiled
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


@compiled
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


@compiled
def envelope_cost(cloud, members, planes, count, tau):
    total = 0.0
    for i in members:
        best = np.inf
        for k in range(count):
            z = planes[k, 0] * cloud.u[i] + planes[k, 1] * cloud.v[i] + planes[k, 2]
            best = min(best, z)
        total += truncated(cloud.z[i] - best, tau)
    return total


@compiled
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


@compiled
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


@compiled
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


@compiled
def current_costs(layout, cloud, tau):
    z, _, _ = evaluate(layout, cloud.u, cloud.v)
    costs = np.empty(len(z))
    for i in range(len(z)):
        costs[i] = truncated(cloud.z[i] - z[i], tau)
    return costs


@compiled
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


@compiled
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


@compiled
def settle(layout, cloud, ghosts, grid, tau, evidence):
    """With overlays and shared planes in place: move cuts and overlay edges, refit every plane on all points it answers for."""
    move_cuts(layout, cloud, grid, tau, evidence)
    for index in range(layout.count[OVERLAYS]):
        move_overlay(layout, index, cloud, grid, tau)
    _, holder, active = evaluate(layout, cloud.u, cloud.v)
    _, ghost_holder, _ = evaluate(layout, ghosts.u, ghosts.v)
    value = known_objective(layout, holder, ghost_holder, cloud, ghosts, tau, evidence)
    alive = is_alive(layout)
    for h in range(layout.count[HOLDERS]):
        if alive[h]:
            value = refit_holder(layout, h, holder, active, ghost_holder, cloud, ghosts, tau, evidence, value)


@compiled
def refit_holder(layout, h, holder, active, ghost_holder, cloud, ghosts, tau, evidence, value):
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
    changed = known_objective(layout, holder, ghost_holder, cloud, ghosts, tau, evidence)
    if changed < value:
        return changed
    for k in range(len(rows)):
        layout.table[rows[k]] = old[k]
    return value


@compiled
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
