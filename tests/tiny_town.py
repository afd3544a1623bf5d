"""A town of a few houses as files: a LAZ cloud with ground, GeoJSON footprints, their truth. Small
enough for any test.
"""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import laspy
import numpy as np
import pyproj
import shapely

from layers import write_layer

ORIGIN = np.array([85000.0, 446000.0, 2.0])
CRS = "EPSG:7415"


@dataclass(frozen=True)
class Town:
    """`xyz` (n, 3) and `classification` (n,) of the cloud, footprints by id."""

    xyz: np.ndarray
    classification: np.ndarray
    footprints: dict[str, shapely.Polygon]

    def lie_in(self, area) -> np.ndarray:
        """Whether each point (n,) lies in an area."""
        return shapely.intersects_xy(area, *self.xyz[:, :2].T)

    def select(self, chosen) -> "Town":
        """The town with some of its points."""
        return replace(self, xyz=self.xyz[chosen], classification=self.classification[chosen])

    def write(self, path: Path, shift=0.0, **options) -> str:
        """Write the cloud, moved by a shift; the path as text."""
        return str(write_cloud(path, self.xyz + shift, self.classification, **options))


def gable(x, y, width, length, eave, rise):
    """Height over a gable roof whose ridge runs along x, for points relative to its lower left
    corner.
    """
    return eave + rise * (1 - np.abs(y - width / 2) / (width / 2))


def make_town(houses: int = 4, density: float = 4.0, seed: int = 0) -> Town:
    """Gables and flat blocks in a row along a street that rises a little; ground around them, a
    tree, some noise.
    """
    town = draw_town(houses, density, seed)
    return Town(town.xyz.copy(), town.classification.copy(), dict(town.footprints))


@cache
def draw_town(houses: int, density: float, seed: int) -> Town:
    rng = np.random.default_rng(seed)
    points, classes, footprints = [], [], {}
    area = (30.0 * houses, 40.0)
    xy = rng.uniform((0, 0), area, (int(density * area[0] * area[1]), 2))
    on_roof = np.zeros(len(xy), bool)
    for i in range(houses):
        corner, size = np.array([30.0 * i + 8, 12.0]), np.array([12.0 + i % 3, 8.0 + i % 2])
        inside = ((xy >= corner) & (xy <= corner + size)).all(axis=1)
        on_roof |= inside
        local = xy[inside] - corner
        z = (
            gable(local[:, 0], local[:, 1], size[1], size[0], 5.0, 3.0)
            if i % 4 != 3
            else np.full(inside.sum(), 6.0)
        )
        points.append(np.column_stack([xy[inside], z + 0.01 * xy[inside, 0]]))
        classes.append(np.full(inside.sum(), 6, np.uint8))
        footprints[f"house-{i}"] = shapely.box(
            *(corner + ORIGIN[:2]), *(corner + size + ORIGIN[:2])
        )
    points.append(np.column_stack([xy[~on_roof], 0.01 * xy[~on_roof, 0]]))
    classes.append(np.full((~on_roof).sum(), 2, np.uint8))
    xyz = np.concatenate(points) + ORIGIN
    xyz[:, 2] += rng.normal(0, 0.03, len(xyz))
    return Town(np.round(xyz, 3), np.concatenate(classes), footprints)


def write_cloud(
    path: Path,
    xyz: np.ndarray,
    classification: np.ndarray,
    crs: str | None = CRS,
    origin: np.ndarray = ORIGIN,
) -> Path:
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [0.001] * 3, np.floor(origin)
    if crs:
        header.add_crs(pyproj.CRS(crs))
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.classification = classification
    las.write(path)
    return path


def write_footprints(
    path: Path, footprints: dict[str, shapely.Polygon], crs: str | None = "EPSG:28992"
) -> Path:
    ids, options = {"id": np.array(list(footprints), object)}, {"geometry_type": "Unknown"}
    return write_layer(path, footprints.values(), ids, crs, **options)


def write_town(folder: Path, town: Town | None = None) -> tuple[Path, Path]:
    """Paths of the town's cloud and footprints, written into `folder`."""
    town = town or make_town()
    folder.mkdir(parents=True, exist_ok=True)
    cloud = Path(town.write(folder / "cloud.laz"))
    return cloud, write_footprints(folder / "footprints.geojson", town.footprints)
