"""Lengths of overhangs, and false ones.

usage: python -m benchmarks.overhangs [--count 100] [--first-seed 100] [--densities 8 2]
                                      [--compounds]

Houses of all types (seeds 100 and above) are scanned by simulation with roofs that reach 0.3 to
1.0 m beyond the walls, by the same on opposite sides, and again with none. Every third stands under
trees. The footprint is that of the walls. An overhang that is missed counts as one of length 0. The
solids with overhangs are checked by `hiproof check` and triangulated by trimesh: they have to be
closed, and to keep their volume.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
import trimesh

import hiproof
from hiproof.compose import check_solid
from hiproof.compose.eaves import widen_roof
from hiproof.fit.overhang import group_by_axis
from hiproof.geometry.outline_edges import list_outline_edges
from hiproof.model import Building, Roof
from hiproof.settings import Settings
from hiproof.simulate import ScanSettings, random_building
from hiproof.simulate.compounds import random_compound
from hiproof.simulate.roofs import SimBuilding
from hiproof.simulate.scanner import scan_scene
from hiproof.simulate.scene import Defects, building_bodies, make_scene, trees
from hiproof.write.meshes.triangles import faces_triangles

from .tables import FigureTable, make_parser

OVERHANGS_DRAWN_M = 0.3, 1.0
AROUND_HOUSE_M = 3.0  # of points beyond the walls
WITH = Settings.from_dict({"segment": {"network": "never"}, "write": {"lods": ["2.2", "2.3"]}})


@dataclass
class OverhangTally:
    """What came of houses: errors of overhangs (m), these by sigma, and counts."""

    errors: list[float] = field(default_factory=list)
    by_sigma: list[float] = field(default_factory=list)
    missed: int = 0
    houses: int = 0
    false: int = 0
    left_out: int = 0
    invalid: int = 0


def draw_house(rng: np.random.Generator, is_compound: bool) -> tuple[SimBuilding, np.ndarray]:
    """Draw a house, and the overhang (n,) of each edge of its outline."""
    house = random_compound(rng) if is_compound else random_building(rng)
    edges = list_outline_edges(house.outline)
    widths = np.zeros(len(edges.starts))
    for axis in group_by_axis(edges):
        widths[axis] = rng.uniform(*OVERHANGS_DRAWN_M)
    return house, widths


def scan_house(
    rng: np.random.Generator, house: SimBuilding, roof: Roof, density: float
) -> np.ndarray:
    """Scan a house with a wider `roof`; return points (n, 3) in the world."""
    convex = [
        replace(part, pieces=tuple(replace(p, outline=p.outline.convex_hull) for p in part.pieces))
        for part in roof.parts
    ]
    wide = replace(house, roof=replace(roof, parts=tuple(convex)))
    crowns = trees(rng, house) if rng.random() < 1 / 3 else None
    scene = make_scene(building_bodies(wide), crowns)
    settings = ScanSettings(density=density, defects=replace(Defects.none(), outliers=0.002))
    area = shapely.buffer(house.outline, AROUND_HOUSE_M)
    cloud = scan_scene(scene, area, house.roof.parts[0].translation[2], rng, settings)
    return cloud.move(house.roof.frame.origin).points


def judge_lengths(
    tally: OverhangTally, building: Building, house: SimBuilding, truth: np.ndarray
) -> None:
    """Add the overhangs of a building to the tally, edge by edge of the true outline."""
    found = {item.edge: item for item in building.model.eaves.overhangs}
    if not truth.any():
        tally.false += bool(found)
        return
    edges = list_outline_edges(building.roof.outline)
    to_house = building.roof.frame.origin - house.roof.frame.origin
    true_edges = list_outline_edges(house.outline)
    middles = 0.5 * (true_edges.starts + true_edges.ends) - to_house[:2]
    lines = shapely.linestrings(np.stack([edges.starts, edges.ends], axis=1))
    for middle, width in zip(middles, truth, strict=True):
        edge = int(shapely.distance(shapely.Point(middle), lines).argmin())
        item = found.get(edge)
        tally.missed += item is None
        tally.errors.append((0.0 if item is None else item.length) - width)
        if item is not None:
            tally.by_sigma.append((item.length - width) / item.sigma)


def is_valid(building: Building) -> bool:
    """Return whether the solid with overhangs is valid, also to trimesh."""
    solid = building.model.finest_solid
    solid = solid.move(-np.floor(solid.vertices.min(axis=0)))
    triangles = np.concatenate(faces_triangles(solid.vertices, solid.faces))
    mesh = trimesh.Trimesh(solid.vertices, triangles, process=False)
    is_closed = mesh.is_watertight and mesh.is_winding_consistent
    keeps_volume = is_closed and np.isclose(mesh.volume, solid.volume, rtol=1e-3)
    return bool(keeps_volume) and not check_solid(solid)


def main() -> None:
    parser = make_parser(__doc__, count=100, first_seed=100, densities=[8.0, 2.0])
    parser.add_argument("--compounds", action="store_true")
    a = parser.parse_args()
    columns = ("points/m2", "edges", "RMSE; bias, m", "missed", "error/sigma, RMS", "false")
    with FigureTable(a.record, *columns, "left out; invalid", "s") as table:
        for density in a.densities:
            tally, start = OverhangTally(), time.perf_counter()
            for k in range(a.count):
                rng = np.random.default_rng(a.first_seed + k)
                house, widths = draw_house(rng, a.compounds)
                for truth in (widths, np.zeros(len(widths))):
                    roof = widen_roof(house.roof, truth) if truth.any() else house.roof
                    points = scan_house(rng, house, roof, density)
                    building = hiproof.reconstruct(points, house.footprint, None, WITH)
                    if building.built is None or building.model.eaves is None:
                        continue
                    tally.houses += 1
                    tally.left_out += "overhangs were left out" in building.detail
                    tally.invalid += not is_valid(building)
                    judge_lengths(tally, building, house, truth)
            errors = np.array(tally.errors)
            table.add(
                density,
                len(errors),
                f"{np.sqrt((errors**2).mean()):.3f}; {errors.mean():+.3f}",
                f"{tally.missed / len(errors):.3f}",
                f"{np.sqrt(np.mean(np.square(tally.by_sigma))):.2f}",
                f"{tally.false / a.count:.3f}",
                f"{tally.left_out}; {tally.invalid}",
                f"{time.perf_counter() - start:.0f}",
            )


if __name__ == "__main__":
    main()
