"""Clouds without classes: ground and buildings found by shape.

They are compared with the files' own classes, and a cloud is modelled.

usage: python -m benchmarks.classes [--set delft amsterdam_west ctview stbarth] [--pictures FOLDER]
[--quick]

For each set (each of its files that lies alone is taken alone, Delft's two together): precision,
recall and F1 by points of what is found to be buildings against class 6, and the mean absolute
difference in height, over the metre cells that hold building points, between the ground found and
that of the points of class 2. Delft is told in two halves: thresholds were chosen on the western
one. Then, unless --quick, Delft and Amsterdam West with footprints and all classes made 1 are
reconstructed by the command line's default options, from all points, a quarter and an eighth, and
measured by roof_residuals.py. `--pictures` draws hits, misses and false alarms.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from itertools import product
from pathlib import Path

import laspy
import numpy as np

from hiproof.city.run import Request, reconstruct_area
from hiproof.classify import BUILDING, GROUND_CLASS, classify
from hiproof.classify.cells import SquareCells
from hiproof.classify.ground import GroundGrid, fill_gaps, ground_grid
from hiproof.model import PointCloud
from hiproof.read import read_points

from .judging import SHARED, load_tool

SETS = ("delft", "amsterdam_west", "ctview", "stbarth")
APART = ("amsterdam_west",)
HALVES_X = 84930.0  # of Delft: thresholds were chosen west of it
NOISE = 7
WITH_FOOTPRINTS, SHARES = (
    {"delft": "footprints.gpkg", "amsterdam_west": "footprints_bag.gpkg"},
    (1.0, 0.25, 0.125),
)


def read_clouds(name: str) -> list[PointCloud]:
    """Return the set's clouds, without noise."""
    files = sorted((SHARED / "data" / name).glob("*.laz"))
    clouds = [read_points(file) for file in files] if name in APART else [read_points(*files)]
    return [select_points(cloud, cloud.classification != NOISE) for cloud in clouds]


def select_points(cloud: PointCloud, keep: np.ndarray) -> PointCloud:
    return PointCloud(
        cloud.xyz[keep], cloud.classification[keep], cloud.crs, cloud.sources, cloud.units
    )


def describe_agreement(is_found: np.ndarray, truth: np.ndarray) -> str:
    """Describe precision, recall and F1 of points (n,).

    `is_found` is compared with the `truth`.
    """
    hits = (is_found & truth).sum()
    precision, recall = hits / max(is_found.sum(), 1), hits / max(truth.sum(), 1)
    return (
        f"F1 {2 * hits / (is_found.sum() + truth.sum()):.4f} precision {precision:.4f} recall "
        f"{recall:.4f}"
    )


def compare_ground(cloud: PointCloud) -> np.ndarray:
    """Return height differences (k,) of the ground found to class 2.

    They are at the metre cells that hold points of class 6.
    """
    cells, is_ground = SquareCells(cloud.xyz, 1.0), cloud.classification == GROUND_CLASS
    count = cells.count(is_ground)
    total = np.bincount(cells.index[is_ground], cloud.xyz[is_ground, 2], count.size).reshape(
        count.shape
    )
    mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    true = GroundGrid(np.array(cells.first, float), fill_gaps(mean), 1.0)
    inside = (
        np.argwhere(cells.count(cloud.classification == BUILDING) > 0) + np.array(cells.first) + 0.5
    )
    return ground_grid(cloud.xyz).height_at(inside) - true.height_at(inside)


def report(name: str, pictures: Path | None) -> None:
    clouds, findings, seconds = read_clouds(name), [], time.process_time()
    findings = [classify(cloud.xyz) == BUILDING for cloud in clouds]
    seconds = time.process_time() - seconds
    truth = [cloud.classification == BUILDING for cloud in clouds]
    ground = np.concatenate([compare_ground(cloud) for cloud in clouds])
    print(
        f"{name}: {describe_agreement(np.concatenate(findings), np.concatenate(truth))}; "
        f"{seconds:.1f} s of {sum(map(len, clouds)):,} points"
    )
    if name == "delft":
        west = clouds[0].xyz[:, 0] < HALVES_X
        for half, half_mask in (("west (chosen on)", west), ("east", ~west)):
            print(f"  {half}: {describe_agreement(findings[0][half_mask], truth[0][half_mask])}")
    print(
        f"  terrain under buildings: mean |dz| {np.abs(ground).mean():.3f} m, mean "
        f"{ground.mean():+.3f} m",
        flush=True,
    )
    for number, (cloud, guess, true) in enumerate(zip(clouds, findings, truth, strict=True)):
        if pictures:
            draw(pictures / f"{name}_{number}.png", cloud, guess, true)


def draw(path: Path, cloud: PointCloud, is_found: np.ndarray, truth: np.ndarray) -> None:
    """Draw half-metre cells: green right, red false alarms, blue misses.

    Grey shows heights.
    """
    from matplotlib import image

    cells = SquareCells(cloud.xyz, 0.5)
    height = cells.highest(
        cloud.xyz[:, 2] - ground_grid(cloud.xyz).height_at(cloud.xyz), np.ones(len(cloud), bool)
    )
    shade = 0.25 + 0.5 * np.clip(np.nan_to_num(height, neginf=0.0) / 12, 0, 1)
    picture = np.repeat(shade[..., None], 3, axis=2)
    axes, only, missed = (
        cells.count(mask) for mask in (is_found & truth, is_found & ~truth, truth & ~is_found)
    )
    picture[axes > 0] *= (0.7, 1.1, 0.7)
    picture[only > axes] = (1.0, 0.2, 0.2)
    picture[(missed > axes) & (missed > only)] = (0.2, 0.4, 1.0)
    path.parent.mkdir(parents=True, exist_ok=True)
    image.imsave(path, np.kron(np.clip(picture, 0, 1).transpose(1, 0, 2)[::-1], np.ones((3, 3, 1))))


def model_without_classes(name: str, share: float) -> str:
    """Reconstruct a town whose points are all of class 1.

    It has footprints and a `share` of its points, and default options.
    """
    data = SHARED / "data" / name
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        clouds = [
            write_unclassified(file, Path(folder), share) for file in sorted(data.glob("*.laz"))
        ]
        footprints, out = data / WITH_FOOTPRINTS[name], Path(folder) / "out"
        summary = reconstruct_area(Request(tuple(map(str, clouds)), out, str(footprints)))
        figures = load_tool("roof_residuals").measure(
            out / "buildings.city.jsonl", footprints, sorted(data.glob("*.laz"))
        )
    return (
        f"{name}, {share:g} of the points, classes all 1, footprints: share "
        f"{figures['share_within_20cm']:.4f}; {summary.by_status}"
    )


def write_unclassified(file: Path, folder: Path, share: float) -> Path:
    """Copy a `share` of a LAZ file's points into `folder`, all of class 1."""
    las = laspy.read(file)
    las.points = las.points[np.random.default_rng(0).random(len(las.points)) < share]
    las.classification[:] = 1
    las.write(folder / file.name)
    return folder / file.name


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--set", nargs="+", choices=SETS, default=SETS)
    parser.add_argument("--pictures", type=Path, help="folder to draw into")
    parser.add_argument("--quick", action="store_true", help="no models")
    arguments = parser.parse_args()
    for name in arguments.set:
        report(name, arguments.pictures)
    if not arguments.quick:
        for name, share in product(WITH_FOOTPRINTS, SHARES):
            print(model_without_classes(name, share), flush=True)


if __name__ == "__main__":
    main()
