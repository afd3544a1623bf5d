"""Compute what the other volumes of a roof leave for one of them. Compiled.

A roof is built from its volumes in order. Each is visible where it is higher than those before it,
or where it replaces them. So the roof with any form of volume k follows from three heights at each
place, which depend on the others only. Moves that change volume k alone compute this context once.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ...compiled import compiled
from .volumes import (
    DIRECTION,
    REPLACES,
    find_lowest,
    is_within,
    read_coefficients,
    read_rectangle,
)

Context = namedtuple("Context", "earlier later roof_without")
"""The heights (n,) that the other volumes leave for volume k at n places.

It is visible where it is above those `earlier` and no lower than those `later`, which are infinite
where one of them replaces it. `roof_without` is the height of the roof without it.
"""


@compiled
def measure_context(volumes, U, V, k):
    """Return what the others leave for volume k at U, V (directions, n).

    A new volume comes after all.
    """
    n = U.shape[1]
    earlier, later, roof_without = np.full(n, -np.inf), np.full(n, -np.inf), np.full(n, -np.inf)
    for j in range(len(volumes)):
        if j == k:
            earlier = roof_without.copy()
            continue
        direction = int(volumes[j, DIRECTION])
        u, v, ends = U[direction], V[direction], read_rectangle(volumes, j)
        c, replaces = read_coefficients(volumes, j), volumes[j, REPLACES] > 0.0
        if j < k:
            for i in range(n):  # no branches: a processor does several places at once
                h = find_lowest(c, u[i], v[i])
                shows = is_within(ends, u[i], v[i]) & (replaces | (h > roof_without[i]))
                roof_without[i] = h if shows else roof_without[i]
            continue
        for i in range(n):
            h = find_lowest(c, u[i], v[i])
            is_inside = is_within(ends, u[i], v[i])
            shows = is_inside & (replaces | (h > roof_without[i]))
            roof_without[i] = h if shows else roof_without[i]
            height = np.inf if replaces else h
            later[i] = height if is_inside & (height > later[i]) else later[i]
    if k == len(volumes):
        earlier = roof_without.copy()
    return Context(earlier, later, roof_without)


@compiled
def compute_roof_with(volumes, U, V, k, context):
    """Return the heights (n,) of the roof with volume k at U, V."""
    u, v = U[int(volumes[k, DIRECTION])], V[int(volumes[k, DIRECTION])]
    earlier, later, roof_without = context.earlier, context.later, context.roof_without
    c, ends, replaces = (
        read_coefficients(volumes, k),
        read_rectangle(volumes, k),
        volumes[k, REPLACES] > 0.0,
    )
    z = np.empty(len(u))
    for i in range(len(u)):
        h = find_lowest(c, u[i], v[i])
        shows = is_within(ends, u[i], v[i]) & (later[i] < np.inf) & (replaces | (h > earlier[i]))
        z[i] = max(h, later[i]) if shows else roof_without[i]
    return z


@compiled
def compute_roof_everywhere(volumes, U, V, k, context):
    """Return the heights (n,) of the roof at U, V were volume k everywhere."""
    u, v = U[int(volumes[k, DIRECTION])], V[int(volumes[k, DIRECTION])]
    earlier, later, roof_without = context.earlier, context.later, context.roof_without
    c, replaces = read_coefficients(volumes, k), volumes[k, REPLACES] > 0.0
    z = np.empty(len(u))
    for i in range(len(u)):
        h = find_lowest(c, u[i], v[i])
        shows = (later[i] < np.inf) & (replaces | (h > earlier[i]))
        z[i] = max(h, later[i]) if shows else roof_without[i]
    return z


@compiled
def is_visible_at(volumes, k, context, i, h, u, v):
    """Return whether volume k, at height h at place i, is visible there."""
    is_inside = is_within(read_rectangle(volumes, k), u, v) & (h >= context.later[i])
    return is_inside & ((volumes[k, REPLACES] > 0.0) | (h > context.earlier[i]))
