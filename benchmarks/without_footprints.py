"""Roofs of real clouds that come without footprints.

usage: python -m benchmarks.without_footprints [--set stbarth ctview delft]

The cloud of a set (class 6 of all its files) is split into buildings, and each is reconstructed
from its points alone. The share within 0.2 m is the mean over buildings of that of all points of
the building, those beside the roof counted as misses.
"""

from __future__ import annotations

import time

import numpy as np

from hiproof import read_points, reconstruct
from hiproof.classify.split import split_buildings
from hiproof.model import ROOF, Building

from .judging import SHARED, describe_parts
from .tables import FigureTable, make_parser

SETS = ("stbarth", "ctview")


def model_found(name: str) -> tuple[list[tuple[Building, float]], float]:
    """Reconstruct every building found in a cloud; return all seconds, too."""
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


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--set", nargs="+", choices=(*SETS, "delft"), default=SETS)
    a = parser.parse_args()
    columns = ("set", "modelled", "within 0.2 m", "distance, median, m", "parts", "faces")
    with FigureTable(a.record, *columns, "ms: median; mean; most", "splitting, s") as table:
        for name in a.set:
            outcomes, splitting = model_found(name)
            buildings = [building for building, _ in outcomes if building.built is not None]
            ms = 1e3 * np.array([seconds for _, seconds in outcomes])
            table.add(
                name,
                f"{len(buildings)} of {len(outcomes)}",
                f"{np.nanmean([b.quality.share_within_20cm for b in buildings]):.4f}",
                f"{np.median([b.quality.psd_mean for b in buildings]):.3f}",
                f"{np.mean([len(b.parts) for b in buildings]):.2f}",
                f"{np.mean([len(b.solid.select_faces(ROOF)) for b in buildings]):.2f}",
                f"{np.median(ms):.1f}; {ms.mean():.1f}; {ms.max():.0f}",
                f"{splitting:.1f}",
            )
            print(describe_parts(buildings))


if __name__ == "__main__":
    main()
