"""The earlier model with parts moved up or down, where only these changed.

It takes the place of a search where the earlier points, moved with their parts, pass the test of an
update against the new ones. So nothing but heights changes.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from ..errors import HiproofError
from ..model import Building, Roof
from ..parametric.building import build
from ..parametric.refit import measure_building, select_inside
from ..status import Change, Status
from .cells import MEDIAN_VARIANCE, CellComparison
from .epochs import Surveys
from .judge import FEWEST_COMPARED, ChangeVerdict, judge_building
from .lineage import lift_part, measure_lift, show_parts, unite_lifts

OF_SURVEYS = ("survey_date", "epochs_used", "change")  # keys that say which points made a model


def move_building(
    earlier: Building,
    record: dict[str, Any],
    verdict: ChangeVerdict,
    points: tuple[np.ndarray | None, np.ndarray],
    surveys: Surveys,
    near_m: float,
) -> Building | None:
    """Return the earlier building with parts moved as the new points show them.

    `record` is its object of parameters.jsonl, and `points` (n, 3) are the old and new ones in the
    roof's frame. None where something else changed, too, or where nothing moved by more than
    `near_m`.
    """
    roof, comparison = earlier.roof, verdict.comparison
    if comparison is None or earlier.status is not Status.MODELLED or record.get("installations"):
        return None
    lifts = measure_lifts(roof, comparison, near_m)
    if lifts is None or not any(lifts):
        return None
    sigmas = measure_sigmas(roof, comparison, surveys.shift.sigma[2])
    parts = [
        lift_part(part, lift, sigma)
        for part, lift, sigma in zip(record["parts"], lifts, sigmas, strict=True)
    ]
    kept = {name: value for name, value in record.items() if name not in OF_SURVEYS}
    try:
        result = build(kept | {"parts": parts}, earlier.model.compose)
    except HiproofError:
        return None
    old = None if points[0] is None else lift_points(roof, points[0], np.array(lifts))
    again = judge_building(
        result.roof,
        old,
        points[1],
        earlier.local_ground,
        surveys.shift.noise,
        surveys.shift.sigma[2],
        surveys.largest_chance,
    )
    return result if again.change is Change.UNCHANGED else None


def measure_lifts(roof: Roof, comparison: CellComparison, near_m: float) -> list[float] | None:
    """Return how much higher (m) each part lies, 0 for one that did not move.

    None where a part has too few cells. Parts that moved together move by the same height.
    """
    result = {}
    for number, d in enumerate(split_by_part(roof, comparison, comparison.difference)):
        if len(d) < FEWEST_COMPARED:
            return None
        result[number] = measure_lift(d, near_m)
    return list(unite_lifts(result, near_m).values())


def measure_sigmas(roof: Roof, comparison: CellComparison, sigma_m: float) -> list[float]:
    """Return the standard deviation (m) of how much higher each part lies.

    `sigma_m` is that of the common vertical shift.
    """
    variances = split_by_part(roof, comparison, comparison.sigma**2)
    means = [MEDIAN_VARIANCE * float(own.mean()) / len(own) for own in variances]
    return [float(np.hypot(np.sqrt(mean), sigma_m)) for mean in means]


def split_by_part(roof: Roof, comparison: CellComparison, values: np.ndarray) -> list[np.ndarray]:
    """Return the `values` (n,) of the compared cells, part by part."""
    shown = show_parts(roof, comparison.centres)[comparison.is_compared]
    compared = values[comparison.is_compared]
    return [compared[shown == number] for number in range(len(roof.parts))]


def lift_points(roof: Roof, points: np.ndarray, lifts: np.ndarray) -> np.ndarray:
    """Return points (n, 3) moved by the lift (p,) of the part at each."""
    shown = show_parts(roof, points[:, :2])
    rise = np.where(shown >= 0, lifts[shown], 0.0)
    return points + np.column_stack([np.zeros((len(points), 2)), rise])


def measure_moved(moved: Building, points: np.ndarray) -> Building:
    """Return a moved building measured on the new roof `points` (n, 3) in the world."""
    local = select_inside(moved.roof, points)
    measured = measure_building(moved, local)
    density = len(local) / moved.roof.outline.area
    quality = dataclasses.replace(measured.quality, points=len(local), density=density)
    return dataclasses.replace(moved, quality=quality, grade=measured.grade)
