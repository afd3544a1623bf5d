"""Checks that points cover a building, and lie on one surface.

Two surfaces, one over the other, come from two flights, two dates or glass.

Heights over the modelled roof, so that slopes do not matter, are split in small plan cells at the
place that leaves the least variance within the two groups (Otsu 1979). Where a cell holds two
surfaces little variance is left; noise leaves more than a third, foliage a fourth. A step that the
model lacks does so, too, but in the cells along it alone.
"""

from __future__ import annotations

import math

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ..geometry.point_in_polygon import find_inside
from ..model import Roof
from ..model.heights import find_highest
from .metrics import FACADE_M, NEAR_M, Inner, well_inside

# Points a cell holds in the mean: with fewer chance makes two groups, with more a cell is as large
# as what stands on a roof.
LAYER_CELL_POINTS = 8.0

# Points well inside the outline below which nothing is said: some four cells, in which a chimney is
# as large as a roof.
FEWEST_LAYER_POINTS = 30

LEAST_POINTS_A_CELL = 4  # two and two: below that any points fall into two groups

# Share of a cell's variance that two groups may leave: surfaces 0.25 m apart with 0.04 m of noise
# leave 0.1.
MOST_WITHIN = 0.12

# Share of a cell's points in the lesser group, two at least: single points stray, a fifth of them
# does not.
SMALLER_GROUP = 0.2

# Share of the points in cells of two surfaces above which it is said: in single roofs of Delft up
# to 0.35.
LEAST_SHARE = 0.4

# Distances between points, were they even, within which a place has one: by chance one place in
# 15,000 has none, and one in a hundred where they are half as dense.
REACH = 1.75


def unseen_share(points: np.ndarray, outline: shapely.Polygon) -> float:
    """Return the share of the outline that has no `points` (n, 2 or 3) near.

    It asks as many places as there are points, evenly spread. So the share does not depend on their
    density, and a strip without points shows however large the building is. Places and points along
    the outline do not count: what stands beside a building, or its rim, has points there, too.
    """
    inner = shapely.buffer(outline, -FACADE_M)
    inner = outline if inner.is_empty else inner
    inside = points[find_inside(inner, *points[:, :2].T), :2]
    if not len(inside):
        return 1.0
    gap_m = math.sqrt(outline.area / len(points))
    west, south, east, north = outline.bounds
    x, y = np.meshgrid(
        np.arange(west + 0.5 * gap_m, east, gap_m), np.arange(south + 0.5 * gap_m, north, gap_m)
    )
    places = np.column_stack([x.ravel(), y.ravel()])
    places = places[find_inside(inner, *places.T)]
    near_m, _ = cKDTree(inside).query(places, distance_upper_bound=REACH * gap_m)
    return float(np.mean(np.isinf(near_m))) if len(places) else 0.0


def find_second_surface(
    points: np.ndarray, roof: Roof, inner: Inner | None = None
) -> tuple[float, float]:
    """Return the share of points on two surfaces, and the surfaces' distance [m].

    `points` (n, 3) are in the roof's frame. Both are zero where the evidence is not clear. Those
    less than 0.3 m inside the outline do not count, `inner` are the others, where that is known.
    The distance is the median of the cells'.
    """
    inner = inner or well_inside(points, roof.outline)
    points = points.compress(inner.holds, axis=0)
    dz = points[:, 2] - find_highest(roof.parts, points[:, :2])[0]
    if not (mask := np.isfinite(dz)).all():
        points, dz = points[mask], dz[mask]
    if len(points) < FEWEST_LAYER_POINTS:
        return 0.0, 0.0
    counts, smaller, gap, within = split_cells(
        points, dz, math.sqrt(LAYER_CELL_POINTS * inner.area_m2 / len(points))
    )
    is_dense = counts >= LEAST_POINTS_A_CELL
    two = (
        is_dense
        & (within < MOST_WITHIN)
        & (gap > NEAR_M)
        & (smaller >= np.maximum(2, SMALLER_GROUP * counts))
    )
    share = counts[two].sum() / max(counts[is_dense].sum(), 1)
    return (float(share), float(np.median(gap[two]))) if share > LEAST_SHARE else (0.0, 0.0)


def split_cells(
    xy: np.ndarray, values: np.ndarray, cell_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Split the `values` (n,) in each plan cell into lower and higher ones.

    Values are at `xy` (n, 2 or 3). The split has the least variance within its two groups. Returns
    by cell (m,): how many values, how many in the lesser group, the distance of the groups' means,
    and the share of the variance that is within the groups (1 where all values are one).
    """
    column, row = (
        np.floor((along - along.min()) / cell_m).astype(np.int64) for along in xy[:, :2].T
    )
    cell = row * (column.max() + 1) + column
    order = np.lexsort([values, cell])
    start = np.flatnonzero(np.diff(cell[order], prepend=-1))
    counts = np.diff(start, append=len(order))
    cell = np.repeat(np.arange(len(start)), counts)
    values = values[order] - (np.add.reduceat(values[order], start) / counts)[cell]
    sums = np.cumsum(values)
    sums -= (sums - values)[start][cell]
    lower = np.arange(len(order)) - start[cell] + 1
    higher = counts[cell] - lower
    between = np.where(higher > 0, sums**2 / (lower * np.maximum(higher, 1)), 0.0)
    highest = np.flatnonzero(between == np.maximum.reduceat(between, start)[cell])
    best = np.empty(len(start), np.int64)
    best[cell[highest]] = highest  # the last of several
    variance = np.add.reduceat(values**2, start) / counts
    gap = np.sqrt(between[best]) * counts / np.sqrt(lower[best] * np.maximum(higher[best], 1))
    within = 1.0 - np.divide(between[best], variance, out=np.zeros(len(start)), where=variance > 0)
    return counts, np.minimum(lower, higher)[best], gap, within
