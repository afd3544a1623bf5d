"""The scenes of the campaign: simulated buildings with real faults.

They are input files.

A scene holds up to 100 buildings on a square grid. Its seed draws their shapes, the scanner, the
damage to points and footprints, and the settings of the run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyogrio
import shapely

from hiproof.city.run import Request
from hiproof.settings import Settings
from hiproof.simulate import (
    COMPOUND_KINDS,
    ROOF_TYPES,
    SOURCES,
    Defects,
    ScanSettings,
    SimBuilding,
    random_building,
    random_compound,
    scan,
)
from hiproof.simulate.compounds import CompoundLayout, houses_in_a_row
from hiproof.simulate.roofs import assemble, make_part

BUILDINGS_A_SCENE = 100
SPACING_M = 90.0  # Distance between the buildings of a scene. A city block is up to 60 m wide.
ORIGIN = np.array([100000.0, 450000.0, 5.0])
CRS = "EPSG:7415"
CLASS_OF_SOURCE = {"roof": 6, "wall": 6, "ground": 2, "tree": 5, "clutter": 6}
UNCLASSIFIED = 1
DENSITIES = (0.5, 30.0)  # points/m2
# Shares of the buildings; the others have one roof shape.
SHARE_OF_BLOCKS, SHARE_OF_COMPOUNDS = 0.06, 0.5


@dataclass(frozen=True)
class SceneSettings:
    """What all buildings of a scene share; `changes` are the settings of the run."""

    density: float
    has_classes: bool
    has_footprints: bool
    damage: float  # Probability of each damage to a building's points and footprint.
    changes: dict[str, dict[str, Any]] = field(default_factory=dict)


@dataclass(frozen=True)
class Placed:
    """A building of a scene in world coordinates; `source` (n,) indexes SOURCES."""

    id: str
    points: np.ndarray
    source: np.ndarray
    footprint: shapely.Geometry


def draw_settings(rng: np.random.Generator) -> SceneSettings:
    """Draw the settings of a scene."""
    changes: dict[str, dict[str, Any]] = {}
    if rng.random() < 0.1:
        changes["write"] = {
            "lods": ["0", "1.2", "1.3", "2.2"],
            "parts_as": "buildingparts",
            "citygml": "both",
        }
    if rng.random() < 0.2:
        changes["compound"] = {"detail": str(rng.choice(("fine", "main")))}
    if rng.random() < 0.1:
        changes["fit"] = {"types": ["gable", "hip", "shed", "gambrel"]}
    return SceneSettings(
        density=float(math.exp(rng.uniform(*np.log(DENSITIES)))),
        has_classes=bool(rng.random() < 0.7),
        has_footprints=bool(rng.random() < 0.65),
        damage=float(rng.choice((0.0, 0.1, 0.4))),
        changes=changes,
    )


def write_scene(seed: int, count: int, folder: Path) -> Request:
    """Write the first `count` buildings of the scene `seed`; return the run over them."""
    settings = draw_settings(np.random.default_rng([seed, 0]))
    buildings = [place_building(seed, number, settings) for number in range(1, count + 1)]
    folder.mkdir(parents=True, exist_ok=True)
    cloud, footprints = folder / "cloud.laz", folder / "footprints.gpkg"
    sources = np.concatenate([building.source for building in buildings])
    points = np.concatenate([building.points for building in buildings])
    write_cloud(cloud, points, classify(sources, settings.has_classes))
    if settings.has_footprints:
        write_footprints(footprints, buildings)
    return Request(
        (str(cloud),),
        folder / "run",
        str(footprints) if settings.has_footprints else None,
        settings=Settings.from_dict(settings.changes),
        restart=True,
    )


def place_building(seed: int, number: int, settings: SceneSettings) -> Placed:
    """Draw, scan and damage building `number` of the scene `seed`."""
    rng = np.random.default_rng([seed, number])
    row, column = divmod(number - 1, math.isqrt(BUILDINGS_A_SCENE))
    corner = np.array([column * SPACING_M, row * SPACING_M, 0.0])
    place = ORIGIN + (corner + rng.uniform(0, (5, 5, 9)))
    building = draw_building(rng, place)
    defects = Defects() if rng.random() < 0.7 else Defects.none()
    scanner = ScanSettings(density=settings.density, defects=defects, margin_m=4.0)
    cloud = scan(building, rng, scanner)
    keep = damage_points(rng, cloud.points, building.footprint, settings.damage)
    footprint = damage_footprint(rng, building.footprint, settings.damage)
    return Placed(f"b{number:03d}", cloud.points[keep], cloud.source[keep], footprint)


def draw_building(rng: np.random.Generator, place: np.ndarray) -> SimBuilding:
    """Draw a building of any kind on the ground at `place` (3,)."""
    share = rng.random()
    if share < SHARE_OF_BLOCKS:
        return draw_city_block(rng, place)
    if share < SHARE_OF_BLOCKS + SHARE_OF_COMPOUNDS:
        return random_compound(rng, str(rng.choice(COMPOUND_KINDS)), place)
    return random_building(rng, str(rng.choice(ROOF_TYPES)), place)


def draw_city_block(rng: np.random.Generator, place: np.ndarray) -> SimBuilding:
    """Draw two to four rows of houses around a courtyard; keep those that touch."""
    kappa = rng.uniform(-math.pi, math.pi)
    half = rng.uniform((11.0, 11.0), (16.0, 16.0))
    parts = []
    for side in range(int(rng.integers(2, 5))):
        row = houses_in_a_row(rng, CompoundLayout(0.0))
        turn, out = side * math.pi / 2, half[side % 2]
        c, s = math.cos(kappa + turn), math.sin(kappa + turn)
        for part in row:
            u, v = part.translation[0] - half[1 - side % 2], part.translation[1] - out
            translation = np.array([c * u - s * v, s * u + c * v, part.translation[2]])
            parts.append(make_part(part.type, part.parameters, kappa + turn, translation))
    block = assemble(tuple(parts), "block", place)
    outline = max(shapely.get_parts(block.outline), key=lambda polygon: polygon.area)
    houses = tuple(
        part for part in parts if shapely.intersects(part.pieces[0].outline.buffer(-0.5), outline)
    )
    return block if len(houses) == len(parts) else assemble(houses, "block", place)


def damage_points(
    rng: np.random.Generator, points: np.ndarray, outline: shapely.Geometry, damage: float
) -> np.ndarray:
    """Choose the indices of points that remain after holes, thinning and repetition."""
    keep = np.arange(len(points))
    for _ in range(int(rng.binomial(3, damage))):
        x, y = shapely.get_coordinates(outline)[rng.integers(4)] + rng.normal(0.0, 3.0, 2)
        hole = np.hypot(points[keep, 0] - x, points[keep, 1] - y) < rng.uniform(1.0, 6.0)
        keep = keep[~hole]
    if rng.random() < 0.5 * damage:
        is_beyond = points[keep, 0] > np.median(points[keep, 0]) if len(keep) else np.zeros(0, bool)
        keep = keep[~is_beyond | (rng.random(len(keep)) < rng.uniform(0.0, 0.3))]
    if rng.random() < 0.5 * damage:
        keep = np.concatenate([keep, keep[: len(keep) // 3]])
    return keep


def damage_footprint(
    rng: np.random.Generator, outline: shapely.Polygon, damage: float
) -> shapely.Geometry:
    """Jitter, shift, cut, perforate, densify or offset an outline."""
    if rng.random() < damage:
        corners = shapely.get_coordinates(shapely.get_exterior_ring(outline))[:-1]
        outline = shapely.make_valid(
            shapely.Polygon(corners + rng.normal(0.0, rng.uniform(0.02, 0.6), corners.shape))
        )
    if rng.random() < 0.5 * damage:
        shift = rng.normal(0.0, 1.2, 2)
        outline = shapely.transform(outline, lambda xy: xy + shift)
    x, y = rng.uniform(*np.reshape(outline.bounds, (2, 2)))
    if rng.random() < damage:
        outline -= shapely.box(x, y, x + rng.uniform(1, 20), y + rng.uniform(1, 20))
    if rng.random() < 0.5 * damage:
        outline -= shapely.Point(x, y).buffer(rng.uniform(0.2, 3.0), quad_segs=3)
    if rng.random() < 0.3 * damage:
        outline = shapely.segmentize(outline, rng.uniform(0.1, 1.0))
    if rng.random() < 0.3 * damage:
        outline = outline.buffer(rng.uniform(-0.8, 0.8), join_style="mitre")
    return outline


def classify(source: np.ndarray, has_classes: bool) -> np.ndarray:
    """Return the ASPRS classes (n,) of points by their source, or unclassified ones."""
    if not has_classes:
        return np.full(len(source), UNCLASSIFIED, np.uint8)
    return np.array([CLASS_OF_SOURCE[name] for name in SOURCES], np.uint8)[source]


def write_cloud(path: Path, points: np.ndarray, classes: np.ndarray) -> None:
    """Write points (n, 3) with their classes (n,) as a LAZ file."""
    import laspy
    from pyproj import CRS as ProjCRS

    header = laspy.LasHeader(version="1.4", point_format=6)
    header.add_crs(ProjCRS(CRS))
    header.scales, header.offsets = np.full(3, 0.001), np.floor(ORIGIN)
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    cloud.classification = classes
    cloud.write(path)


def write_footprints(path: Path, buildings: list[Placed]) -> None:
    """Write the footprints with an attribute of each kind as a GeoPackage."""
    count = len(buildings)
    columns = {
        "id": np.array([building.id for building in buildings], object),
        "year": np.arange(1900, 1900 + count),
        "use": np.array([None if k % 7 == 0 else "dwelling" for k in range(count)], object),
        "share": np.linspace(0.0, 1.0, count),
    }
    geometry = shapely.to_wkb([building.footprint for building in buildings])
    path.unlink(missing_ok=True)
    pyogrio.raw.write(
        path,
        geometry,
        list(columns.values()),
        list(columns),
        geometry_type="Unknown",
        crs="EPSG:28992",
        layer="footprints",
    )
