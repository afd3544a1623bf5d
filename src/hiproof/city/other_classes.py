"""What the points that are not of the building's class say of a building: why it has none of that class, or whether it stood
there whenever it was scanned.

All is told in whole-metre cells, as the ground and the lowest of the other points are kept of a work tile.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from ..status import Doubt

CELL_M2 = 1.0  # of the cells
HIGH_M = 2.0  # over the ground: what is lower is a hedge, a car or the ground itself
MOSTLY = 0.5  # of the outline's cells, which say why it has no points of the class
BESIDE_WALL_M = 1.0  # m inside the outline, where points of the ground beside a wall may lie
FEWEST_CELLS = 10  # with roof points, below which chance decides
UNDER_ROOF = 0.4  # of these, with ground points as well: of Delft's buildings none, of simulated ones pulled down between two flights all
ROWS = 2**32  # cells from north to south, more than a world has metres


def why_no_points(
    area: shapely.Geometry, other: np.ndarray, above: np.ndarray, ground: np.ndarray, classes: Sequence[int]
) -> str:
    """The detail of a building without points of the building `classes`, empty where nothing else was seen either.

    `other` (n, 3) and `ground` (m, 3) are the lowest of the other points of a cell and its ground, around the building;
    `above` (n,) how high `other` lie above the ground [m], NaN where that is unknown.
    """
    bare = cells_of(ground[within(area, ground)])
    high = np.setdiff1d(cells_of(other[within(area, other) & (above >= HIGH_M)]), bare)
    share, share_bare = (min(1.0, len(cells) * CELL_M2 / area.area) for cells in (high, bare))
    named = " or ".join(str(number) for number in classes)
    if share > MOSTLY:
        return (
            f"no model: no points of class {named} inside the footprint, but over {100 * share:.0f} % of it "
            f"{Doubt.POINTS_OF_OTHER_CLASSES.value}; --roofs shape looks for roofs among them"
        )
    if share_bare > MOSTLY:
        return (
            f"no model: no points of class {named} inside the footprint, and over {100 * share_bare:.0f} % of it "
            f"{Doubt.BARE_GROUND.value}: nothing stood there when it was scanned"
        )
    return ""


def ground_under_roof(area: shapely.Geometry, roof: np.ndarray, ground: np.ndarray) -> str:
    """A remark where ground points, one a cell of `ground` (m, 3), lie under much of a building's `roof` points (n, 3); empty otherwise.

    One flight sees no ground through a roof, but two do where a house was built or pulled down between them.
    """
    inner = shapely.buffer(area, -BESIDE_WALL_M)
    ground = ground[within(inner, ground)]
    if len(ground) < UNDER_ROOF * FEWEST_CELLS:
        return ""
    seen = cells_of(roof[within(inner, roof)])
    share = np.isin(seen, cells_of(ground)).sum() / max(len(seen), 1)
    if len(seen) < FEWEST_CELLS or share <= UNDER_ROOF:
        return ""
    return (
        f"over {100 * share:.0f} % of its area {Doubt.GROUND_UNDER_ROOF.value}: two dates, or a roof open at its sides"
    )


def within(area: shapely.Geometry, points: np.ndarray) -> np.ndarray:
    """Whether (n,) points (n, 3) lie in `area` in plan."""
    return shapely.intersects_xy(area, points[:, 0], points[:, 1])


def cells_of(points: np.ndarray) -> np.ndarray:
    """The whole-metre cells (k,) that points (n, 3) lie in, each once, as one number."""
    column, row = np.floor(points[:, :2]).astype(np.int64).T
    return np.unique(column * ROWS + row)
