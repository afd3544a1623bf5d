"""Find barrel vaults over parts with slopes to two sides."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely

from ...model import Part
from ...settings import Settings
from .accept import PartsRoof
from .composite import fit_over
from .regions import list_polygons, unite_outlines

# What is made of one.
BARREL_LIKE = ("gable", "asymmetric_gable", "truncated_gable", "gambrel", "half_mansard")
CURVE_ROUNDS = 2  # The second leaves out points beside the vault, such as those of a wall's top.
BEND_NUMBERS = 1  # Points alone say that a roof of two slopes is bent: how much is one number.
ENDS_M = 0.5  # Parts of one vault end within this distance (m) of each other.


def list_barrels(roof: PartsRoof, part: Part, settings: Settings) -> Iterator[tuple[Part, int]]:
    """Yield barrel vaults over a part, alone and with those beside it along its ridge.

    They are tried if a curve across the part costs its points less than its planes.
    """
    if part.type not in BARREL_LIKE:
        return
    along = np.array([math.cos(part.kappa), math.sin(part.kappa)])
    ends = find_ends(part, along)
    beside = [p for p in roof.parts if np.abs(find_ends(p, along) - ends).max() <= ENDS_M]
    x = roof.points[:, :2] @ (-along[1], along[0])
    for group in [[part], beside] if len(beside) > 1 else [[part]]:
        seen = roof.find_seen(group)
        gaps = measure_arc_gaps(x[seen], roof.points[seen, 2])
        covered = list_polygons(unite_outlines(group))
        if len(covered) == 1 and roof.is_worth(seen, roof.price_gaps(gaps).sum(), BEND_NUMBERS):
            yield from (
                (vault, BEND_NUMBERS) for vault in fit_over(roof, covered[0], ["barrel"], settings)
            )


def find_ends(part: Part, along: np.ndarray) -> np.ndarray:
    """Return where a part begins and ends along a unit vector (2,)."""
    places = shapely.get_coordinates([piece.outline for piece in part.pieces]) @ along
    return np.array([places.min(), places.max()])


def measure_arc_gaps(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return how far heights z (n,) lie from an arc over x (n,).

    The arc is the best sum of a line, a parabola and a half ellipse.
    """
    x = (x - 0.5 * (x.min() + x.max())) / max(0.5 * np.ptp(x), 0.01)
    under = 1.0 - np.minimum(x * x, 1.0)
    design = np.column_stack([np.ones_like(x), x, under, np.sqrt(under)])
    is_near = np.ones(len(z), bool)
    for _ in range(CURVE_ROUNDS):
        gaps = np.abs(z - design @ np.linalg.lstsq(design[is_near], z[is_near], rcond=None)[0])
        is_near = gaps <= max(0.25, 2.0 * float(np.median(gaps)))
    return gaps
