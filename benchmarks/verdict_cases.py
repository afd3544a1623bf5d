"""Roofs with known truth, scanned by simulation, with usual faults.

The faults are those of clouds and footprints.

A case is a simulated compound or a building of a real town, its points at one density, and the
footprint given, None for a run without footprints. A quarter of the cases is faultless, a quarter
has the scanner's own defects, and the others have one of DEFECTS each. Everything is drawn by the
building's id and the density, so a case is always the same.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import shapely

from hiproof.compose import compose
from hiproof.model import Solid
from hiproof.simulate import (
    COMPOUND_KINDS,
    SOURCES,
    ScanSettings,
    random_compound,
    scan,
    scan_solids,
)
from hiproof.simulate.scanner import Scan
from hiproof.simulate.scene import Defects

from .towns import TOWNS, TrueBuilding, read_town

PLACES = {name: TOWNS[name] for name in ("essen", "nrw_5657", "denhaag", "rotterdam", "vienna")}
MOST_SEEN = 1500  # points that tell where a roof is seen
SCANNER = replace(Defects.none(), missing_strip=0.2, partial=0.15, swath_edge=0.2, outliers=0.004)
CLUTTERED = replace(SCANNER, chimney=0.5, antenna=0.2, tree=0.3)


@dataclass(frozen=True)
class Case:
    """A building to model.

    `solids` are its truth, within `truth_area` where the footprint asks for a part of it alone.
    `seen_area` is what of that has points; with a footprint it is all of it.
    """

    source: str
    id: str
    density: float
    defect: str
    solids: tuple[Solid, ...]
    truth_area: shapely.Geometry
    seen_area: shapely.Geometry
    footprint: shapely.Polygon | None
    points: np.ndarray

    @property
    def area_m2(self) -> float:
        return float(self.truth_area.area)


@dataclass(frozen=True)
class Scene:
    """Points (n, 3) and footprint, changed by a defect, and the true area asked for."""

    points: np.ndarray
    footprint: shapely.Polygon
    asked: shapely.Geometry
    z_ground: float


Defect = Callable[[Scene, np.random.Generator], Scene]
Scanner = Callable[[np.random.Generator, ScanSettings], Scan]


def draw_direction(rng: np.random.Generator) -> np.ndarray:
    """Draw a level unit vector (2,)."""
    angle = rng.uniform(-np.pi, np.pi)
    return np.array([np.cos(angle), np.sin(angle)])


def cut_hole(scene: Scene, rng: np.random.Generator) -> Scene:
    """Drop the points on one side of a line: 15 to 60 % of them."""
    along = scene.points[:, :2] @ draw_direction(rng)
    return replace(scene, points=scene.points[along < np.quantile(along, rng.uniform(0.4, 0.85))])


def cover_with_leaves(scene: Scene, rng: np.random.Generator) -> Scene:
    """Put a crown over a tenth to a half of the roof. Seven points in ten lie in its leaves."""
    middle = shapely.get_coordinates(scene.footprint)[rng.integers(4)]
    distance = np.hypot(*(scene.points[:, :2] - middle).T)
    caught = (distance < np.quantile(distance, rng.uniform(0.1, 0.5))) & (
        rng.random(len(distance)) < 0.7
    )
    points = scene.points.copy()
    points[caught, 2] += rng.uniform(0.3, 6.0, int(caught.sum()))
    return replace(scene, points=points)


def draw_facade_points(scene: Scene, rng: np.random.Generator, count: int) -> np.ndarray:
    """Draw points (count, 3) on the two sides that face the scanner."""
    seen_from = draw_direction(rng)
    corners = shapely.get_coordinates(shapely.orient_polygons(scene.footprint).exterior)
    edges = np.diff(corners, axis=0)
    outwards = np.column_stack([edges[:, 1], -edges[:, 0]])
    weight = np.maximum(outwards @ seen_from, 0.0)
    side = rng.choice(len(edges), count, p=weight / weight.sum())
    xy = corners[side] + rng.random((count, 1)) * edges[side]
    inwards = -outwards[side] / np.hypot(*outwards[side].T)[:, None]
    xy += inwards * np.abs(rng.normal(0.0, 0.06, (count, 1)))
    top = max(np.quantile(scene.points[:, 2], 0.1), scene.z_ground + 1.0)
    return np.column_stack([xy, rng.uniform(scene.z_ground + 0.5, top, count)])


def add_facades(scene: Scene, rng: np.random.Generator) -> Scene:
    """Add a fifth to twice as many points on walls as on the roof."""
    count = int(len(scene.points) * rng.uniform(0.2, 2.0)) + 1
    facades = draw_facade_points(scene, rng, count)
    return replace(scene, points=np.concatenate([scene.points, facades]))


def keep_walls(scene: Scene, rng: np.random.Generator) -> Scene:
    """Keep points on two walls and none on the roof."""
    return replace(scene, points=draw_facade_points(scene, rng, len(scene.points)))


def shift_footprint(scene: Scene, rng: np.random.Generator) -> Scene:
    """Shift the footprint 0.4 to 1.5 m beside its building."""
    shift = draw_direction(rng) * rng.uniform(0.4, 1.5)
    return replace(scene, footprint=shapely.transform(scene.footprint, lambda xy: xy + shift))


def widen_footprint(scene: Scene, rng: np.random.Generator) -> Scene:
    """Widen the footprint by a yard beside its building."""
    west, south, east, north = scene.footprint.bounds
    shift = draw_direction(rng) * rng.uniform(0.1, 0.5) * np.array([east - west, north - south])
    moved = shapely.transform(scene.footprint, lambda xy: xy + shift)
    wider = shapely.union(scene.footprint, moved)
    return replace(scene, footprint=max(shapely.get_parts(wider), key=shapely.area))


def halve_footprint(scene: Scene, rng: np.random.Generator) -> Scene:
    """Halve the footprint, as cadastres cut them. The other half is not requested."""
    west, south, east, north = scene.footprint.bounds
    middle = rng.uniform(0.3, 0.7) * (east - west) + west
    half = shapely.intersection(scene.footprint, shapely.box(west, south, middle, north))
    polygons = [part for part in shapely.get_parts(half) if part.geom_type == "Polygon"]
    half = max(polygons, key=shapely.area)
    return replace(scene, footprint=half, asked=half)


def add_noise(scene: Scene, rng: np.random.Generator) -> Scene:
    """Add a further noise of 0.05 to 0.3 m to heights."""
    noise = rng.normal(0.0, rng.uniform(0.05, 0.3), len(scene.points))
    return replace(scene, points=scene.points + np.outer(noise, (0.0, 0.0, 1.0)))


OF_POINTS: dict[str, Defect] = {
    "hole": cut_hole,
    "leaves": cover_with_leaves,
    "facades": add_facades,
    "walls alone": keep_walls,
    "noise": add_noise,
}
OF_FOOTPRINTS: dict[str, Defect] = {
    "shifted": shift_footprint,
    "too wide": widen_footprint,
    "part alone": halve_footprint,
}
DEFECTS = OF_POINTS | OF_FOOTPRINTS
SOUND = ("none", "scanner")


def make_generator(*words: object) -> np.random.Generator:
    """Make a generator drawn by `words`."""
    return np.random.default_rng(zlib.crc32(" ".join(map(str, words)).encode()))


def simulate_compound(seed: int) -> tuple[TrueBuilding, Scanner]:
    """Simulate a compound as a true building, and what scans it."""
    rng = np.random.default_rng([seed, 7])
    building = random_compound(rng, COMPOUND_KINDS[seed // 2 % len(COMPOUND_KINDS)])
    solid = compose(building.roof, 0.0).move(building.roof.frame.origin)
    return TrueBuilding(f"compound-{seed}", {"a": solid}, building.footprint), partial(
        scan, building
    )


def iterate_buildings(source: str, limit: int) -> Iterator[tuple[int, TrueBuilding, Scanner]]:
    """Yield number, truth and scanner of at most so many buildings."""
    if source == "compounds":
        yield from ((seed, *simulate_compound(seed)) for seed in range(limit))
        return
    town = read_town(Path(PLACES[source]))
    step = max(1, len(town) // limit)
    for number, building in enumerate(town[::step][:limit]):
        yield number, building, partial(scan_solids, list(building.solids.values()))


def find_seen_area(scene: Scene, density: float) -> shapely.Geometry:
    """Return the true area as far as it has points, with gaps closed."""
    spacing, points = density**-0.5, scene.points[:: max(1, len(scene.points) // MOST_SEEN)]
    spacing = max(spacing, (scene.asked.area / max(len(points), 1)) ** 0.5)
    wide = shapely.multipoints(points[:, :2]).buffer(1.5 * spacing, quad_segs=3)
    area = shapely.intersection(scene.asked, wide.buffer(-spacing, quad_segs=3))
    return scene.asked if area.is_empty else area


def iterate_cases(
    source: str, limit: int, density: float, with_footprints: bool, parity: str
) -> Iterator[Case]:
    """Yield cases of even or odd buildings at one density, a quarter of them without defect."""
    other_defects = list(DEFECTS if with_footprints else OF_POINTS)
    for number, building, scanned in iterate_buildings(source, limit):
        if number % 2 != ("even", "odd").index(parity):
            continue
        rng = make_generator(building.id, density, with_footprints)
        kind = number // 2 % 4
        defect = SOUND[kind] if kind < 2 else other_defects[int(rng.integers(len(other_defects)))]
        faults = CLUTTERED if source == "compounds" else SCANNER
        defects = Defects.none() if defect == "none" else faults
        cloud = scanned(rng, ScanSettings(density=density, defects=defects))
        points = cloud.points[cloud.source != SOURCES.index("ground")]
        z_ground = min(float(solid.vertices[:, 2].min()) for solid in building.solids.values())
        scene = Scene(points, building.footprint, building.footprint, z_ground)
        if len(points) >= 10 and defect in DEFECTS:
            scene = DEFECTS[defect](scene, rng)
        yield Case(
            source,
            building.id,
            density,
            defect,
            tuple(building.solids.values()),
            scene.asked,
            scene.asked if with_footprints else find_seen_area(scene, density),
            scene.footprint if with_footprints else None,
            scene.points,
        )
