"""The evenness of points.

A scanner's rows leave no gaps as wide as chance would, so an empty place of theirs is stronger
evidence.
"""

from __future__ import annotations

import numpy as np
import shapely

CELL_SPACINGS = 2.0  # of square cells: four points in the mean
FEWEST_SPREAD_CELLS = 9  # cells; the scatter of fewer is chance
# what is believed: the most even clouds, roofs with patches that gave no return
LEAST, MOST_SPREAD = 0.4, 1.2


def unevenness(xy: np.ndarray, shape: shapely.Polygon, spacing: float) -> float:
    """Return the scatter of point counts in cells, relative to chance.

    It is the standard deviation of the number of points `xy` (n, 2) in cells well inside their
    `shape`.

    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0.0, 12, 0.5), np.arange(0.0, 12,
    ...     0.5)))
    >>> unevenness(np.column_stack([x, y]), shapely.box(0, 0, 11.5, 11.5), 0.5)
    0.4
    """
    cell = CELL_SPACINGS * spacing
    west, south, east, north = shape.bounds
    # a stray far away would make cells without end
    surroundings = shapely.box(west - cell, south - cell, east + cell, north + cell)
    index = np.floor(xy[shapely.intersects_xy(surroundings, xy)] / cell).astype(int)
    smallest = index.min(axis=0)
    columns, rows = index.max(axis=0) - smallest + 1
    counts = (
        np.bincount((index - smallest) @ (rows, 1), minlength=columns * rows)
        .reshape(columns, rows)
        .astype(float)
    )
    centres = shapely.points((np.moveaxis(np.indices(counts.shape), 0, -1) + smallest + 0.5) * cell)
    ring = shape.exterior
    shapely.prepare([shape, ring])
    inside = counts[shapely.contains(shape, centres) & ~shapely.dwithin(ring, centres, cell)]
    if len(inside) < FEWEST_SPREAD_CELLS or not inside.any():
        return 1.0
    return float(np.clip(np.sqrt(inside.var(ddof=1) / inside.mean()), LEAST, MOST_SPREAD))
