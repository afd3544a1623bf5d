"""Hold what the roof of a building is fitted to: points, outline, directions and settings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely

from ...settings import CompoundSettings
from ..candidates.allowed import list_allowed_shapes
from ..prices import compute_unit
from .depth import DepthRaster, make_depth_raster
from .directions import find_directions
from .plan import Plan

DEAD_M = 0.03  # Residual (m) that costs nothing where candidates are found.
LEAST_RAMP_M = 0.02  # Least difference (m) over which larger residuals grow to the cost of a point.


class Box(NamedTuple):
    """An upright box in the plan's axes, from u0 to u1 and from v0 to v1 (m)."""

    u0: float
    u1: float
    v0: float
    v1: float

    def split(self, axis: int, place: float) -> tuple[Box, Box]:
        """Cut the box in two at a `place` of an axis (0 for u, 1 for v)."""
        if axis == 0:
            return self._replace(u1=place), self._replace(u0=place)
        return self._replace(v1=place), self._replace(v0=place)


def clip_to_box(geometry: shapely.Geometry, box: Box) -> shapely.Geometry:
    """Return the part of a geometry inside a box."""
    return shapely.clip_by_rect(geometry, box.u0, box.v0, box.u1, box.v1)


@dataclass(frozen=True)
class Whole:
    """A building in the plan's axes, with the settings of [compound].

    Volumes may follow directions, of which `turn` (d, 2) are cosine and sine, and have the
    `allowed` shapes, see `volumes.is_allowed`.
    """

    plan: Plan
    outline: shapely.Polygon
    raster: DepthRaster
    turn: np.ndarray
    allowed: np.ndarray
    settings: CompoundSettings

    @property
    def width(self) -> float:
        """How far (m) beyond DEAD_M a point is unexplained."""
        return max(self.settings.tolerance_m - DEAD_M, LEAST_RAMP_M)

    def compute_unit(self, share: float = 1.0) -> float:
        """Compute the points that a unit of structure must explain, of a share of all."""
        return compute_unit(share * self.plan.density, self.settings)

    @property
    def box(self) -> Box:
        u0, v0, u1, v1 = self.outline.bounds
        return Box(u0, u1, v0, v1)

    def find_points(self, box: Box) -> np.ndarray:
        """Return the numbers (m,) of the points in a box."""
        u, v, _ = self.plan.uvz
        first, last = np.searchsorted(u, box.u0), np.searchsorted(u, box.u1, side="right")
        return first + np.flatnonzero((v[first:last] >= box.v0) & (v[first:last] <= box.v1))


def lay_out_whole(
    plan: Plan,
    outline: shapely.Polygon,
    settings: CompoundSettings,
    types: tuple[str, ...] = (),
) -> Whole:
    """Lay out a building. `settings` are those of [compound].

    Volumes have only shapes that parts of `types` need, any without types.
    """
    uv_outline = shapely.transform(outline, plan.frame.uv_plan)
    angles = np.array(find_directions(outline, plan.frame))
    return Whole(
        plan,
        uv_outline,
        make_depth_raster(uv_outline),
        np.column_stack([np.cos(angles), np.sin(angles)]),
        list_allowed_shapes(types),
        settings,
    )
