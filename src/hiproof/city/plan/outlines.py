"""The outlines of all buildings around a run's, and the rows they form.

Outlines of neighbours are input, whether a run asks for these buildings or not. A row is all
outlines that touch, one through the other: it is moved onto its roofs as a whole, or not at all.
"""

from __future__ import annotations

import functools

import numpy as np
import shapely

from ...geometry.components import label_components

TOUCH_M = 0.2
"""Gap (m) up to which outlines touch: surveys leave slits of a decimetre between houses
of a row.
"""

MOST_ROW_M = 120.0
"""Longest row (m) that is moved by itself.

It bounds the points around a building that a work tile has to hold; a longer row follows the common
shift of all footprints alone.
"""


class Outlines:
    """Plan polygons in world metres: those of a run's buildings by number, then others around."""

    def __init__(self, polygons: list[shapely.Polygon]):
        self.polygons = np.array(polygons, object)
        self.rows: dict[int, list[shapely.Polygon]] = {}  # by label, those that were asked for

    @functools.cached_property
    def tree(self) -> shapely.STRtree:
        """The outlines by place."""
        return shapely.STRtree(self.polygons)

    @functools.cached_property
    def labels(self) -> np.ndarray:
        """The number (n,) of the row that each outline is in."""
        pairs = self.tree.query(self.polygons, predicate="dwithin", distance=TOUCH_M)
        return label_components(len(self.polygons), pairs)

    @functools.cached_property
    def boxes(self) -> np.ndarray:
        """Boxes (n, 4) of each outline's row, or of the outline where the row is too long."""
        bounds, labels = shapely.bounds(self.polygons), self.labels
        lower = np.full((labels.max(initial=0) + 1, 2), np.inf)
        upper = np.full((labels.max(initial=0) + 1, 2), -np.inf)
        np.fmin.at(lower, labels, bounds[:, :2])
        np.fmax.at(upper, labels, bounds[:, 2:])
        is_short = ((upper - lower).max(axis=1) <= MOST_ROW_M)[labels]
        return np.where(is_short[:, None], np.hstack([lower, upper])[labels], bounds)

    @functools.cached_property
    def members(self) -> list[np.ndarray]:
        """The numbers of the outlines of each row."""
        order = np.argsort(self.labels, kind="stable")
        return np.split(order, np.cumsum(np.bincount(self.labels))[:-1])

    def select_near(self, index: int, reach_m: float) -> list[shapely.Polygon]:
        """Return the outlines of others within `reach_m` of outline `index`."""
        near = self.tree.query(self.polygons[index], predicate="dwithin", distance=reach_m)
        return sorted(self.polygons[near[near != index]], key=shapely.to_wkb)

    def row(self, index: int) -> list[shapely.Polygon]:
        """Return the outlines of the row of outline `index`, sorted, or none of too long a row."""
        label = int(self.labels[index])
        if label not in self.rows:
            row = self.polygons[self.members[label]]
            bounds = shapely.total_bounds(row)
            is_short = (bounds[2:] - bounds[:2]).max() <= MOST_ROW_M
            self.rows[label] = sorted(row, key=shapely.to_wkb) if is_short else []
        return self.rows[label]


def row_outline(row: list[shapely.Polygon]) -> shapely.Polygon:
    """Return one outline around a row, slits between its houses closed."""
    if len(row) == 1:
        return row[0]
    grown = shapely.union_all(shapely.buffer(row, TOUCH_M / 2, join_style="mitre"))
    closed = shapely.buffer(grown, -TOUCH_M / 2, join_style="mitre")
    return max(
        shapely.get_parts(closed), key=lambda polygon: polygon.area, default=shapely.Polygon()
    )
