"""How high is the ground: a terrain model; and several terrains in turn.

Each answers `height_at` and names its `source`; a `TerrainChain` asks the next where one does not know.
"""

from __future__ import annotations

import warnings
from collections import OrderedDict
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from pyproj import CRS

from ..errors import InputError, InputWarning
from ..extras import needed
from ..frames import Units
from ..masking import masked
from .crs import horizontal_crs, parse_crs, same_horizontal, units_of, vertical_crs
from .plausible import MOST_HEIGHT

TILE_PX = 512  # pixels, side of what is read at once: GeoTIFFs are often stored in such tiles
TILES_KEPT = 8  # tiles in memory, 8 MB; buildings come in order of place
HEIGHT_UNITS = {
    **dict.fromkeys(("m", "metre", "meter", "metres", "meters"), 1.0),
    **dict.fromkeys(("ft", "foot", "feet", "international foot"), 0.3048),
    **dict.fromkeys(("us-ft", "ftus", "us survey foot", "us survey feet"), 1200 / 3937),
}
"""Metres in the units that a raster's band may name."""


class Terrain(Protocol):
    """Heights of the ground in world coordinates; `source` is the text a building's output names it by."""

    @property
    def source(self) -> str: ...

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Height (n,) at `xy_world` (n, 2), NaN where unknown."""
        ...


class RasterTerrain:
    """A raster terrain model, interpolated bilinearly between its pixel centres; it may be in another CRS than the cloud.

    Pixels are read in tiles when asked for, a few of which are kept: memory does not grow with the raster. Cells without
    data take no part: between them and cells with data the latter's weighted mean is given, amid them NaN.
    """

    def __init__(self, path: str | Path, crs: Any = None, units: Units | None = None):
        """Open `path` to be asked in `crs`, None for the raster's own, counted in world metres. Raises InputError.

        `units` are those of `crs`, which need telling where there is none.
        """
        self.path, self.source = str(path), f"terrain model {Path(masked(str(path))).name}"
        self.crs = parse_crs(crs)
        self.tiles: OrderedDict[tuple[int, int], np.ndarray] = OrderedDict()
        if self.dataset.crs is None and self.dataset.transform.is_identity:
            raise InputError(
                f"expected a georeferenced raster of heights at {path}, got an image without position; name a GeoTIFF"
            )
        self.units = units or units_of(self.crs or self.own_crs, f"the terrain model {path}")
        self.transformer = self.make_transformer()
        self.metres_in_height = self.height_unit()

    @cached_property
    def dataset(self):
        rasterio = import_rasterio()
        from rasterio.errors import RasterioError

        try:
            return rasterio.open(self.path)
        except (RasterioError, OSError) as error:
            raise InputError(
                f"expected a raster that GDAL reads (GeoTIFF, ...) at {self.path}, got: {error}; check the file"
            ) from error

    def __getstate__(self) -> dict:
        """Without the open file and the tiles, so that a worker process opens its own."""
        return {**{k: v for k, v in vars(self).items() if k not in ("dataset", "transformer")}, "tiles": OrderedDict()}

    def __setstate__(self, state: dict) -> None:
        vars(self).update(state)
        self.transformer = self.make_transformer()

    @property
    def own_crs(self) -> CRS | None:
        return parse_crs(self.dataset.crs.to_wkt()) if self.dataset.crs else None

    def make_transformer(self):
        """From the coordinates asked for to the raster's; None where they are the same in plan, or one is unknown."""
        own = self.own_crs
        if self.crs is None or own is None or same_horizontal(self.crs, own):
            return None
        from pyproj import Transformer

        return Transformer.from_crs(self.crs, own, always_xy=True)

    def height_unit(self) -> float:
        """Metres in one unit of the raster's heights: as its band says, else its CRS, else as the cloud counts.

        Heights over a plan in degrees are metres; those over a plan in feet that say nothing are taken for feet.
        """
        name, own = self.dataset.units[0], self.own_crs
        if name and name.lower() in HEIGHT_UNITS:
            return HEIGHT_UNITS[name.lower()]
        if own is None:
            return self.units.height
        plan = horizontal_crs(own)
        if vertical_crs(own) is None and (plan.is_geographic or plan.is_geocentric):
            return 1.0
        units = units_of(own, f"the terrain model {self.path}")
        if vertical_crs(own) is None and not units.are_metres:
            warnings.warn(f"{self.path}: names no unit of its heights; taken as {units.height_name}", InputWarning)
        return units.height

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Extent (xmin, ymin, xmax, ymax) in the raster's own CRS."""
        return tuple(self.dataset.bounds)

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Height (n,) in metres at `xy_world` (n, 2), NaN outside the raster and where it has no data."""
        row, column, inside = self.pixels_at(xy_world)
        heights = np.full(len(row), np.nan)
        # Bilinear interpolation runs between pixel centres; the outermost half pixel takes its centre's value.
        column = np.clip(column[inside] - 0.5, 0, self.dataset.width - 1)
        row = np.clip(row[inside] - 0.5, 0, self.dataset.height - 1)
        heights[inside] = self.interpolate(row, column) * self.metres_in_height
        return heights

    def pixels_at(self, xy_world: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows and columns (n,) of the raster at `xy_world` (n, 2), and whether (n,) they are inside it."""
        xy = self.units.from_metres(np.asarray(xy_world, float)[:, :2])
        if self.transformer is not None:
            xy = np.column_stack(self.transformer.transform(xy[:, 0], xy[:, 1]))
        to_pixel = ~self.dataset.transform
        column = to_pixel.a * xy[:, 0] + to_pixel.b * xy[:, 1] + to_pixel.c
        row = to_pixel.d * xy[:, 0] + to_pixel.e * xy[:, 1] + to_pixel.f
        return row, column, (column >= 0) & (row >= 0) & (column <= self.dataset.width) & (row <= self.dataset.height)

    def interpolate(self, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Heights (n,) at fractional pixel-centre positions inside the raster, tile by tile."""
        heights = np.full(len(row), np.nan)
        tile_rows, tile_columns = (row // TILE_PX).astype(int), (column // TILE_PX).astype(int)
        for tile_row, tile_column in np.unique(np.column_stack([tile_rows, tile_columns]), axis=0):
            here = (tile_rows == tile_row) & (tile_columns == tile_column)
            pixels = self.tile(int(tile_row), int(tile_column))
            heights[here] = bilinear(pixels, row[here] - tile_row * TILE_PX, column[here] - tile_column * TILE_PX)
        return heights

    def tile(self, row: int, column: int) -> np.ndarray:
        """Pixels of a tile and one more row and column (where the raster has them), float64, NaN without data."""
        from rasterio.errors import RasterioError
        from rasterio.windows import Window

        key = (row, column)
        if key not in self.tiles:
            height = min(TILE_PX + 1, self.dataset.height - row * TILE_PX)
            width = min(TILE_PX + 1, self.dataset.width - column * TILE_PX)
            window = Window(column * TILE_PX, row * TILE_PX, width, height)
            try:
                pixels = self.dataset.read(1, window=window, masked=True).astype(float).filled(np.nan)
            except RasterioError as error:
                raise InputError(
                    f"expected a complete raster at {self.path}, got: {error}; copy or download it again"
                ) from error
            # 3.4e38 and its like say "no data" in rasters that do not declare it
            self.tiles[key] = np.where(np.abs(pixels) <= MOST_HEIGHT, pixels, np.nan)
        self.tiles.move_to_end(key)
        if len(self.tiles) > TILES_KEPT:
            self.tiles.popitem(last=False)
        return self.tiles[key]


def bilinear(pixels: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Weighted mean (n,) of the four pixels around each position, those that are NaN left out; NaN where all are."""
    row0, column0 = np.floor(row).astype(int), np.floor(column).astype(int)
    row1, column1 = np.minimum(row0 + 1, pixels.shape[0] - 1), np.minimum(column0 + 1, pixels.shape[1] - 1)
    down, right = row - row0, column - column0
    values = np.stack([pixels[row0, column0], pixels[row0, column1], pixels[row1, column0], pixels[row1, column1]])
    weights = np.stack([(1 - down) * (1 - right), (1 - down) * right, down * (1 - right), down * right])
    weights = np.where(np.isnan(values), 0.0, weights)
    total = weights.sum(axis=0)
    known = total > 1e-9
    return np.where(known, (weights * np.nan_to_num(values)).sum(axis=0) / np.where(known, total, 1.0), np.nan)


class TerrainChain:
    """Several terrains by preference: each position is answered by the first that knows it."""

    def __init__(self, terrains: Iterable[Terrain | None]):
        self.terrains = tuple(terrain for terrain in terrains if terrain is not None)

    @property
    def source(self) -> str:
        return ", else ".join(terrain.source for terrain in self.terrains)

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Height (n,) at `xy_world` (n, 2), NaN where none knows."""
        return self.heights_and_sources(xy_world)[0]

    def heights_and_sources(self, xy_world: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
        """Heights (n,) and the sources that answered at least once, by preference: what a building's output names."""
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
    """The terrain model at `path`, to be asked in world metres of `crs`, the cloud's. Raises InputError.

    `units` tell those of a cloud without a CRS. It takes rasterio, the extra `terrain`.
    """
    import_rasterio()
    if "://" not in str(path) and not str(path).startswith("/vsi") and not Path(path).is_file():
        raise InputError(f"expected a terrain model at {path}, got no such file; check the path")
    return RasterTerrain(path, crs, units)


def import_rasterio() -> Any:
    """What reads rasters. Raises InputError where it is missing."""
    return needed("rasterio", "terrain", "terrain models")
