"""What a user gives: point clouds and footprints."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely

from ..errors import InputError
from ..frames import METRES, Units


@dataclass(frozen=True)
class PointCloud:
    """Points of one or several files, in world metres.

    `xyz` is (n, 3), `classification` (n,) or None, `crs` a pyproj CRS or None. World metres are the
    files' coordinates times their units, `units`: of a CRS in feet they are not its coordinates.
    """

    xyz: np.ndarray
    classification: np.ndarray | None = None
    crs: Any = None
    sources: tuple[str, ...] = ()
    units: Units = METRES

    def __len__(self) -> int:
        return len(self.xyz)

    @property
    def classes(self) -> np.ndarray:
        """The classification (n,); 0 ("created, never classified") if there is none."""
        return np.zeros(len(self), np.uint8) if self.classification is None else self.classification


def as_xyz(points: Any) -> np.ndarray:
    """Return points as float64 (n, 3); no points give (0, 3).

    Raises InputError for another shape: columns taken for rows make a roof of anything.
    """
    try:
        xyz = np.asarray(points, float)
    except (TypeError, ValueError):
        raise InputError(
            f"expected points of shape (n, 3), got {type(points).__name__}; pass x, y, z as "
            "columns of one array"
        ) from None
    if xyz.size == 0:
        return np.zeros((0, 3))
    if xyz.ndim != 2 or xyz.shape[1] != 3:
        raise InputError(
            f"expected points of shape (n, 3), got {xyz.shape}; pass x, y, z as columns"
        )
    return xyz


@dataclass(frozen=True)
class Footprint:
    """One requested building: its plan polygon and what the user knows of it.

    The polygon is in world coordinates, and empty if it is unusable. `shift` (x, y in m) is how far
    it lies beside its roof where that is known; (0, 0) where it is not. `passages` lead through
    below the building: polygons in world coordinates, each with its clearance over the ground (m).
    """

    id: str
    polygon: shapely.Polygon
    attributes: dict[str, Any] = field(default_factory=dict)
    shift: tuple[float, float] = (0.0, 0.0)
    passages: tuple[tuple[shapely.Polygon, float], ...] = ()
