"""Measure how the cost of a roof grows with its area, up to a hall of 100,000 m2.

usage: python -m benchmarks.scaling [--areas 100 1000 10000] [--density 5]

A roof of `area` m2 is made of squares of 10 m: a gable, a level roof with a box on it, a monopitch
and a hip, in turn, at heights that differ from square to square. Points lie at random, with a
normal error of 2 cm. Prints, for each area, CPU milliseconds for 100 m2 of fitting and of
composing, the share of points within 0.2 m of the roof, parts, and the most memory that the
process held so far.
"""

from __future__ import annotations

import argparse
import math
import resource
import time

import numpy as np
import shapely

from hiproof.compose import compose
from hiproof.errors import HiproofError
from hiproof.fit.union import fit_building
from hiproof.frames import LocalFrame
from hiproof.model import Roof

SQUARE_M = 10.0
NOISE_M = 0.02
NEAR_M = 0.2


def make_outline(area_m2: float) -> shapely.Polygon:
    """Return a rectangle of whole squares of about `area_m2`, twice as long as wide.

    >>> make_outline(800.0).area
    800.0
    """
    wide = max(1, round(math.sqrt(area_m2 / 2.0) / SQUARE_M))
    long = max(1, round(area_m2 / SQUARE_M**2 / wide))
    return shapely.box(0.0, 0.0, long * SQUARE_M, wide * SQUARE_M)


def compute_heights(xy: np.ndarray) -> np.ndarray:
    """Return the heights (n,) of the roof at places `xy` (n, 2)."""
    i, j = (xy // SQUARE_M).astype(int).T
    x, y = (xy % SQUARE_M).T - 0.5 * SQUARE_M
    shapes = [
        4.0 - 0.8 * np.abs(x),
        1.0 + 3.0 * ((np.abs(x) < 2.0) & (np.abs(y) < 1.5)),
        2.0 + 0.3 * y,
        4.0 - 0.8 * np.maximum(np.abs(x), np.abs(y)),
    ]
    eaves = 6.0 + 1.5 * ((3 * i + 5 * j) % 4)
    return eaves + np.choose((i + 2 * j) % 4, shapes)


def sample_points(outline: shapely.Polygon, density: float) -> np.ndarray:
    """Return points (n, 3) of the roof over `outline`, `density` a square metre."""
    rng = np.random.default_rng(0)
    lower, upper = np.reshape(outline.bounds, (2, 2))
    xy = rng.uniform(lower, upper, (int(density * outline.area), 2))
    return np.column_stack([xy, compute_heights(xy) + rng.normal(0.0, NOISE_M, len(xy))])


def measure(area_m2: float, density: float) -> str:
    """Fit and compose one roof; return a row of its figures."""
    outline = make_outline(area_m2)
    points = sample_points(outline, density)
    started = time.process_time()
    fit = fit_building(points, outline)
    fitted = time.process_time()
    try:
        compose(Roof(fit.roof_parts, fit.outline, LocalFrame(np.zeros(3))), 0.0)
        outcome = "valid"
    except HiproofError as error:
        outcome = str(error)
    end = time.process_time()
    per_100_m2 = 1e5 / outline.area  # ms for a second
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    figures = (
        f"{outline.area:8.0f} m2",
        f"{len(points):8d} points",
        f"fit {per_100_m2 * (fitted - started):6.1f}",
        f"compose {per_100_m2 * (end - fitted):5.1f} ms per 100 m2",
        f"within {NEAR_M} m {1.0 - fit.unexplained:.4f}",
        f"parts {len(fit.roof_parts):5d}",
        f"{memory:5.0f} MB",
        outcome,
    )
    return "  ".join(figures)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--areas", type=float, nargs="+", default=[100.0, 1000.0, 10000.0])
    parser.add_argument("--density", type=float, default=5.0, help="points a square metre")
    arguments = parser.parse_args()
    measure(arguments.areas[0], arguments.density)  # loads what is compiled
    for area_m2 in arguments.areas:
        print(measure(area_m2, arguments.density), flush=True)


if __name__ == "__main__":
    main()
