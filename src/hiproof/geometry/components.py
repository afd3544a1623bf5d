"""Which members of a set are connected through links between pairs of them."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components


def label_components(count: int, links: np.ndarray) -> np.ndarray:
    """Number the connected components of `count` members.

    links: (2, k) members that are linked. Returns the number (count,) of each member's component.
    Components are numbered in the order of their first members.

    >>> label_components(5, np.array([[4, 3], [0, 2]]))
    array([0, 1, 2, 2, 0])
    """
    graph = coo_array((np.ones(links.shape[1], bool), tuple(links)), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)
