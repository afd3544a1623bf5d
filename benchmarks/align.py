"""Footprints that lie beside their roofs: is the shift found?

And does a footprint that lies right stay?

usage: python -m benchmarks.align [--each 14] [--density 5] [--first-seed 0]

Simulated houses of five kinds (outlines.py) are scanned without defects of the scene, walls
included; their true outline is put 0.5, 1 and 2 m off in a direction drawn by chance. Printed by
distance: the share whose shift is found within 0.1 m, its 95th percentile, the share that a run
would move, and for no distance at all the share that would be moved wrongly.
"""

from __future__ import annotations

import argparse
import math

import numpy as np
import shapely
import shapely.affinity

from hiproof.fit.align import find_shift

from .outlines import KINDS, simulate_house

DISTANCES_M = (0.0, 0.5, 1.0, 2.0)
WITHIN_M = 0.1


def find_shifts(density: float, seeds: range) -> dict[float, list[tuple[float, bool]]]:
    """Return by distance (m) how well shifts are found.

    That is how far the shift found is from the true one (m), and whether it is clear enough to move
    the footprint.
    """
    outcomes: dict[float, list[tuple[float, bool]]] = {distance: [] for distance in DISTANCES_M}
    for kind in KINDS:
        for seed in seeds:
            points, truth = simulate_house(kind, density, seed)
            azimuth = np.random.default_rng([seed, KINDS.index(kind), 7]).uniform(-math.pi, math.pi)
            for distance, rows in outcomes.items():
                offset = distance * np.array([math.cos(azimuth), math.sin(azimuth)])
                shift = find_shift(points[:, :2], shapely.affinity.translate(truth, *offset))
                rows.append((float(np.hypot(*(shift.xy + offset))), shift.is_clear))
    return outcomes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=14, help="houses a kind")
    parser.add_argument("--density", type=float, default=5.0, help="points a square metre")
    parser.add_argument("--first-seed", type=int, default=0)
    a = parser.parse_args()
    for distance, rows in find_shifts(
        a.density, range(a.first_seed, a.first_seed + a.each)
    ).items():
        error, moved = np.array(rows).T
        print(
            f"{a.density:g}/m2, {distance:g} m off: {len(rows)} houses, "
            f"{np.mean(error < WITHIN_M):.1%} within {WITHIN_M:g} m, "
            f"95th percentile {np.quantile(error, 0.95):.3f} m, {np.mean(moved):.1%} moved"
        )


if __name__ == "__main__":
    main()
