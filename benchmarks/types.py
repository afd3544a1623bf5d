"""Roof types by evidence alone, all types simulated with equal frequency.

There are 5 % outliers. Run it by `python -m benchmarks.types [--quick] [--seed 21]`.

Half of the gables have their ridge off the middle. The draws (roofs.py) keep types apart that are
one surface at a bound: an asymmetric gable has one slope at least a seventh steeper, a half-hip
ends of 0.3 to 0.6 of the rise and a one-ended one of 0.45 to 0.7, a level top at least 0.4 of the
width, a gambrel's break is seen.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator

import numpy as np

from hiproof.fit.single import fit_roof
from hiproof.primitives import CATALOGUE

from .roofs import TrueRoof, draw_catslide, draw_roof, scan

DENSITIES = (2.0, 5.0, 10.0)


def main() -> None:
    """Print the share of right types at each density.

    It says too what the wrong ones were taken for.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="10 roofs a type instead of 100")
    parser.add_argument("--seed", type=int, default=21, help="of the roofs drawn")
    options = parser.parse_args()
    for density in DENSITIES:
        counts = Counter(choose_types(density, 10 if options.quick else 100, options.seed))
        right = sum(count for (truth, name), count in counts.items() if truth == name)
        print(
            f"{density:4.0f} points/m2: {100 * right / counts.total():.1f} % of {counts.total()}",
            flush=True,
        )
        for (truth, name), count in counts.most_common():
            if truth != name:
                print(f"       {truth} taken for {name}: {count}")


def choose_types(density: float, roofs: int, seed: int) -> Iterator[tuple[str, str]]:
    """Yield (true type, chosen type) of `roofs` roofs a type."""
    for roof, points in draw_clouds(density, roofs, seed):
        yield roof.primitive.name, fit_roof(points).type


def draw_clouds(density: float, roofs: int, seed: int) -> Iterator[tuple[TrueRoof, np.ndarray]]:
    """Yield `roofs` true roofs a type with their points (n, 3)."""
    rng = np.random.default_rng(seed)
    for name in CATALOGUE:
        for number in range(roofs):
            roof = draw_catslide(rng) if name == "gable" and number % 2 else draw_roof(name, rng)
            yield roof, scan(roof, density, rng, outlier_share=0.05)


if __name__ == "__main__":
    main()
