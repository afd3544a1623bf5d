"""Compiled simplification of a layout: greedily drop cuts, planes and overlays, share planes, while the objective falls."""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ...compiled import compiled
from .kernels import fit_plane, truncated
from .layout import (
    HOLDERS,
    MAX_HOLDERS,
    MAX_NODES,
    NODES,
    OVERLAYS,
    ROOT,
    complexity,
    descend,
    evaluate,
    ghost_cost,
    height_of,
    holder_at,
    is_alive,
    mark_below,
)

DROP_CUT, DROP_PLANE, DROP_OVERLAY, TIE_PLANES, TAKE_PLANES = range(5)


@compiled
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


@compiled
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


@compiled
def point_cost(layout, h, q, u, v, cloud, ghosts, tau):
    """Cost of point `q` (a ghost when beyond the cloud) under holder `h`."""
    z, _ = height_of(layout, h, u, v)
    n = len(cloud.u)
    return truncated(cloud.z[q] - z, tau) if q < n else ghost_cost(ghosts, q - n, z)


@compiled
def current_state(layout, cloud, ghosts, tau):
    u, v = np.concatenate((cloud.u, ghosts.u)), np.concatenate((cloud.v, ghosts.v))
    _, holder, active = evaluate(layout, u, v)
    cost = np.empty(len(u))
    for q in range(len(u)):
        cost[q] = point_cost(layout, holder[q], q, u[q], v[q], cloud, ghosts, tau)
    return State(u, v, holder, active, cost)


@compiled
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


@compiled
def graft(layout, node, keep):
    """Let `node` become a copy of its child `keep`; returns what it was."""
    undo = (layout.axis[node], layout.at[node], layout.holder[node], layout.child[node, 0], layout.child[node, 1])
    layout.axis[node], layout.at[node], layout.holder[node] = layout.axis[keep], layout.at[keep], layout.holder[keep]
    layout.child[node, 0], layout.child[node, 1] = layout.child[keep, 0], layout.child[keep, 1]
    return undo


@compiled
def remove_plane(layout, h, k):
    """Take plane `k` out of holder `h` by moving the others up; returns its table row."""
    row = layout.plane_of[h, k]
    for q in range(k, layout.planes_of[h] - 1):
        layout.plane_of[h, q] = layout.plane_of[h, q + 1]
    layout.planes_of[h] -= 1
    return row


@compiled
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


@compiled
def remove_overlay(layout, index):
    for q in range(index, layout.count[OVERLAYS] - 1):
        layout.overlays[q] = layout.overlays[q + 1]
    layout.count[OVERLAYS] -= 1


@compiled
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


@compiled
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


@compiled
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


@compiled
def nearly_one_plane(layout, cloud, rows, members, a, b):
    """Two active points each at least, and a mean gap under 0.6 m over the points of both."""
    of_a, gap = 0, 0.0
    d = layout.table[a] - layout.table[b]
    for i in members:
        of_a += rows[i] == a
        gap += abs(d[0] * cloud.u[i] + d[1] * cloud.v[i] + d[2])
    return of_a >= 2 and len(members) - of_a >= 2 and gap < 0.6 * len(members)


@compiled
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


@compiled
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


@compiled
def tie(layout, a, b, fitted):
    layout.table[a] = fitted
    for h in range(layout.count[HOLDERS]):
        for k in range(layout.planes_of[h]):
            if layout.plane_of[h, k] == b:
                layout.plane_of[h, k] = a


@compiled
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
