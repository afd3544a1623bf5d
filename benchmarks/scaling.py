"""Cost of a roof by its area, up to a hall of 100,000 m2.

usage: python -m benchmarks.scaling [--areas 100 1000 10000] [--density 5]

A roof of `area` m2 is made of squares of 10 m: a gable, a level roof with a box on it, a monopitch
and a hip, in turn, at heights that differ from square to square. Points lie at random, with a
normal error of 2 cm. Prints, for each area, CPU milliseconds for 100 m2 of fitting and of
composing, the share of points within 0.2 m of the roof, parts, and the most memory that the
process held so far.
"""

from __future__ import annotations

import math
import resource
import time

import numpy as np
import shapely

from hiproof.compose import compose
from hiproof.errors import HiproofError
from hiproof.fit.roof import fit_building
from hiproof.frames import LocalFrame
from hiproof.model import Roof

from .tables import FigureTable, make_parser

SQUARE_M = 10.0
NOISE_M = 0.02
NEAR_M = 0.2


COLUMNS = (
    "area, m2",
    "ms per 100 m2: fit; compose",
    f"within {NEAR_M} m",
    "parts",
    "memory, MB",
    "solid",
)


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


def measure(area_m2: float, density: float) -> list[str]:
    """Fit and compose one roof; return the cells of COLUMNS."""
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
    return [
        f"{outline.area:.0f}",
        f"{per_100_m2 * (fitted - started):.1f}; {per_100_m2 * (end - fitted):.1f}",
        f"{1.0 - fit.unexplained:.4f}",
        f"{len(fit.roof_parts)}",
        f"{memory:.0f}",
        outcome,
    ]


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--areas", type=float, nargs="+", default=[100.0, 1000.0, 10000.0])
    parser.add_argument("--density", type=float, default=5.0, help="points a square metre")
    a = parser.parse_args()
    measure(a.areas[0], a.density)  # loads what is compiled
    with FigureTable(a.record, *COLUMNS) as table:
        for area_m2 in a.areas:
            table.add(*measure(area_m2, a.density))


if __name__ == "__main__":
    main()
