"""Which members of a set are connected through links between pairs of them."""

from __future__ import annotations

import numpy as np


def label_components(count: int, links: np.ndarray) -> np.ndarray:
    """Number the connected components of `count` members.

    links: (2, k) members that are linked. Returns the number (count,) of each member's component.
    Components are numbered in the order of their first members.

    >>> label_components(5, np.array([[4, 3], [0, 2]]))
    array([0, 1, 2, 2, 0])
    """
    first = np.arange(count)
    while True:
        lowest = first.copy()
        for ends in (links, links[::-1]):
            np.minimum.at(lowest, first[ends[0]], first[ends[1]])
        lowest = lowest[lowest]
        lowest = np.minimum(lowest, lowest[first])
        if np.array_equal(lowest, first):
            return np.unique(first, return_inverse=True)[1]
        first = lowest
