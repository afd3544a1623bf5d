"""Houses that touch, separated without footprints.

It counts how many of the walls between them are found, and how many that are none.

usage: python -m benchmarks.houses [--each 20] [--density 5] [--first-seed 0] [--real delft
amsterdam_west stbarth]

Simulated rows (simulate/compounds.py) are scanned without defects of the scene, walls included. A
wall between two houses shows where the roofs on either side differ by a quarter of a metre or more
over most of it; it is found where most points within two metres of it lie in an area of their own
side's. Of houses of one family (plain, L, T, U, cross, hips, dormers, extensions) it is printed how
many were cut. Of real sets: of pairs of footprints of 30 m2 or more that share two metres of
border, how many were told apart, and how many footprints were cut, a tenth of their points or more
lying apart from the rest.
"""

from __future__ import annotations

import argparse
from itertools import combinations, pairwise

import numpy as np
import shapely

from hiproof import read_points
from hiproof.classify.houses import separate_houses
from hiproof.classify.split import split_buildings
from hiproof.read import read_footprints
from hiproof.simulate import (
    Defects,
    ScanSettings,
    SimBuilding,
    random_building,
    random_compound,
    scan,
)

from .delft import SETS
from .judging import SHARED

FAMILIES = ("plain", "L", "T", "U", "cross", "winged_hip", "L_of_hips", "dormered", "extension")
SHOWS_M, NEAR_M, GAP_M = 0.25, 2.0, 1.0
LEAST_M2, LEAST_SHARED_M, APART, CUT = 30.0, 2.0, 0.8, 0.1


def scan_house(house: SimBuilding, rng: np.random.Generator, density: float) -> np.ndarray:
    """Return points (n, 3) of a building in its own frame, without ground."""
    cloud = scan(house, rng, ScanSettings(density=density, defects=Defects.none()))
    return house.roof.frame.to_local(cloud.points[cloud.source != 2])


def find_areas(points: np.ndarray) -> list[shapely.Geometry]:
    """Return the areas of the houses separated among points (n, 3)."""
    box = shapely.box(*points[:, :2].min(axis=0) - 0.5, *points[:, :2].max(axis=0) + 0.5)
    surroundings = shapely.MultiPoint(points[:, :2]).buffer(GAP_M).buffer(0.5 - GAP_M)
    return separate_houses(points, shapely.intersection(surroundings, box), GAP_M)


def differs_from_neighbour(
    first: shapely.Polygon, other: shapely.Polygon, row: SimBuilding
) -> bool:
    """Return whether the roofs of two neighbours in a `row` differ.

    They do so along most of the wall between them.
    """
    parts = [
        next(p for p in row.roof.parts if p.pieces[0].outline.equals(o)) for o in (first, other)
    ]
    wall = shapely.intersection(shapely.buffer(first, 0.01), shapely.buffer(other, 0.01))
    xy = shapely.get_coordinates(
        shapely.line_interpolate_point(wall.exterior, np.linspace(0, 1, 60), normalized=True)
    )
    return bool(
        np.median(np.abs(np.subtract(*(part.pieces[0].height_at(xy) for part in parts)))) > SHOWS_M
    )


def is_apart(
    first: shapely.Polygon,
    other: shapely.Polygon,
    areas: list[shapely.Geometry],
    points: np.ndarray,
) -> bool:
    """Return whether most points lie in areas of their own side.

    They are points beside the border of two outlines.
    """
    border = shapely.intersection(shapely.buffer(first, 0.3), shapely.buffer(other, 0.3))
    xy = points[shapely.dwithin(border, shapely.points(points[:, :2]), NEAR_M), :2]
    sides = [xy[shapely.contains_xy(outline, *xy.T)] for outline in (first, other)]
    if not all(map(len, sides)):
        return False
    shares = np.array(
        [[shapely.intersects_xy(area, *side.T).mean() for area in areas] for side in sides]
    )
    best = shares.argmax(axis=1)
    return bool(best[0] != best[1] and shares.max(axis=1).min() > APART)


def report_simulation(density: float, seeds: range) -> None:
    counts = {True: [0, 0], False: [0, 0]}
    for seed in seeds:
        rng = np.random.default_rng([seed, 1000])
        row = random_compound(rng, "row")
        points = scan_house(row, rng, density)
        areas, outlines = find_areas(points), [part.pieces[0].outline for part in row.roof.parts]
        for first, other in pairwise(outlines):
            count = counts[differs_from_neighbour(first, other, row)]
            count[0] += is_apart(first, other, areas, points)
            count[1] += 1
    print(
        f"{density:g}/m2 rows: {counts[True][0]} of {counts[True][1]} walls that show found, "
        f"{counts[False][0]} of {counts[False][1]} that do not",
        flush=True,
    )
    cut = {}
    for kind in FAMILIES:
        rngs = [np.random.default_rng([seed, 1001]) for seed in seeds]
        houses = [
            random_building(rng) if kind == "plain" else random_compound(rng, kind) for rng in rngs
        ]
        cut[kind] = sum(
            len(find_areas(scan_house(h, rng, density))) > 1
            for h, rng in zip(houses, rngs, strict=True)
        )
    total = len(seeds) * len(FAMILIES)
    print(f"{density:g}/m2 single houses cut: {sum(cut.values())} of {total}  {cut}", flush=True)


def report_real(name: str) -> None:
    folder = SHARED / "data" / name
    files = sorted(folder.glob("*.laz"))
    clouds = (
        [read_points(file) for file in files] if name == "amsterdam_west" else [read_points(*files)]
    )
    results = []
    for cloud in clouds:
        results += [(b.area, cloud.xyz[b.index]) for b in split_buildings(cloud)]
    print(f"{name}: {len(results)} buildings", flush=True)
    if name not in SETS:
        return
    areas, points = [area for area, _ in results], np.concatenate([xyz for _, xyz in results])
    outlines = [
        f.polygon for f in read_footprints(folder / SETS[name]) if f.polygon.area >= LEAST_M2
    ]
    inside = [points[shapely.contains_xy(o, *points[:, :2].T), :2] for o in outlines]
    outlines, inside = zip(
        *[(o, xy) for o, xy in zip(outlines, inside, strict=True) if len(xy) > 2 * o.area],
        strict=True,
    )
    cut = sum(max(shapely.intersects_xy(a, *xy.T).mean() for a in areas) < 1 - CUT for xy in inside)
    pairs = [
        (first, other)
        for first, other in combinations(outlines, 2)
        if first.distance(other) < 0.1
        and shapely.intersection(first.buffer(0.15), other.buffer(0.15)).area > 0.3 * LEAST_SHARED_M
    ]
    n_apart = sum(is_apart(first, other, areas, points) for first, other in pairs)
    print(
        f"  {n_apart} of {len(pairs)} pairs of touching footprints told apart; {cut} of "
        f"{len(outlines)} footprints cut",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=20, help="rows, and houses of each family")
    parser.add_argument("--density", type=float, default=5.0, help="points a square metre")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument(
        "--real",
        nargs="*",
        choices=("delft", "amsterdam_west", "stbarth"),
        default=("delft", "amsterdam_west", "stbarth"),
    )
    a = parser.parse_args()
    report_simulation(a.density, range(a.first_seed, a.first_seed + a.each))
    for name in a.real:
        report_real(name)


if __name__ == "__main__":
    main()
