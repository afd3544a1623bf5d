"""What points of other classes show: why a building has none of its own, or whether it stood.

All is told in whole-metre cells, as the ground and the lowest of the other points are kept of a
work tile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from ...geometry.grid import KEY_OF_CELL
from ...geometry.point_in_polygon import find_inside
from ...read.terrain import Terrain
from ...status import Doubt

CELL_M2 = 1.0  # m2; of a whole-metre cell
HIGH_M = 2.0  # over the ground: what is lower is a hedge, a car or the ground itself
LOW_M = 0.5  # from the ground: what lies no higher or lower is bare
MOSTLY = 0.5  # of the outline's cells, which say why it has no points of the class
HALF_CLASSIFIED = 0.2  # of the outline's cells, as for places without points (evaluate/layers.py)
BESIDE_WALL_M = 1.0  # m inside the outline, where points of the ground beside a wall may lie
FEWEST_CELLS = 10  # with roof points, below which chance decides
# of these, with ground points as well: of Delft's buildings none, of simulated ones pulled down
# between two flights all
UNDER_ROOF = 0.4


@dataclass(frozen=True)
class OtherPoints:
    """What lies inside a building's `area` beside the points of its class.

    Of each cell it holds the ground (m, 3), and the lowest other point where that lies `high` above
    it (n, 3) or `low`, on it (l, 3).
    """

    area: shapely.Geometry
    ground: np.ndarray
    high: np.ndarray
    low: np.ndarray

    @classmethod
    def inside(
        cls, area: shapely.Geometry, ground: np.ndarray, other: np.ndarray, terrain: Terrain
    ) -> OtherPoints:
        """Select the `ground` and lowest `other` points (k, 3) inside the area.

        `terrain` says how high they lie.
        """
        ground, other = (points[select_inside(area, points)] for points in (ground, other))
        rise = other[:, 2] - terrain.height_at(other) if len(other) else np.zeros(0)
        return cls(area, ground, other[rise >= HIGH_M], other[np.abs(rise) < LOW_M])

    def share(self, cells: np.ndarray) -> float:
        """Return the share of the area that so many cells are."""
        return min(1.0, len(cells) * CELL_M2 / self.area.area)


def find_bare_cells(points: OtherPoints) -> np.ndarray:
    """Return ground points (k, 3) in cells without leaves or roofs of another class."""
    if not len(points.high):
        return points.ground
    return points.ground[~np.isin(cell_numbers(points.ground), list_cells(points.high))]


def find_low_cells(points: OtherPoints, covered: np.ndarray) -> np.ndarray:
    """Return the points (k, 3) on the ground in cells in which no points `covered` (n, 3) lie.

    Where a building was pulled down, they may be of no class yet. Cells count four by four: a strip
    of them may be the foot of a wall.
    """
    low = points.low[~np.isin(cell_numbers(points.low), list_cells(covered))]
    numbers = cell_numbers(low)
    block = np.array([(0, 0), (0, 1), (1, 0), (1, 1)]) @ KEY_OF_CELL
    corners = numbers[np.isin(numbers[:, None] + block, numbers).all(axis=1)]
    return low[np.isin(numbers, corners[:, None] + block)]


def explain_missing_points(points: OtherPoints, classes: Sequence[int]) -> str:
    """Return a detail, perhaps empty, of a building without points of its `classes`."""
    bare = list_cells(points.ground)
    share = points.share(np.setdiff1d(list_cells(points.high), bare))
    share_bare = points.share(bare)
    none = f"no model: no points of class {' or '.join(map(str, classes))} inside the footprint"
    if share > MOSTLY:
        lie = f"over {100 * share:.0f} % of it {Doubt.POINTS_OF_OTHER_CLASSES.value}"
        return f"{none}, but {lie}; --roofs shape looks for roofs among them"
    if share_bare > MOSTLY:
        return (
            f"{none}, and over {100 * share_bare:.0f} % of it {Doubt.BARE_GROUND.value}: nothing "
            "stood there when it was scanned"
        )
    return ""


def remark_other_classes(points: OtherPoints, roof: np.ndarray) -> str:
    """Return a remark where only points of other classes lie high, else an empty one.

    They have to do so over much of a building, in cells without `roof` points (n, 3) and without
    ground.
    """
    if not is_much(points.high, points):  # a point a cell: most buildings need no further look
        return ""
    upper = np.setdiff1d(list_cells(points.high), list_cells(np.concatenate([roof, points.ground])))
    if not is_much(upper, points):
        return ""
    lie = (
        f"over {100 * points.share(upper):.0f} % of its outline, without points of its class, "
        f"{Doubt.POINTS_OF_OTHER_CLASSES.value}"
    )
    return f"{lie}: leaves, or a roof that --roofs shape finds"


def is_much(cells: np.ndarray, points: OtherPoints) -> bool:
    """Return whether so many cells (n, ...) exceed chance and a small share of the area."""
    return len(cells) >= FEWEST_CELLS and points.share(cells) > HALF_CLASSIFIED


def ground_under_roof(points: OtherPoints, roof: np.ndarray) -> str:
    """Return a remark where ground lies under much of a roof.

    `roof` are points (n, 3). It is empty otherwise.

    One flight sees no ground through a roof, but two do where a house was built or pulled down
    between them.
    """
    minimum = UNDER_ROOF * FEWEST_CELLS
    if len(points.ground) < minimum:
        return ""
    inner = shapely.buffer(points.area, -BESIDE_WALL_M)
    ground = points.ground[select_inside(inner, points.ground)]
    if len(ground) < minimum:
        return ""
    cells = list_cells(roof[select_inside(inner, roof)])
    share = np.isin(cells, list_cells(ground)).sum() / max(len(cells), 1)
    if len(cells) < FEWEST_CELLS or share <= UNDER_ROOF:
        return ""
    return (
        f"over {100 * share:.0f} % of its area {Doubt.GROUND_UNDER_ROOF.value}: two dates, or a "
        "roof open at its sides"
    )


def select_inside(area: shapely.Geometry, points: np.ndarray) -> np.ndarray:
    """Return whether (n,) points (n, 3) lie in `area` in plan."""
    return find_inside(area, points[:, 0], points[:, 1])


def list_cells(points: np.ndarray) -> np.ndarray:
    """Return the whole-metre cells (k,) of points (n, 3), each once, as a number."""
    return np.unique(cell_numbers(points))


def cell_numbers(points: np.ndarray) -> np.ndarray:
    """Return the whole-metre cell (n,) of each of the points (n, 3), as a number."""
    return np.asarray(np.floor(points[:, :2]).astype(np.int64) @ KEY_OF_CELL)
