"""Chimneys that are found, and false objects on roofs.

usage: python -m benchmarks.installations [--count 100] [--densities 8 2]

Single houses of all types (seeds 100 and above) with one chimney of 0.6 to 1.8 by 0.6 to 1.2 m are
scanned by simulation. A chimney counts by the points that it returned: of fewer than four at least
half a metre above the roof it cannot be found. Houses without a chimney, some under trees, should
have no object.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import shapely

import hiproof
from hiproof.settings import Settings
from hiproof.simulate import ScanSettings, random_building
from hiproof.simulate.roofs import SimBuilding
from hiproof.simulate.scanner import Scan, scan_scene
from hiproof.simulate.scene import (
    SOURCE_CLUTTER,
    SOURCE_GROUND,
    Body,
    Defects,
    building_bodies,
    make_scene,
    place_on_roof,
    trees,
)
from hiproof.simulate.shapes import box

from .tables import FigureTable, make_parser

FOUND_CHIMNEY_M = 1.0  # between the middles of a chimney and of the object found
SEEN_POINTS, SEEN_RISE_M = 4, 0.5
WITH = Settings.from_dict({"reconstruct": {"installations": True}})


def draw_chimney(rng: np.random.Generator, building: SimBuilding) -> Body:
    """Draw a chimney parallel to the house."""
    xy, piece = place_on_roof(rng, building)
    z_top = piece.height_at(xy[None])[0] + rng.uniform(0.8, 1.8)
    size = rng.uniform(0.6, 1.8), rng.uniform(0.6, 1.2)
    return Body(box(xy, size, z_top, building.kappa), SOURCE_CLUTTER, SOURCE_CLUTTER)


def scan_house(
    rng: np.random.Generator, building: SimBuilding, chimneys: list[Body], density: float
) -> Scan:
    """Scan a house, under a tree in every third case."""
    crowns = trees(rng, building) if rng.random() < 1 / 3 else None
    scene = make_scene([*building_bodies(building), *chimneys], crowns)
    defects = replace(Defects.none(), outliers=0.002)
    settings = ScanSettings(density=density, defects=defects)
    area = shapely.buffer(building.outline, 1.0)
    cloud = scan_scene(scene, area, building.roof.parts[0].translation[2], rng, settings)
    return cloud.select(cloud.source != SOURCE_GROUND).move(building.roof.frame.origin)


def is_seen(building: SimBuilding, cloud: Scan) -> bool:
    """Return whether enough points lie on the chimney."""
    points = building.roof.frame.to_local(cloud.points[cloud.source == SOURCE_CLUTTER])
    rise = points[:, 2] - building.roof.height_at(points[:, :2])
    return int((rise >= SEEN_RISE_M).sum()) >= SEEN_POINTS


def judge_house(seed: int, density: float) -> tuple[Counter[str], list[float]]:
    """Return what became of a house with a chimney and of the same without it.

    With it come the distances of middles and tops in metres.
    """
    counts: Counter[str] = Counter()
    errors: list[float] = []
    rng = np.random.default_rng(seed)
    building = random_building(rng)
    chimney = draw_chimney(rng, building)
    origin = building.roof.frame.origin
    outline = shapely.transform(building.outline, lambda xy: xy + origin[:2])
    for chimneys in ([chimney], []):
        cloud = scan_house(rng, building, chimneys, density)
        model = hiproof.reconstruct(cloud.points, outline, None, WITH).built
        boxes = () if model is None else model.installations
        shift = np.zeros(3) if model is None else model.roof.frame.origin - origin
        counts["houses"] += 1
        middle = shapely.get_coordinates(chimney.piece.outline.centroid)[0]
        gaps = [float(np.hypot(*(b.position + shift)[:2] - middle)) for b in boxes]
        hits = [gap for gap in gaps if gap < FOUND_CHIMNEY_M] if chimneys else []
        counts["false"] += len(gaps) - len(hits)
        if chimneys and is_seen(building, cloud):
            counts["chimneys"] += 1
            counts["found"] += bool(hits)
            errors += hits[:1]
    return counts, errors


def main() -> None:
    parser = make_parser(__doc__, count=100, first_seed=100, densities=[8.0, 2.0])
    a = parser.parse_args()
    columns = ("points/m2", "chimneys", "found, %", "off, median, m", "false objects a house")
    with FigureTable(a.record, *columns) as table:
        for density in a.densities:
            results = [judge_house(a.first_seed + k, density) for k in range(a.count)]
            counts = sum((result[0] for result in results), Counter())
            errors = [gap for _, gaps in results for gap in gaps]
            share = 100 * counts["found"] / max(counts["chimneys"], 1)
            off = f"{np.median(errors) if errors else np.nan:.2f}"
            false = f"{counts['false'] / counts['houses']:.3f}"
            table.add(density, counts["chimneys"], f"{share:.0f}", off, false)


if __name__ == "__main__":
    main()
