"""Outlines of buildings without footprints.

It measures how much of the true plan they cover, and whether the corners are as many.

usage: python -m benchmarks.outlines [--each 20] [--densities 2 5 10] [--first-seed 0] [--real delft
amsterdam_west]

Simulated plain houses and L, T, U and cross-shaped ones (simulate/compounds.py) are scanned without
defects of the scene, walls included; printed are the mean intersection over union of outline and
truth and the share with the true number of corners. Of real sets the cloud of class 6 is split into
buildings (classify/split.py); their outlines are compared with the unions of footprints that touch,
or that one building found reaches into, of those that hold points: per union the outlines of all
buildings whose points mostly lie in it, together. Both are cut off at the box of the file's points:
what a footprint says of ground that was not scanned is not asked. Beside it stands what the points'
own cells of half a metre have, for points lie where there is no footprint too.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from hiproof import read_points
from hiproof.classify.split import cell_area, split_buildings
from hiproof.errors import FitError
from hiproof.evaluate.metrics import iou
from hiproof.fit.union.outline import draw_outline
from hiproof.frames import LocalFrame
from hiproof.read import read_footprints
from hiproof.simulate import Defects, ScanSettings, random_building, random_compound, scan

from .delft import SETS
from .judging import SHARED

KINDS = ("plain", "L", "T", "U", "cross")
TOUCH_M, STRAIGHT_M = 0.15, 0.05
LEAST_POINTS_A_M2, REACHES_IN = 0.5, 0.1  # points; share of a building's points
CELL_M = 0.5
APART = ("amsterdam_west",)  # sets whose files lie apart


def simulate_house(kind: str, density: float, seed: int) -> tuple[np.ndarray, shapely.Polygon]:
    """Simulate a house's points (n, 3), without ground, and its outline.

    Both are in its frame, always the same for a seed.
    """
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    house = random_building(rng) if kind == "plain" else random_compound(rng, kind)
    cloud = scan(house, rng, ScanSettings(density=density, defects=Defects.none()))
    return house.roof.frame.to_local(cloud.points[cloud.source != 2]), shapely.Polygon(
        house.outline.exterior
    )


def count_corners(outline: shapely.Polygon) -> int:
    return len(shapely.simplify(outline, STRAIGHT_M).exterior.coords) - 1


def make_row(name: str, outcomes: list[tuple[float, bool]]) -> str:
    overlap, right = np.mean(outcomes, axis=0)
    return f"{name:12s} IoU {overlap:.4f}  right number of corners {right:6.1%}"


def report_simulation(density: float, seeds: range) -> None:
    total = []
    for kind in KINDS:
        outcomes = []
        for points, truth in (simulate_house(kind, density, seed) for seed in seeds):
            outline = draw_outline(points)
            outcomes.append((iou(outline, truth), count_corners(outline) == count_corners(truth)))
        print(make_row(f"{density:g}/m2 {kind}", outcomes), flush=True)
        total += outcomes
    print(make_row(f"{density:g}/m2 all", total), flush=True)


def outline_points(points: np.ndarray) -> shapely.Polygon:
    """Return the outline of points (n, 3), in their own coordinates.

    It is empty where they span no area.
    """
    frame = LocalFrame.around(points)
    try:
        return shapely.transform(draw_outline(frame.to_local(points)), frame.to_world)
    except FitError:
        return shapely.Polygon()


def report_real(name: str) -> None:
    """Report the IoU of outlines found in a real set.

    It is over unions of touching footprints, with the buildings found there.
    """
    folder = SHARED / "data" / name
    footprints = [f.polygon for f in read_footprints(folder / SETS[name])]
    files = sorted(folder.glob("*.laz"))
    overlaps = [
        row
        for part in ([[f] for f in files] if name in APART else [files])
        for row in measure_overlaps(part, footprints)
    ]
    overlap, of_cells, area, outside = np.array(overlaps).T
    print(
        f"{name}: {len(overlaps)} unions of footprints  IoU mean {overlap.mean():.4f}  median "
        f"{np.median(overlap):.4f}"
        f"  by area {np.average(overlap, weights=area):.4f} (cells "
        f"{np.average(of_cells, weights=area):.4f})"
        f"  points outside {np.average(outside, weights=area):.1%}",
        flush=True,
    )


def measure_overlaps(
    files: list[Path], footprints: list[shapely.Polygon]
) -> list[tuple[float, float, float, float]]:
    """Return IoUs, area (m2) and share outside of each union of footprints.

    IoUs are of the outlines and of the points' cells; the share is that of the points outside. The
    files' points cover each union.
    """
    cloud = read_points(*files)
    box = shapely.box(*cloud.xyz[:, :2].min(axis=0), *cloud.xyz[:, :2].max(axis=0))
    joined = shapely.union_all([polygon.buffer(TOUCH_M) for polygon in footprints]).buffer(-TOUCH_M)
    buildings = split_buildings(cloud)
    outlines = np.array(
        [
            shapely.intersection(outline_points(cloud.xyz[building.index]), box)
            for building in buildings
        ]
    )
    cells = np.array([cell_area(cloud.xyz[building.index, :2], CELL_M) for building in buildings])
    touching = shapely.get_parts(shapely.intersection(joined, box))
    shapely.prepare(touching)
    points = [shapely.points(cloud.xyz[building.index, :2]) for building in buildings]
    inside = np.array(
        [
            [int(shapely.contains(union, point_set).sum()) for point_set in points]
            for union in touching
        ]
    )
    count, overlaps = np.array([len(point_set) for point_set in points]), []
    _, label = connected_components(
        csr_array((inside > REACHES_IN * count).astype(int) @ (inside > REACHES_IN * count).T)
    )
    for k in np.unique(label):
        union, n_held = shapely.union_all(touching[label == k]), inside[label == k].sum(axis=0)
        is_matching = n_held > 0.5 * count
        if n_held[is_matching].sum() >= LEAST_POINTS_A_M2 * union.area:
            ious = [
                iou(shapely.union_all(shapes[is_matching]), union) for shapes in (outlines, cells)
            ]
            overlaps.append(
                (*ious, union.area, 1.0 - n_held[is_matching].sum() / count[is_matching].sum())
            )
    return overlaps


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=20, help="houses a kind and density")
    parser.add_argument(
        "--densities", type=float, nargs="*", default=[2.0, 5.0, 10.0], help="points a square metre"
    )
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--real", nargs="*", choices=list(SETS), default=list(SETS))
    a = parser.parse_args()
    for density in a.densities:
        report_simulation(density, range(a.first_seed, a.first_seed + a.each))
    for name in a.real:
        report_real(name)


if __name__ == "__main__":
    main()
