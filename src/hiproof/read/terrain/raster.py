"""A raster terrain model, read in tiles, as heights in metres.

Values that the file calls no data are no heights, nor are values that stand for no data without
being declared so.
"""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from pyproj import CRS

from ...errors import DamagedRaster, InputError, warn
from ...extras import import_extra
from ...frames import Box, Units
from ...geometry.grid import number_cells
from ...masking import mask, remember
from ..crs import (
    find_units,
    horizontal_crs,
    make_transformer,
    names_place,
    parse_crs,
    same_horizontal,
    vertical_crs,
)
from ..names import READING
from ..plausible import HIGHEST_LAND_M, LOWEST_LAND_M
from ..remote import FilePath
from .raster_checks import band_unit, choose_bands, read_scaling, refuse_without_position

TILE_PX = 512  # Side (pixels) of what is read at once. GeoTIFFs are often stored in such tiles.

TILES_KEPT = 8  # Tiles kept in memory (8 MB). Buildings come in order of place.

# Tiles read before work starts, to find damage: 1 GB of pixels, some 40 s of a run over hundreds of
# thousands of buildings.
MOST_TILES_CHECKED = 4000

# Stored values that programs write for "no data", whatever their scale and unit.
NODATA_CODES: list[float] = READING["nodata_codes"]

# Distance (m) from all other heights that makes one of CODES no height: ground has steps of that
# size, but no ground between them is rare.
ISOLATED_M = 1.5

FEWEST_CODED = 4  # pixels with such a value, below which it is chance

# Other pixels within ISOLATED_M of such a value, as a share of those that have it: blends along its
# border.
MOST_BETWEEN = 0.01

# Tiles along each side of the raster that are compared for it, evenly spread: the answer does not
# depend on what was read.
SAMPLED_TILES = 4


class RasterTerrain:
    """A raster terrain model, interpolated bilinearly between its pixel centres.

    It may be in another CRS than the cloud. Pixels are read in tiles when asked for, a few of which
    are kept, so memory does not grow with the raster. Pixels without a height take no part: beside
    pixels with heights these count alone, amid others the answer is NaN.
    """

    def __init__(self, path: FilePath, crs: Any = None, units: Units | None = None):
        """Open `path`, to be queried in world metres of `crs`.

        None is for the raster's own CRS. Raises InputError. `units` are those of `crs`, which need
        naming where there is none.
        """
        remember(str(path))
        self.path, self.source = str(path), f"terrain model {Path(mask(str(path))).name}"
        self.crs = parse_crs(crs)
        refuse_without_position(self.dataset, self.path)
        self.band, self.alpha = choose_bands(self.dataset, self.path)
        self.scale, self.offset = read_scaling(self.dataset, self.band, self.path)
        self.units = units or find_units(self.crs or self.own_crs, f"the terrain model {path}")
        self.transformer = self.make_transformer()
        self.metres_in_height = self.height_unit()

    @cached_property
    def dataset(self):
        rasterio = import_rasterio()
        from rasterio.errors import NotGeoreferencedWarning, RasterioError

        try:
            with warnings.catch_warnings():
                # it is refused, in a sentence
                warnings.simplefilter("ignore", NotGeoreferencedWarning)
                return rasterio.open(self.path)
        except (RasterioError, OSError) as error:
            raise InputError(
                f"expected a raster that GDAL reads (GeoTIFF, ...) at {self.path}, got: {error}; "
                "check the file"
            ) from error

    def __getstate__(self) -> dict:
        """Leave out the open file and tiles, so that a worker opens its own."""
        opened = ("dataset", "tile")
        return {name: value for name, value in vars(self).items() if name not in opened}

    @cached_property
    def tile(self) -> Callable[[int, int], np.ndarray]:
        """`read_tile` that keeps a few tiles."""
        return functools.lru_cache(TILES_KEPT)(self.read_tile)

    @property
    def own_crs(self) -> CRS | None:
        return parse_crs(self.dataset.crs.to_wkt()) if self.dataset.crs else None

    def make_transformer(self):
        """Make the transformer from queries to the raster, None for the same, or unknown, plan."""
        own_crs = self.own_crs
        if self.crs is None or own_crs is None or same_horizontal(self.crs, own_crs):
            return None
        if not (names_place(self.crs) and names_place(own_crs)):
            return None
        return make_transformer(self.crs, own_crs)

    def height_unit(self) -> float:
        """Return the metres in one unit of the raster's heights.

        The band names the unit, else its CRS, else it is the cloud's. Heights over a plan in
        degrees are metres. Those over a plan in feet that name no unit are taken for feet.
        """
        unit, own_crs = band_unit(self.dataset.units[self.band - 1], self.path), self.own_crs
        if unit is not None:
            return unit
        if own_crs is None:
            return self.units.height
        plan = horizontal_crs(own_crs)
        if vertical_crs(own_crs) is None and (plan.is_geographic or plan.is_geocentric):
            return 1.0
        units = find_units(own_crs, f"the terrain model {self.path}")
        if vertical_crs(own_crs) is None and not units.are_metres:
            warn(self.path, f"names no unit of its heights; taken as {units.height_name}")
        return units.height

    @property
    def bounds(self) -> Box:
        """Extent (xmin, ymin, xmax, ymax) in the raster's own CRS."""
        return tuple(self.dataset.bounds)

    def height_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return the height (n,) in m at `xy_world` (n, 2), NaN where the raster has none."""
        row, column, inside = self.pixels_at(xy_world)
        heights = np.full(len(row), np.nan)
        # Bilinear interpolation runs between pixel centres; the outermost half pixel takes its
        # centre's value.
        places = np.column_stack([row, column])[inside] - 0.5
        last = np.array(self.dataset.shape) - 1
        heights[inside] = bilinear(self.take, *np.clip(places, 0, last).T)
        return heights

    def is_coded_at(self, xy_world: np.ndarray) -> np.ndarray:
        """Return whether (n,) pixels at `xy_world` (n, 2) hold a code, that is, no height."""
        row, column, inside = self.pixels_at(xy_world)
        coded = np.zeros(len(row), bool)
        coded[inside] = np.isinf(self.take(row[inside].astype(int), column[inside].astype(int)))
        return coded

    def take(self, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Return heights (n,) of pixels within the raster, NaN or infinite as `read_tile`."""
        places = np.minimum(np.column_stack([row, column]), np.array(self.dataset.shape) - 1)
        tiles, index = number_cells(places // TILE_PX)
        result = np.empty(len(row))
        for k, tile in enumerate(tiles.tolist()):
            selection = index == k
            result[selection] = self.tile(*tile)[tuple((places[selection] % TILE_PX).T)]
        return result

    def pixels_at(self, xy_world: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return rows and columns (n,) at `xy_world` (n, 2), and which lie inside."""
        x, y = self.units.from_metres(np.asarray(xy_world, float)[:, :2]).T
        if self.transformer is not None:
            x, y = self.transformer.transform(x, y)
        a, b, c, d, e, f, *_ = ~self.dataset.transform
        column, row = a * x + b * y + c, d * x + e * y + f
        height, width = self.dataset.shape
        return row, column, (column >= 0) & (row >= 0) & (column <= width) & (row <= height)

    def knows_any(self, xy_world: np.ndarray) -> bool:
        """Return whether any of `xy_world` (n, 2), sampled, has a height; or DamagedRaster."""
        row, column, inside = self.pixels_at(xy_world)
        places = np.column_stack([row, column])[inside]
        tiles, index = np.unique(np.floor(places / TILE_PX), axis=0, return_inverse=True)
        step = -(-max(len(tiles), 1) // MOST_TILES_CHECKED)
        sample = np.asarray(xy_world)[inside][index.ravel() % step == 0]
        return bool(np.isfinite(self.height_at(sample)).any())

    def read_tile(self, row: int, column: int) -> np.ndarray:
        """Return a tile's heights (m), NaN without data, infinite where they are no height."""
        stored, heights = self.stored_and_heights(row, column)
        is_code = np.isin(stored, NODATA_CODES) & np.isfinite(heights)
        if is_code.any():
            heights[is_code & np.isin(stored, self.codes)] = np.inf
        return heights

    def stored_and_heights(self, row: int, column: int) -> tuple[np.ndarray, np.ndarray]:
        """Return a tile's stored values (NaN without data) and heights (infinite if none)."""
        from rasterio.errors import RasterioError
        from rasterio.windows import Window

        y, x = row * TILE_PX, column * TILE_PX
        height, width = self.dataset.shape
        window = Window(x, y, min(TILE_PX, width - x), min(TILE_PX, height - y))
        try:
            pixels = self.dataset.read(self.band, window=window, masked=True)
            stored = pixels.astype(float).filled(np.nan)
            if self.alpha is not None:
                stored[self.dataset.read(self.alpha, window=window) == 0] = np.nan
        except (RasterioError, OSError) as error:
            raise DamagedRaster(
                f"expected a complete raster at {self.path}, got: {error.__cause__ or error}; copy "
                "or download it again"
            ) from error
        with np.errstate(over="ignore"):
            heights = (stored * self.scale + self.offset) * self.metres_in_height
        heights[(heights < LOWEST_LAND_M) | (heights > HIGHEST_LAND_M)] = np.inf
        return stored, heights

    @cached_property
    def codes(self) -> tuple[float, ...]:
        """Those of CODES that lie far from all other pixels of some tiles, so are no heights."""
        along = [
            set(np.linspace(0, (size - 1) // TILE_PX, SAMPLED_TILES).round().astype(int).tolist())
            for size in self.dataset.shape
        ]
        pairs = [self.stored_and_heights(*tile) for tile in product(*along)]
        stored = np.concatenate([stored[np.isfinite(heights)] for stored, heights in pairs])
        heights = np.concatenate([heights[np.isfinite(heights)] for _, heights in pairs])
        return tuple(code for code in NODATA_CODES if is_isolated(heights, stored == code))


def is_isolated(heights: np.ndarray, is_coded: np.ndarray) -> bool:
    """Return whether pixels of one height lie far from nearly all others, if any."""
    coded = int(is_coded.sum())
    if coded < FEWEST_CODED or coded == len(heights):
        return False
    mask = np.abs(heights - heights[is_coded][0]) < ISOLATED_M
    return int((mask & ~is_coded).sum()) < MOST_BETWEEN * coded


def bilinear(
    take: Callable[[np.ndarray, np.ndarray], np.ndarray], row: np.ndarray, column: np.ndarray
) -> np.ndarray:
    """Return the weighted mean (n,) of four pixels by `take`, of finite ones, or NaN."""
    row0, column0 = row.astype(int), column.astype(int)
    down, right = row - row0, column - column0
    values = np.stack([take(row0 + i, column0 + j) for i in (0, 1) for j in (0, 1)])
    weights = np.stack([y * x for y in (1 - down, down) for x in (1 - right, right)])
    is_unknown = ~np.isfinite(values)
    weights[is_unknown] = values[is_unknown] = 0.0
    total = weights.sum(axis=0)
    return (weights * values).sum(axis=0) / np.where(total > 1e-9, total, np.nan)


def import_rasterio() -> Any:
    """Import rasterio. Raises InputError where it is missing."""
    return import_extra("rasterio", "terrain", "terrain models")
