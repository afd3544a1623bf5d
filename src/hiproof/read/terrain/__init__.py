"""How high is the ground: what answers that, and several of them in turn.

Each answers `height_at` and names its `source`; a `TerrainChain` asks the next where one does not
know.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ...errors import InputError, explain_fault
from ...frames import Units
from .raster import RasterTerrain, import_rasterio


class Terrain(Protocol):
    """Heights of the ground in the world; outputs name `source` as theirs."""

    @property
    def source(self) -> str: ...

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return the height (n,) at `xy_world` (n, 2), NaN where unknown."""
        ...


class TerrainChain:
    """Several terrains by preference; the first that knows a place answers."""

    def __init__(self, terrains: Iterable[Terrain | None]):
        self.terrains = tuple(terrain for terrain in terrains if terrain is not None)

    @property
    def source(self) -> str:
        return ", else ".join(terrain.source for terrain in self.terrains)

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return the height (n,) at `xy_world` (n, 2), NaN where none knows it."""
        return self.heights_and_sources(xy_world)[0]

    def find_known_heights(self, xy_world: np.ndarray, minimum: int) -> np.ndarray:
        """Return the heights (n,) of the first terrain that knows enough places, else NaN.

        It has to know at least `minimum` of `xy_world` (n, 2) without guessing (a true `is_guess`).
        """
        for terrain in self.terrains:
            if not getattr(terrain, "is_guess", False):
                heights = terrain.height_at(xy_world)
                if np.isfinite(heights).sum() >= minimum:
                    return heights
        return np.full(len(xy_world), np.nan)

    def heights_and_sources(self, xy_world: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
        """Return the heights (n,) and the sources that answered at least once."""
        xy = np.asarray(xy_world, float)[:, :2]
        heights, sources = np.full(len(xy), np.nan), []
        for terrain in self.terrains:
            unknown = np.flatnonzero(np.isnan(heights))
            if not len(unknown):
                break
            heights[unknown] = terrain.height_at(xy[unknown])
            if not np.isnan(heights[unknown]).all():
                sources.append(terrain.source)
        return heights, tuple(sources)


def read_terrain(path: str | Path, crs: Any = None, units: Units | None = None) -> RasterTerrain:
    """Open the terrain model at `path` for queries in world metres of `crs`.

    Raises InputError. `units` tell those of a cloud without a CRS. It takes rasterio, the extra
    `terrain`.
    """
    import_rasterio()
    is_local = "://" not in str(path) and not str(path).startswith("/vsi")
    if is_local and (reason := explain_fault(path)):
        raise InputError(f"expected a terrain model at {path}, got {reason}; check the path")
    return RasterTerrain(path, crs, units)
