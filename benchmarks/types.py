"""Roof type by evidence alone, all types simulated with 5 % outliers. python -m benchmarks.types [--quick]"""

from __future__ import annotations

import argparse
from collections import Counter

import numpy as np

from hiproof.fit.single import fit_roof
from hiproof.primitives import CATALOGUE

from .roofs import random_roof, scan

DENSITIES = (2.0, 5.0, 10.0)


def main() -> None:
    """Print the share of right types at each density, and what the wrong ones were taken for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="10 roofs a type instead of 100")
    roofs = 10 if parser.parse_args().quick else 100
    for density in DENSITIES:
        taken = Counter(types_of(density, roofs))
        right = sum(count for (truth, found), count in taken.items() if truth == found)
        print(f"{density:4.0f} points/m2: {100 * right / taken.total():.1f} % of {taken.total()}")
        for (truth, found), count in taken.most_common():
            if truth != found:
                print(f"       {truth} taken for {found}: {count}")


def types_of(density: float, roofs: int):
    """(true type, chosen type) of `roofs` roofs a type."""
    rng = np.random.default_rng(21)
    for name in CATALOGUE:
        for _ in range(roofs):
            yield name, fit_roof(scan(random_roof(name, rng), density, rng, outlier_share=0.05)).type


if __name__ == "__main__":
    main()
