"""The horizon around places: of buildings, of a terrain model, and of a file as PVGIS has it.

Models have upright walls and nothing below their roofs, so whatever lies under a roof's edge is
dark: a ray from a place is free where it passes over every roof edge that it crosses in plan. One
ray is cast in the middle of each of SECTORS directions, and the horizon there is exact.
"""

from __future__ import annotations

import functools
import re
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..geometry.grid import expand
from ..read.crs import find_units, parse_crs
from ..read.terrain import read_terrain
from ..read.terrain.raster import RasterTerrain
from .records import Records
from .weather import EARTH_RADIUS_KM

SECTORS = 180  # directions of rays around a place, 2 degrees apart
LIFT_M = 0.01  # height (m) of a place over its roof, so that rounding does not hide it
MIDDLES_DEG = (np.arange(SECTORS) + 0.5) * (360.0 / SECTORS)
TERRAIN_REACH_M = (
    20_000.0  # distance (m) up to which terrain shades: 350 m of height rise 1 degree there
)
# Places of the grid that stands in for the terrain: 4 MB, read in a second, and 40 m apart where
# the terrain model is so large.
MOST_PLACES = 1_000_000
FINEST_M = 5.0  # least distance (m) of these places: terrain as near as that is a garden
PROBES = 200  # places along a side of a box in which the extent of a terrain is looked for
RAY_GROWTH = 1.02  # of the distance from one place along a ray to the next
REFRACTION = 0.13  # of light near the ground: terrain sinks by d2 (1 - 0.13) / 2 R


def read_horizon(path: str, convergence: float = 0.0) -> np.ndarray:
    """Read the tangents (SECTORS,) of a horizon file of PVGIS.

    It has heights in degrees, at equal angles clockwise from the north. `convergence` (degrees) is
    the direction of the run's grid north, clockwise from true north. Raises InputError.
    """
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
        if re.search(r"\d,\d", text) and len(text.split()) > 1:
            raise ValueError("a comma that may stand for a decimal point, or between two heights")
        heights = np.array([float(word) for word in text.replace(",", " ").split()])
    except (OSError, ValueError) as error:
        raise InputError(
            f"expected a horizon file in {path}, got: {error!s:.200}; give heights in degrees at "
            "equal angles, clockwise from the north, one a line"
        ) from error
    faulty = heights[~((heights >= 0.0) & (heights < 90.0))]
    if len(heights) < 2 or len(faulty):
        got = f"{faulty[0]:g}" if len(faulty) else f"{len(heights)}"
        raise InputError(
            f"expected 2 or more heights between 0 and 90 degrees in {path}, got {got}; mend the "
            "file"
        )
    azimuths = np.arange(len(heights)) * (360.0 / len(heights))
    sectors = np.interp(MIDDLES_DEG + convergence, azimuths, heights, period=360.0)
    return np.tan(np.radians(sectors))


class TerrainHorizon:
    """The horizon that a terrain model makes around places of a run."""

    def __init__(self, records: Records, path: str) -> None:
        terrain, low, high = open_terrain(records, path)
        self.corner = low
        self.spacing, self.heights = sample_terrain(terrain, low, high)
        count = np.log(TERRAIN_REACH_M / (2 * self.spacing)) / np.log(RAY_GROWTH)
        self.distances = 2 * self.spacing * RAY_GROWTH ** np.arange(int(np.ceil(count)))
        self.sink = self.distances**2 * (1.0 - REFRACTION) / (2000.0 * EARTH_RADIUS_KM)
        self.list_rays = functools.lru_cache(1)(self.cast_rays)

    def cast_rays(self, x: float, y: float) -> np.ndarray:
        """Return the heights (SECTORS, n) of the terrain along rays from a place."""
        angles = np.radians(MIDDLES_DEG)
        directions = np.stack([np.sin(angles), np.cos(angles)], axis=-1)
        places = (x, y) + directions[:, None] * self.distances[None, :, None]
        column, row = np.rint((places - self.corner) / self.spacing).astype(int).transpose(2, 0, 1)
        rows, columns = self.heights.shape
        is_known = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        heights = self.heights[np.where(is_known, row, 0), np.where(is_known, column, 0)]
        return np.where(is_known, heights, -np.inf) - self.sink

    def find_horizon(self, x: float, y: float, z: float) -> np.ndarray:
        """Return the tangents (SECTORS,) of the horizon at a place."""
        rise = (self.list_rays(x, y) - z) / self.distances
        return np.maximum(rise.max(axis=1), 0.0)


def open_terrain(records: Records, path: str) -> tuple[RasterTerrain, np.ndarray, np.ndarray]:
    """Open a terrain model around the buildings of a run.

    The corners of the box in which it is known follow. Raises InputError where it cannot be read,
    and where it covers none of them.
    """
    crs = parse_crs(records.head.crs)
    terrain = read_terrain(path, crs, find_units(crs, unit_name=records.head.unit))
    boxes = records.index.boxes[np.isfinite(records.index.boxes[:, 0])]
    return terrain, *find_known_box(terrain, boxes)


def sample_terrain(
    terrain: RasterTerrain, low: np.ndarray, high: np.ndarray
) -> tuple[float, np.ndarray]:
    """Return heights of a terrain in a box, -inf where unknown, after the grid's spacing (m)."""
    spacing = max(FINEST_M, float(np.sqrt(np.prod(high - low) / MOST_PLACES)))
    x, y = (np.arange(a, b + spacing, spacing) for a, b in zip(low, high, strict=True))
    # row by row: a terrain model is read in tiles
    heights = np.stack(
        [terrain.height_at(np.column_stack([x, np.full(len(x), row)])) for row in y]
    ).astype(np.float32)
    return spacing, np.where(np.isfinite(heights), heights, np.float32(-np.inf))


def find_known_box(terrain: RasterTerrain, boxes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the box in which a terrain is known near buildings."""
    low = boxes[:, :2].min(axis=0) - TERRAIN_REACH_M
    high = boxes[:, 2:].max(axis=0) + TERRAIN_REACH_M
    sides = np.linspace(low, high, PROBES)
    places = np.stack(np.meshgrid(*sides.T), axis=-1).reshape(-1, 2)
    places = np.concatenate([places, boxes[:, :2], boxes[:, 2:]])
    places = places[terrain.pixels_at(places)[2]]
    if not len(places):
        raise InputError(
            f"expected a terrain model around the buildings, got {terrain.source}, which covers "
            "none of them; check its place and its CRS"
        )
    step = sides[1] - sides[0]
    return (np.maximum(places.min(axis=0) - step, low), np.minimum(places.max(axis=0) + step, high))


def find_horizon(places: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return the tangents (n, SECTORS) of the horizon around `places` (n, 3).

    `edges` (m, 2, 3) are edges of roofs. Sector 0 begins in the north, and sectors follow
    clockwise. The horizon is nowhere below level.

    >>> wall = np.array([[[-50.0, 10.0, 5.0], [50.0, 10.0, 5.0]]])
    >>> horizon = find_horizon(np.zeros((1, 3)), wall)
    >>> round(float(horizon[0, 0]), 3), float(horizon[0, 90])
    (0.5, 0.0)
    """
    width = 2 * np.pi / SECTORS
    horizon = np.zeros((len(places), SECTORS))
    ends = edges - places[:, None, None]
    place, edge = np.nonzero(ends[:, :, :, 2].max(axis=2) > 0.0)
    a, b = ends[place, edge].swapaxes(0, 1)
    first, last = (np.arctan2(end[:, 0], end[:, 1]) for end in (a, b))
    turn = (last - first + np.pi) % (2 * np.pi) - np.pi
    low = np.minimum(first, first + turn)
    start = np.ceil(low / width - 0.5).astype(np.int64)
    end = np.floor((low + np.abs(turn)) / width - 0.5).astype(np.int64)
    # one row for each edge and each ray that crosses it
    row, step = expand(np.maximum(end - start + 1, 0))
    sector = (start[row] + step) % SECTORS
    angle = (sector + 0.5) * width
    ray, a, way = np.array([np.sin(angle), np.cos(angle)]), a[row].T, (b - a)[row].T
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (ray[1] * a[0] - ray[0] * a[1]) / (ray[0] * way[1] - ray[1] * way[0])
        distance = (ray * (a[:2] + share * way[:2])).sum(axis=0)
        rise = (a[2] + share * way[2]) / distance
    ahead = distance > 1e-6
    np.maximum.at(horizon, (place[row][ahead], sector[ahead]), rise[ahead])
    return horizon


def measure_share(horizon: np.ndarray, sector: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """Return the share (t,) of places that see the sun at `sector` (t,), `tangent` (t,)."""
    return (tangent > horizon[:, sector]).mean(axis=0)
