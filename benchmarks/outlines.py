"""Outlines of buildings without footprints: how much of the true plan they cover, and whether the corners are as many.

usage: python -m benchmarks.outlines [--each 20] [--densities 2 5 10] [--first-seed 0] [--real delft amsterdam_west]

Simulated plain houses and L, T, U and cross-shaped ones (simulate/compounds.py) are scanned without defects of the scene, walls
included; printed are the mean intersection over union of outline and truth and the share with the true number of corners.
Of real sets the cloud of class 6 is split into buildings (read/split.py); their outlines are compared with the union of the
footprints that touch, of those that hold points: per union the outlines of all buildings whose points mostly lie in it, together.
"""

from __future__ import annotations

import argparse

import numpy as np
import shapely

from hiproof import read_points
from hiproof.errors import FitError
from hiproof.fit.outline import iou
from hiproof.fit.union.outline import outline_of_points
from hiproof.frames import LocalFrame
from hiproof.read import read_footprints
from hiproof.read.split import split_buildings
from hiproof.simulate import Defects, ScanSettings, random_building, random_compound, scan

from .delft import SETS
from .judging import SHARED

KINDS = ("plain", "L", "T", "U", "cross")
TOUCH_M, STRAIGHT_M = 0.15, 0.05
LEAST_POINTS_A_M2 = 0.5


def simulated(kind: str, density: float, seed: int) -> tuple[np.ndarray, shapely.Polygon]:
    """Points (n, 3) of a house without the ground's, and its true outline, in its frame; always the same for a seed."""
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    house = random_building(rng) if kind == "plain" else random_compound(rng, kind)
    cloud = scan(house, rng, ScanSettings(density=density, defects=Defects.none()))
    return house.roof.frame.to_local(cloud.points[cloud.source != 2]), shapely.Polygon(house.outline.exterior)


def corner_count(outline: shapely.Polygon) -> int:
    return len(shapely.simplify(outline, STRAIGHT_M).exterior.coords) - 1


def row(name: str, outcomes: list[tuple[float, bool]]) -> str:
    overlap, right = np.mean(outcomes, axis=0)
    return f"{name:12s} IoU {overlap:.4f}  right number of corners {right:6.1%}"


def report_simulated(density: float, seeds: range) -> None:
    every = []
    for kind in KINDS:
        outcomes = []
        for points, truth in (simulated(kind, density, seed) for seed in seeds):
            outline = outline_of_points(points)
            outcomes.append((iou(outline, truth), corner_count(outline) == corner_count(truth)))
        print(row(f"{density:g}/m2 {kind}", outcomes), flush=True)
        every += outcomes
    print(row(f"{density:g}/m2 all", every), flush=True)


def outlined(points: np.ndarray) -> shapely.Polygon:
    """The outline of points (n, 3), in their own coordinates; empty where they span no area."""
    frame = LocalFrame.around(points)
    try:
        return shapely.transform(outline_of_points(frame.to_local(points)), frame.to_world)
    except FitError:
        return shapely.Polygon()


def report_real(name: str) -> None:
    """IoU, over unions of touching footprints, with the outlines of the buildings found there."""
    folder = SHARED / "data" / name
    cloud = read_points(*sorted(folder.glob("*.laz")))
    footprints = shapely.union_all([f.polygon.buffer(TOUCH_M) for f in read_footprints(folder / SETS[name])])
    unions = shapely.get_parts(footprints.buffer(-TOUCH_M))
    found = split_buildings(cloud)
    outlines = [outlined(cloud.xyz[building.index]) for building in found]
    xy = [cloud.xyz[building.index, :2] for building in found]
    overlaps = []
    for union in unions:
        mine = [k for k in range(len(found)) if shapely.contains_xy(union, *xy[k].T).mean() > 0.5]
        points = sum(int(shapely.contains_xy(union, *xy[k].T).sum()) for k in mine)
        if points >= LEAST_POINTS_A_M2 * union.area:
            overlaps.append((iou_of(shapely.union_all([outlines[k] for k in mine]), union), union.area))
    overlap, area = np.array(overlaps).T
    print(
        f"{name}: {len(overlaps)} unions of touching footprints  IoU mean {overlap.mean():.4f}  median {np.median(overlap):.4f}"
        f"  by area {np.average(overlap, weights=area):.4f}",
        flush=True,
    )


def iou_of(one: shapely.Geometry, other: shapely.Geometry) -> float:
    common = shapely.intersection(one, other).area
    return common / (one.area + other.area - common)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=20, help="houses a kind and density")
    parser.add_argument("--densities", type=float, nargs="*", default=[2.0, 5.0, 10.0], help="points a square metre")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--real", nargs="*", choices=list(SETS), default=list(SETS))
    a = parser.parse_args()
    for density in a.densities:
        report_simulated(density, range(a.first_seed, a.first_seed + a.each))
    for name in a.real:
        report_real(name)


if __name__ == "__main__":
    main()
