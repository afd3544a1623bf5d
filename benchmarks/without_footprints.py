"""Roofs of clouds that come without footprints.

It measures how near their points they lie, of how many parts and which types they are.

usage: python -m benchmarks.without_footprints [--set stbarth ctview delft] [--each]

The cloud of a set (class 6 of all its files) is split into buildings, each is reconstructed from
its points alone. Printed: mean over buildings of the share of points within 0.2 m (all points of
the building, those beside the roof counted as misses), median distance of points to the roof, parts
and roof faces in the mean, the share of the area in plan that has a type other than "free", the
area by type, milliseconds of `reconstruct`, seconds of splitting the cloud (CPU). `--each` adds a
line a building, the largest first.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

import numpy as np

from hiproof import read_points, reconstruct
from hiproof.classify.split import split_buildings
from hiproof.model import ROOF, Building

from .judging import SHARED, measure_named_share, sum_area_by_type

SETS = ("stbarth", "ctview")


def model_found(name: str) -> tuple[list[tuple[Building, float]], float]:
    """Reconstruct every building found in the set's cloud, and time it.

    Returns also the seconds in which they were found.
    """
    cloud = read_points(*sorted((SHARED / "data" / name).glob("*.laz")))
    outcomes, started = [], time.process_time()
    buildings = split_buildings(cloud)
    splitting = time.process_time() - started
    for candidate in buildings:
        started = time.process_time()
        outcomes.append(
            (
                reconstruct(cloud.xyz[candidate.index], id=candidate.id),
                time.process_time() - started,
            )
        )
    return outcomes, splitting


def make_row(building: Building) -> str:
    types = ", ".join(
        f"{count} {name}" for name, count in Counter(p.type for p in building.parts).most_common()
    )
    quality = building.quality
    return (
        f"  {building.id}: share {quality.share_within_20cm:.3f} of {quality.points} points; "
        f"{types}"
    )


def report(name: str, outcomes: list[tuple[Building, float]], splitting: float) -> str:
    buildings = [building for building, _ in outcomes if building.built is not None]
    ms, areas = 1e3 * np.array([seconds for _, seconds in outcomes]), sum_area_by_type(buildings)
    return (
        f"{name}: {len(buildings)} of {len(outcomes)} buildings modelled"
        f"  share {np.nanmean([b.quality.share_within_20cm for b in buildings]):.4f}"
        f"  distance median {np.median([b.quality.psd_mean for b in buildings]):.3f} m"
        f"  parts {np.mean([len(b.parts) for b in buildings]):.2f} "
        f"({sum(len(b.parts) for b in buildings)})"
        f"  faces {np.mean([len(b.solid.select_faces(ROOF)) for b in buildings]):.2f}"
        f"  named {measure_named_share(buildings):.3f}"
        f"  ms median {np.median(ms):.1f} mean {ms.mean():.1f} max {ms.max():.0f}, "
        f"splitting {splitting:.1f} s\n"
        "  " + ", ".join(f"{type} {area / areas.total():.1%}" for type, area in areas.items())
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--set", nargs="+", choices=(*SETS, "delft"), default=SETS)
    parser.add_argument("--each", action="store_true", help="a line a building")
    arguments = parser.parse_args()
    for name in arguments.set:
        outcomes, splitting = model_found(name)
        print(report(name, outcomes, splitting), flush=True)
        if arguments.each:
            largest_first = sorted(
                (b for b, _ in outcomes), key=lambda building: -building.quality.points
            )
            print("\n".join(make_row(building) for building in largest_first))


if __name__ == "__main__":
    main()
