"""Find barrel vaults over parts with slopes to two sides."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely

from ...geometry.arrays import compute_median
from ...geometry.point_in_polygon import find_inside
from ...model import Part
from ...settings import Settings
from .custom import MOST_DISTANCE_M, cut_part, fit_types
from .judged import COMPARED_M, JudgedRoof
from .regions import list_polygons, unite_outlines
from .round_tops import AS_NEAR, BENT

BARREL_LIKE = ("gable", "asymmetric_gable", "truncated_gable", "gambrel")  # What is made of one.
CURVE_ROUNDS = 2  # The second leaves out points beside the vault, such as those of a wall's top.
ENDS_M = 0.5  # Parts of one vault end within this distance (m) of each other.


def list_barrels(roof: JudgedRoof, part: Part, settings: Settings) -> Iterator[Part]:
    """Yield barrel vaults over a part, alone and with those beside it along its ridge.

    They are tried if a curve across the part is nearer to its points than its planes.
    """
    if part.type not in BARREL_LIKE:
        return
    x = roof.points[:, :2] @ np.array([-math.sin(part.kappa), math.cos(part.kappa)])
    for group in list_groups(roof.parts, part):
        is_member = [any(p is member for member in group) for p in roof.parts]
        which = np.array(is_member)[roof.highest[1]]
        old_misfit = roof.measure_distances(MOST_DISTANCE_M)[which].mean()
        most_left = BENT if len(group) == 1 else AS_NEAR
        if measure_arc_misfit(x[which], roof.points[which, 2]) > most_left * old_misfit:
            continue
        covered = list_polygons(unite_outlines(group))
        if len(covered) == 1:
            inside = find_inside(covered[0], *roof.points[:, :2].T)
            shape = fit_types(roof.points[inside], covered[0], ("barrel",), settings)
            if shape is not None:
                yield cut_part(shape, covered[0])


def list_groups(parts: list[Part], part: Part) -> list[list[Part]]:
    """List a part alone, and with all that begin and end with it along its ridge."""
    if len(parts) == 1:
        return [parts]
    along = np.array([math.cos(part.kappa), math.sin(part.kappa)])
    ends = find_ends(part, along)
    beside = [p for p in parts if np.abs(find_ends(p, along) - ends).max() <= ENDS_M]
    return [[part], beside] if len(beside) > 1 else [[part]]


def find_ends(part: Part, along: np.ndarray) -> np.ndarray:
    """Return where a part begins and ends along a unit vector (2,)."""
    places = shapely.get_coordinates([piece.outline for piece in part.pieces]) @ along
    return np.array([places.min(), places.max()])


def measure_arc_misfit(x: np.ndarray, z: np.ndarray) -> float:
    """Return how far heights z (n,) lie from an arc over x (n,), in the mean (m).

    Each counts up to MOST_DISTANCE_M. The arc is the best sum of a line, a parabola and a half
    ellipse.
    """
    middle, wide = 0.5 * (x.min() + x.max()), max(0.5 * (x.max() - x.min()), COMPARED_M)
    x = (x - middle) / wide
    under = 1.0 - np.minimum(x * x, 1.0)
    design = np.column_stack([np.ones_like(x), x, under, np.sqrt(under)])
    is_near = np.ones(len(z), bool)
    for _ in range(CURVE_ROUNDS):
        distances = np.abs(z - design @ np.linalg.lstsq(design[is_near], z[is_near], rcond=None)[0])
        is_near = distances <= max(MOST_DISTANCE_M, 2.0 * compute_median(distances))
    return float(np.minimum(distances, MOST_DISTANCE_M).mean())
