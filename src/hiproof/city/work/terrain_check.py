"""A terrain model against the ground points around a building.

Where the two contradict each other, the points count.

A terrain model may be of another height system or another date, and a raster may hold codes for "no
data" that its file does not declare. The cloud's own ground points fit the cloud's roofs, so they
decide.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ...read.terrain import Terrain
from ...status import Doubt

FAR_GROUND_M = 2.0
"""Difference (m) between a terrain model and ground points from which on it is remarked: two dates,
or two systems.
"""

OTHER_GROUND_M = 5.0
"""Difference (m) from which on the model's height is not used: height systems differ by 10 to 100
m, codes for "no data" by more, while a model and ground points of one place agree within 2 m also
on slopes.
"""


class TerrainModel(Terrain, Protocol):
    """A terrain that also knows where its raster holds a code for "no data"."""

    def is_coded_at(self, xy_world: np.ndarray) -> np.ndarray: ...


class WhereLikeGround:
    """A terrain model, unknown where it lies far from the `ground` points.

    Where these are unknown it counts.
    """

    def __init__(self, model: Terrain, ground: Terrain):
        self.model, self.ground, self.source = model, ground, model.source

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return the model's height (n,) at `xy_world` (n, 2).

        It is NaN where it has none or contradicts the ground points.
        """
        heights = self.model.height_at(xy_world)
        gap = np.abs(heights - self.ground.height_at(xy_world))
        return np.where(gap > OTHER_GROUND_M, np.nan, heights)


def check_terrain(model: TerrainModel, ground: Terrain, xy: np.ndarray) -> str:
    """Return a remark where the terrain model has no true height.

    It has none at some of the corners `xy` (n, 2) of an outline, or lies far above or below the
    ground points there. The remark is empty otherwise.
    """
    coded = model.is_coded_at(xy)
    if coded.any():
        text = "" if coded.all() else "part of "
        mask = np.isfinite(ground.height_at(xy[coded])).all()
        use = "the ground points are used there" if mask else "it is not used there"
        return (
            f"the {model.source} {Doubt.TERRAIN_WITHOUT_HEIGHTS.value} under {text}the building; "
            f"{use}"
        )
    gap = model.height_at(xy) - ground.height_at(xy)
    gap = gap[np.isfinite(gap)]
    is_other = np.abs(gap) > OTHER_GROUND_M
    above = float(np.median(gap[is_other] if is_other.any() else gap)) if len(gap) else 0.0
    if abs(above) <= FAR_GROUND_M:
        return ""
    way = "above" if above > 0 else "below"
    use = ", which are used instead" if is_other.any() else ""
    return (
        f"the {model.source} lies {abs(above):.1f} m {way} "
        f"{Doubt.TERRAIN_UNLIKE_GROUND_POINTS.value}{use}"
    )
