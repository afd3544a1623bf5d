"""What the other volumes of a roof leave for one of them. Compiled.

A roof goes over its volumes in order: each shows where it is higher than those before it, or where
it replaces them. So the roof with any form of volume k follows from three heights at each place,
which depend on the others only. Moves that change volume k alone look around once.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from ...compiled import compiled
from .volumes import DIRECTION, REPLACES, coefficients, is_within, lowest, rectangle

Around = namedtuple("Around", "below above without")
"""Heights (n,) around volume k at n places: it shows where it is higher than those `below` and as
high as those `above`, which are infinite where a later one replaces it. `without` it the roof is so
high.
"""


@compiled
def look_around(volumes, U, V, k):
    """Return what the others leave for volume k at U, V (directions, n), for a new one after all."""
    n = U.shape[1]
    below, above, without = np.full(n, -np.inf), np.full(n, -np.inf), np.full(n, -np.inf)
    for j in range(len(volumes)):
        if j == k:
            below[:] = without
            continue
        u, v = U[int(volumes[j, DIRECTION])], V[int(volumes[j, DIRECTION])]
        ends = rectangle(volumes, j)
        c, replaces = coefficients(volumes, j), volumes[j, REPLACES] > 0.0
        if j < k:
            for i in range(n):  # no branches: a processor does several places at once
                h = lowest(c, u[i], v[i])
                shows = is_within(ends, u[i], v[i]) & (replaces | (h > without[i]))
                without[i] = h if shows else without[i]
            continue
        for i in range(n):
            h = lowest(c, u[i], v[i])
            there = is_within(ends, u[i], v[i])
            shows = there & (replaces | (h > without[i]))
            without[i] = h if shows else without[i]
            over = np.inf if replaces else h
            above[i] = over if there & (over > above[i]) else above[i]
    if k == len(volumes):
        below[:] = without
    return Around(below, above, without)


@compiled
def roof_with(volumes, U, V, k, around):
    """Return the heights (n,) of the roof with volume k at U, V."""
    u, v = U[int(volumes[k, DIRECTION])], V[int(volumes[k, DIRECTION])]
    below, above, without = around.below, around.above, around.without
    c, ends, replaces = coefficients(volumes, k), rectangle(volumes, k), volumes[k, REPLACES] > 0.0
    z = np.empty(len(u))
    for i in range(len(u)):
        h = lowest(c, u[i], v[i])
        there = is_within(ends, u[i], v[i]) & (above[i] < np.inf) & (replaces | (h > below[i]))
        z[i] = max(h, above[i]) if there else without[i]
    return z


@compiled
def roof_everywhere(volumes, U, V, k, around):
    """Return the heights (n,) of the roof at U, V were volume k everywhere."""
    u, v = U[int(volumes[k, DIRECTION])], V[int(volumes[k, DIRECTION])]
    below, above, without = around.below, around.above, around.without
    c, replaces = coefficients(volumes, k), volumes[k, REPLACES] > 0.0
    z = np.empty(len(u))
    for i in range(len(u)):
        h = lowest(c, u[i], v[i])
        there = (above[i] < np.inf) & (replaces | (h > below[i]))
        z[i] = max(h, above[i]) if there else without[i]
    return z


@compiled
def shows_at(volumes, k, around, i, h, u, v):
    """Return whether volume k, so high at place i, shows there."""
    there = is_within(rectangle(volumes, k), u, v) & (h >= around.above[i])
    return there & ((volumes[k, REPLACES] > 0.0) | (h > around.below[i]))
