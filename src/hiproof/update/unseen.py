"""Parts of an earlier roof that the new survey does not show.

Neither the roof nor bare ground has points there: something hid the part, it lies outside the
strips, or its points have none of the roof's classes. A hole between points that chance makes is
smaller than the distance from which on a place counts.
"""

from __future__ import annotations

import math

import numpy as np
import shapely

from ..geometry.grid import number_cells
from ..model import Roof
from ..status import ChangeKind
from .cells import CellComparison, predict_occupancy, shrink_outline
from .kinds import Difference, draw_cells

REACH_M, POINTS_WITHIN = 1.0, 28.0
"""Least distance (m) from all points at which a place is unseen, and points that a circle of this
radius would hold otherwise: seven of them in the quarter at a corner."""

LEAST_UNSEEN_M2 = 8.0
"""Area (m2) without points from which on a part is reported, as of bare ground in a first survey.
In sparse surveys it is half of that circle."""


def find_unseen(roof: Roof, comparison: CellComparison) -> list[Difference]:
    """Return the place of the earlier `roof` that the new survey does not show.

    Small places do not count. Without old points all of the earlier roof could be seen.
    """
    c = comparison
    is_seen, side = c.n_new > 0, c.cell_m
    empty = c.cells[~is_seen] if len(c.number_old) else list_empty(roof, c)
    density = float(c.n_new[is_seen].mean()) * predict_occupancy(c.n_new) / side**2
    circle_m2 = POINTS_WITHIN / density
    least_m2 = max(LEAST_UNSEEN_M2, circle_m2 / 2)
    if len(empty) * side**2 < least_m2:
        return []
    from scipy.spatial import KDTree  # only where much has no points

    reach = max(REACH_M, math.sqrt(circle_m2 / math.pi), side) / side
    core = empty[KDTree(c.cells[is_seen]).query(empty)[0] > reach]
    if not len(core):
        return []
    members = empty[KDTree(core).query(empty)[0] <= reach]
    place = shapely.intersection(draw_cells(members, side), roof.outline)
    if place.area < least_m2:
        return []
    return [Difference(ChangeKind.UNSEEN, math.nan, math.nan, place.area, place)]


def list_empty(roof: Roof, comparison: CellComparison) -> np.ndarray:
    """Return the cells (k, 2) of a roof without new points."""
    inner, side = shrink_outline(roof.outline), comparison.cell_m
    x0, y0, x1, y1 = np.floor(np.array(inner.bounds) / side).astype(np.int64).tolist()
    cells = np.mgrid[x0 : x1 + 1, y0 : y1 + 1].reshape(2, -1).T
    cells = cells[shapely.intersects_xy(inner, *((cells + 0.5) * side).T)]
    _, number = number_cells(np.concatenate([comparison.cells, cells]))
    n_known = len(comparison.cells)
    return cells[~np.isin(number[n_known:], number[:n_known])]
