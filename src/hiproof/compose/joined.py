"""Sets that are joined one after the other (union-find).

Each member names another of its set, and the root names itself.
"""

from __future__ import annotations

from ..compiled import compiled


@compiled
def find_root(parent, i):
    """Return the root of the set of `i`, shortening `parent` (n,) on the way."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@compiled
def join(parent, i, j):
    """Make the sets of `i` and `j` one, whose root is the lower of both."""
    a, b = find_root(parent, i), find_root(parent, j)
    parent[max(a, b)] = min(a, b)
