"""Which points belong to which footprint, by a grid into which points are sorted once."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely

from ..frames import Box
from .grid import cell_range
from .point_in_polygon import find_inside

# of an outline; hardly a building has more corners, and growing it takes a quarter of a second
MANY_VERTICES = 200
INDEX_CELL_M = 4.0  # m; a house covers a few dozen cells, and a cell holds few points beside it


class PointGrid:
    """Plan points sorted into square cells, row by row.

    Any box is then a few slices of one sorted array.

    >>> grid = PointGrid(np.array([[0.5, 0.5], [9.0, 9.0], [1.5, 0.5]]))
    >>> grid.inside(shapely.box(0, 0, 1, 1)).tolist()
    [0]
    >>> grid.find_within(shapely.box(0, 0, 1, 1), 1.0).tolist()
    [0, 2]
    """

    def __init__(self, xy: np.ndarray, cell_m: float = INDEX_CELL_M):
        """Index finite `xy` (n, 2 or more) in metres by square cells; more columns are ignored."""
        self.xy, self.cell_m = np.ascontiguousarray(xy, float), float(cell_m)
        self.origin, (self.columns, self.rows) = (
            cell_range(self.xy, cell_m) if len(self.xy) else ((0, 0), (1, 1))
        )
        column, row = (np.floor(self.xy[:, :2] / cell_m).astype(np.int64) - self.origin).T
        keys = row * self.columns + column
        self.order = np.argsort(keys, kind="stable")
        self.keys = keys[self.order]

    @property
    def bounds(self) -> Box:
        """The box (xmin, ymin, xmax, ymax) of all cells."""
        (x, y), cell_m = self.origin, self.cell_m
        return cell_m * x, cell_m * y, cell_m * (x + self.columns), cell_m * (y + self.rows)

    def candidates(self, bounds: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return indices of points in all cells that a box (xmin, ymin, xmax, ymax) meets."""
        first = self.cell_range(bounds[0], bounds[2], 0)
        last = self.cell_range(bounds[1], bounds[3], 1)
        rows = np.arange(max(last[0], 0), min(last[1], self.rows - 1) + 1)
        left, right = max(first[0], 0), min(first[1], self.columns - 1)
        if left > right or not len(rows):
            return np.empty(0, np.int64)
        starts = np.searchsorted(self.keys, rows * self.columns + left)
        stops = np.searchsorted(self.keys, rows * self.columns + right, side="right")
        return np.concatenate(
            [self.order[start:stop] for start, stop in zip(starts, stops, strict=True)]
        )

    def cell_range(self, lower: float, upper: float, axis: int) -> tuple[int, int]:
        start = self.origin[axis]
        return math.floor(lower / self.cell_m) - start, math.floor(upper / self.cell_m) - start

    def inside(self, polygon: shapely.Polygon) -> np.ndarray:
        """Return ascending indices of the points inside `polygon` or on its border."""
        if polygon.is_empty:
            return np.empty(0, np.int64)
        result = self.candidates(polygon.bounds)
        x, y = self.xy.take(result, axis=0)[:, :2].T
        return np.sort(result[find_inside(polygon, x, y)])

    def find_within(self, polygon: shapely.Polygon, distance_m: float) -> np.ndarray:
        """Return ascending indices of points inside, or at most `distance_m` from, `polygon`."""
        if polygon.is_empty:
            return np.empty(0, np.int64)
        return self.inside(
            grow_polygon(polygon, distance_m, quad_segs=4) if distance_m else polygon
        )


def grow_polygon(polygon: shapely.Polygon, distance_m: float, **options: int) -> shapely.Geometry:
    """Return the area at most `distance_m` from a polygon, the polygon included.

    A polygon with MANY_VERTICES grows to within a tenth of the distance. Small teeth that grow by
    much take GEOS the square of their number.
    """
    if shapely.get_num_coordinates(polygon) > MANY_VERTICES:
        polygon = shapely.simplify(polygon, distance_m / 10)
    return shapely.buffer(polygon, distance_m, **options)
