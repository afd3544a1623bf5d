"""The tile in which each building is drawn.

It is a quadtree in plan whose upper tiles hold the largest buildings.

Every building stands in one tile. A viewer far away draws the upper tiles alone, and what is
missing is small: the error of a tile is told by the largest building below it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MOST_TRIANGLES = 20_000  # about two megabytes: one draw call, loaded in a moment
WIDEST_M = 20_000.0  # beyond, coordinates about a tile's middle lose millimetres as float32


@dataclass(frozen=True)
class Tile:
    """A tile: its `name`, and the `items` (k,) that it draws.

    The name is its way from the root ("r", then a digit a level); items are indices.
    """

    name: str
    items: np.ndarray
    children: tuple[Tile, ...] = ()

    def list_below(self) -> np.ndarray:
        """Return the indices drawn by the tiles below this one."""
        return np.concatenate(
            [
                np.empty(0, int),
                *(np.append(child.items, child.list_below()) for child in self.children),
            ]
        )


def quadtree(
    centres: np.ndarray,
    sizes: np.ndarray,
    triangles: np.ndarray,
    limit: int = MOST_TRIANGLES,
    widest: float = WIDEST_M,
) -> Tile:
    """Return the root of the tree of buildings.

    They have `centres` (n, 2), `sizes` (n,) and numbers of `triangles` (n,), in metres.

    A tile holds the largest buildings of its square, at least one and else at most `limit`
    triangles, the rest goes to its four quarters; squares wider than `widest` hold none. Indices in
    a tile are in the order given.

    >>> tree = quadtree(np.array([[0.0, 0], [1, 1], [9, 9]]), np.array([3.0, 2, 1]), np.array([10,
    ...     10, 10]), limit=10)
    >>> tree.items.tolist(), [(child.name, child.items.tolist()) for child in tree.children]
    ([0], [('r0', [1]), ('r3', [2])])
    """
    smallest, largest = centres.min(axis=0), centres.max(axis=0)
    return grow_tile(
        "r",
        np.arange(len(centres)),
        smallest,
        float((largest - smallest).max()),
        (centres, sizes, triangles, limit, widest),
    )


def grow_tile(name: str, items: np.ndarray, lower: np.ndarray, side: float, tables: tuple) -> Tile:
    """Return the tile of a square, in which `items` stand.

    The square goes from `lower` (2,) over `side` metres.
    """
    centres, sizes, triangles, limit, widest = tables
    largest = items[np.argsort(-sizes[items], kind="stable")]
    fits = np.cumsum(triangles[largest]) <= limit
    fits[0] = True
    selection = largest[fits] if side <= widest else largest[:0]
    remainder = np.setdiff1d(items, selection)
    middle = lower + side / 2
    quarter = (centres[remainder] >= middle) @ [1, 2]
    children = [
        grow_tile(
            f"{name}{q}",
            remainder[quarter == q],
            lower + side / 2 * np.array([q % 2, q // 2]),
            side / 2,
            tables,
        )
        for q in range(4)
        if (quarter == q).any()
    ]
    return Tile(name, np.sort(selection), tuple(children))
