"""A survey flight over a town, and its files: a classified LAZ, terrain and footprints."""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import OutputError
from ..frames import Box, turn_points
from .flight import Swath, join_beams, make_beams
from .relief import Relief
from .scanner import Scan, ScanSettings, returns, with_outliers
from .scene import SOURCES
from .town import Lot, town_scene

CRS = "EPSG:7415"
PATCH_M = 100.0  # m, side of what is scanned at once: memory stays small for any town
OUTLIER_SHARE = 2e-4  # of the points: birds and multipath
# a date that does not change, so that the same seed gives the same bytes
EPOCH = datetime.date(2020, 1, 1)
# Classes of ASPRS by source, as producers deliver: ground 2, trees 5, all that is built 6.
CLASSES = np.array([{"ground": 2, "tree": 5}.get(source, 6) for source in SOURCES], np.uint8)


@dataclass(frozen=True)
class Flight:
    """Parallel flight lines over a town.

    `heading` (rad) goes through `origin` (2,); there are flying height, half the field of view
    (deg), the distance between lines, and `registration` (m), one sigma of a line's offset.
    """

    heading: float
    origin: np.ndarray
    altitude_m: float = 1200.0
    half_view_deg: float = 20.0
    line_distance_m: float = 620.0
    registration_m: float = 0.02

    def plan_swaths(
        self, seed: int, centre: np.ndarray, radius: float, density: float
    ) -> list[Swath]:
        """Return flight lines' swaths, of `density` in the mean, that see a disc of `radius`."""
        half_width = self.altitude_m * math.tan(math.radians(self.half_view_deg))
        spacing = math.sqrt(2 * half_width / self.line_distance_m / density)
        along, across = turn_points((centre - self.origin)[None], -self.heading)[0]
        first = math.ceil((across - radius - half_width) / self.line_distance_m)
        last = math.floor((across + radius + half_width) / self.line_distance_m)
        swaths = []
        for line in range(first, last + 1):
            from_line = across - line * self.line_distance_m
            rng = np.random.default_rng([seed, 7, line % 2**32])
            swaths.append(
                Swath(
                    heading=self.heading,
                    line_spacing=spacing * 1.15,
                    point_spacing=spacing / 1.15,
                    tan_angle=from_line / self.altitude_m,
                    tan_growth=1.0 / self.altitude_m,
                    pairing=0.3,
                    edges=(-half_width - from_line, half_width - from_line),
                    shift=tuple(rng.normal(0.0, self.registration_m, 3)),
                    anchor=(float(along), float(from_line)),
                )
            )
        return swaths


def divide_into_patches(bounds: Box) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return lowest and highest corners (2,) of patches of at most PATCH_M in `bounds`."""
    lower, upper = np.array(bounds[:2]), np.array(bounds[2:])
    columns, rows = np.ceil((upper - lower) / PATCH_M).astype(int)
    corners = [lower + PATCH_M * np.array([i, j]) for i in range(columns) for j in range(rows)]
    return [(corner, np.minimum(corner + PATCH_M, upper)) for corner in corners]


def survey(
    patches: list[tuple[np.ndarray, np.ndarray]],
    lots: list[Lot],
    terrain: Relief,
    flight: Flight,
    seed: int,
    settings: ScanSettings,
) -> Iterator[Scan]:
    """Yield the points (world) of each of `patches`, whatever else of the town is surveyed.

    `lots` must hold every lot that reaches into the patches.
    """
    lot_bounds = np.array([lot.bounds for lot in lots]).reshape(-1, 4)
    for lower, upper in patches:
        # Shadows and leaning trees of the next patch reach this far.
        mask = np.all(
            (lot_bounds[:, :2] < upper + 20.0) & (lot_bounds[:, 2:] > lower - 20.0), axis=1
        )
        patch_lots = [lots[k] for k in np.flatnonzero(mask)]
        yield surveyed_patch(lower, upper, patch_lots, terrain, flight, seed, settings)


def surveyed_patch(
    lower: np.ndarray,
    upper: np.ndarray,
    lots: list[Lot],
    terrain: Relief,
    flight: Flight,
    seed: int,
    settings: ScanSettings,
) -> Scan:
    """Return the points of the patch `lower` to `upper` (2,), by a seed of its place."""
    xy_centre = (lower + upper) / 2
    centre = np.array([*xy_centre, float(terrain.height_at(xy_centre[None])[0])])
    rng = np.random.default_rng([seed, 3, *(np.round(xy_centre * 100).astype(np.int64) % 2**32)])
    reach = math.hypot(*(upper - lower)) / 2
    swaths = flight.plan_swaths(seed, xy_centre, reach, settings.density)
    beams = join_beams([make_beams(rng, swath, np.zeros(2), reach + 8.0, 4.0) for swath in swaths])
    cloud = returns(
        town_scene(lots, terrain, centre),
        beams.select((np.abs(beams.xy0) < (upper - xy_centre + 12.0)).all(axis=1)),
        rng,
        settings,
    )
    cloud = with_outliers(rng, cloud, OUTLIER_SHARE).move(centre)
    inside = np.all((cloud.points[:, :2] >= lower) & (cloud.points[:, :2] < upper), axis=1)
    return cloud.select(inside)


def write_laz(path: Path, clouds: Iterator[Scan], origin: np.ndarray) -> int:
    """Write clouds to one LAZ 1.4, streamed; return the count, OutputError if it cannot."""
    import laspy
    from pyproj import CRS as ProjCRS

    header = laspy.LasHeader(version="1.4", point_format=6)
    header.add_crs(ProjCRS(CRS))
    header.scales, header.offsets = np.full(3, 0.01), np.floor(origin)
    header.creation_date, header.generating_software = EPOCH, "hiproof simulate"
    count = 0
    try:
        with laspy.open(
            path, mode="w", header=header, laz_backend=laspy.LazBackend.Lazrs
        ) as writer:
            for cloud in clouds:
                record = laspy.ScaleAwarePointRecord.zeros(len(cloud), header=header)
                record.x, record.y, record.z = cloud.points.T
                record.classification = CLASSES[cloud.source]
                record.return_number[:] = record.number_of_returns[:] = 1
                writer.write_points(record)
                count += len(cloud)
    except OSError as error:
        raise OutputError(
            f"expected to write {path}, got: {error}; choose a folder that can be written"
        ) from error
    return count


def write_terrain(path: Path, bounds: Box, terrain: Relief) -> None:
    """Write terrain heights at the centres of pixels of a metre as a GeoTIFF."""
    from ..read.terrain.raster import import_rasterio

    rasterio = import_rasterio()
    from rasterio.transform import from_origin

    x_low, y_low, x_high, y_high = bounds
    x, y = np.arange(x_low + 0.5, x_high), np.arange(y_high - 0.5, y_low, -1.0)
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    heights = np.round(terrain.height_at(grid.reshape(-1, 2)).reshape(grid.shape[:2]), 3).astype(
        np.float32
    )
    profile = {
        "driver": "GTiff",
        "count": 1,
        "dtype": "float32",
        "compress": "deflate",
        "predictor": 3,
    }
    shape = {
        "height": len(y),
        "width": len(x),
        "crs": CRS,
        "transform": from_origin(x_low, y_high, 1.0, 1.0),
    }
    with rasterio.open(path, "w", **profile, **shape) as file:
        file.write(heights, 1)


def write_footprints(path: Path, lots: list[Lot], append: bool = False) -> None:
    """Write outlines of `lots`, with `id`, as a GeoPackage's "footprints"."""
    import pyogrio
    import shapely

    # The file's time stamps would make every copy differ.
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": "2020-01-01T00:00:00.000Z"})
    try:
        pyogrio.raw.write(
            path,
            geometry=shapely.to_wkb([lot.building.footprint for lot in lots]),
            field_data=[np.array([lot.id for lot in lots], dtype=object)],
            fields=["id"],
            geometry_type="Polygon",
            crs="EPSG:28992",
            layer="footprints",
            driver="GPKG",
            append=append,
        )
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": None})
