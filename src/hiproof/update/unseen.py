"""Parts of an earlier roof that the new survey does not show.

Neither the roof nor bare ground has points there: something hid the part, or it lies outside the
strips. Where points of other classes lie there, such as leaves or rubble, it is unclear whether the
roof stands. A hole between points that chance makes is smaller than the distance from which on a
place counts.
"""

from __future__ import annotations

import math

import numpy as np
import shapely

from ..city.work.other_classes import CELL_M2, select_inside
from ..city.work.solve import Surroundings
from ..geometry.grid import KEY_OF_CELL
from ..model import Roof
from ..status import Change, ChangeKind
from .cells import CellComparison, shrink_outline
from .judge import ChangeVerdict
from .kinds import Difference, draw_cells
from .lineage import PART_GRID_M

REACH_M, NEIGHBOURS, OVER_NEIGHBOURS = 1.0, 7, 2.0
"""Least distance (m) from all points at which a place is unseen. It is at least so many times that
of a point from its seventh neighbour: a circle of this radius would hold 28 points otherwise, and
its quarter at a corner seven. Lines of points that lie far apart make larger cells, of which the
side counts."""

HIDDEN_SHARE = 0.3
"""Share of an unseen place's square metres with points of other classes, from which on the survey
covers it: of one point in two square metres 0.39 hold any."""

LEAST_UNSEEN_M2 = 8.0
"""Area (m2) without points from which on a part is reported, as of bare ground in a first survey.
In sparse surveys it is half of that circle."""


def find_unseen(roof: Roof, verdict: ChangeVerdict, new: Surroundings) -> list[Difference]:
    """Return the place of the earlier `roof` that the new survey does not show.

    Small places do not count. Without old points all of the earlier roof could be seen. Where `new`
    points of other classes lie all over the place, or over a roof that is hardly covered, the place
    is unclear.
    """
    place = draw_unseen(roof, verdict.comparison)
    for area in (place, roof.outline if verdict.change is Change.NOT_COVERED else None):
        if area is not None and is_hidden(shapely.transform(area, roof.frame.to_world), new):
            return [Difference(ChangeKind.UNCLEAR, area.area, area)]
    if place is None:
        return []
    return [Difference(ChangeKind.UNSEEN, place.area, place)]


def draw_unseen(roof: Roof, comparison: CellComparison) -> shapely.Geometry | None:
    """Return the place of a roof that no points show, None for a small one."""
    c, xy = comparison, comparison.points[:, :2]
    cells, is_known = list_cells(roof, c)
    if not len(xy):
        return roof.outline
    if is_known.sum() * PART_GRID_M**2 < LEAST_UNSEEN_M2:
        return None
    from scipy.spatial import KDTree

    tree, places = KDTree(xy), (cells + 0.5) * PART_GRID_M
    distance = np.where(is_known, tree.query(places)[0], 0.0)
    if distance.max() <= REACH_M:
        return None
    spacing = float(np.median(tree.query(xy, [min(NEIGHBOURS, len(xy))])[0]))
    reach = max(REACH_M, OVER_NEIGHBOURS * spacing, c.cell_m)
    core = places[distance > reach]
    if not len(core):
        return None
    members = cells[KDTree(core).query(places)[0] <= reach]
    place = shapely.intersection(draw_cells(members, PART_GRID_M), roof.outline)
    return place if place.area >= max(LEAST_UNSEEN_M2, math.pi * reach**2 / 2) else None


def is_hidden(place: shapely.Geometry, new: Surroundings) -> bool:
    """Return whether points of other classes lie all over a `place` of the world."""
    west, south, east, north = np.array(place.bounds)
    box = np.array([math.floor(west), math.floor(south), math.ceil(east), math.ceil(north)])
    n_cells = select_inside(place, new.low.inside(box)).sum()
    return bool(n_cells * CELL_M2 >= HIDDEN_SHARE * place.area)


def list_cells(roof: Roof, comparison: CellComparison) -> tuple[np.ndarray, np.ndarray]:
    """Return the cells (k, 2) of PART_GRID_M of a roof, and whether (k,) both surveys count there.

    They do inside its walls, where the earlier survey shows it.
    """
    c, side = comparison, PART_GRID_M
    x0, y0, x1, y1 = np.floor(np.array(roof.outline.bounds) / side).astype(np.int64).tolist()
    cells = np.mgrid[x0 : x1 + 1, y0 : y1 + 1].reshape(2, -1).T
    cells = cells[shapely.intersects_xy(roof.outline, *((cells + 0.5) * side).T)]
    middles = (cells + 0.5) * side
    is_known = shapely.intersects_xy(shrink_outline(roof.outline), middles)
    if len(c.number_old):
        keys = np.floor(middles / c.cell_m).astype(np.int64) @ KEY_OF_CELL
        is_known &= np.isin(keys, c.cells[c.n_old > 0].astype(np.int64) @ KEY_OF_CELL)
    return cells, is_known
