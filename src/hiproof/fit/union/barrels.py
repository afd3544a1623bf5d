"""Find barrel vaults over parts with slopes to two sides."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely

from ...model import Part
from ...settings import Settings
from .judged import COMPARED_M, JudgedRoof
from .own import MOST_DISTANCE_M, cut_part, fit_types
from .regions import list_polygons, unite_outlines
from .round_tops import AS_NEAR, BENT

BARREL_LIKE = ("gable", "asymmetric_gable", "truncated_gable", "gambrel")  # What is made of one.
CURVE_ROUNDS = 2  # The second leaves out points beside the vault, such as those of a wall's top.
ENDS_M = 0.5  # Parts of one vault end within this distance (m) of each other.


def list_barrels(
    roof: JudgedRoof, part: Part, own: np.ndarray, settings: Settings
) -> Iterator[Part]:
    """Yield barrel vaults over a part, alone and with those beside it along its ridge.

    They are tried if a curve across the part is nearer to its points than its planes.
    """
    if part.type not in BARREL_LIKE:
        return
    beside = [other for other in roof.parts if is_as_long(part, other)]
    for group in ([part], beside) if len(beside) > 1 else ([part],):
        covered = list_polygons(unite_outlines(group))
        numbers = [k for k, p in enumerate(roof.parts) if any(p is member for member in group)]
        which = own | np.isin(roof.highest[1], numbers)
        way = -math.sin(part.kappa), math.cos(part.kappa)
        most_left = BENT if len(group) == 1 else AS_NEAR
        if len(covered) == 1 and is_bent(roof.points[:, :2] @ way, roof, which, most_left):
            inside = shapely.contains_xy(covered[0], *roof.points[:, :2].T)
            shape = fit_types(roof.points[inside], covered[0], ("barrel",), settings)
            if shape is not None:
                yield cut_part(shape, covered[0])


def is_as_long(part: Part, other: Part) -> bool:
    """Return whether another part begins and ends where a part does along its ridge."""
    way = np.array([math.cos(part.kappa), math.sin(part.kappa)])
    ends = []
    for one in (part, other):
        along = np.concatenate([shapely.get_coordinates(p.outline) @ way for p in one.pieces])
        ends.append((along.min(), along.max()))
    return bool(np.abs(np.diff(ends, axis=0)).max() <= ENDS_M)


def is_bent(x: np.ndarray, roof: JudgedRoof, which: np.ndarray, most_left: float) -> bool:
    """Return whether an arc over x (n,) leaves little of the misfit of the roof.

    `which` (n,) are the points that count, and `most_left` the largest share that may be left.
    """
    x, z = x[which], roof.points[which, 2]
    middle, wide = 0.5 * (x.min() + x.max()), max(0.5 * float(np.ptp(x)), COMPARED_M)
    x = (x - middle) / wide
    under = 1.0 - np.minimum(x * x, 1.0)
    design = np.column_stack([np.ones_like(x), x, under, np.sqrt(under)])
    used = np.ones(len(z), bool)
    for _ in range(CURVE_ROUNDS):
        distances = np.abs(z - design @ np.linalg.lstsq(design[used], z[used], rcond=None)[0])
        used = distances <= max(MOST_DISTANCE_M, 2.0 * float(np.median(distances)))
    left = np.minimum(distances, MOST_DISTANCE_M).mean()
    return bool(left <= most_left * roof.measure_distances(MOST_DISTANCE_M)[which].mean())
