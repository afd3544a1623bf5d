"""Parameters of unchanged buildings, estimated by the points of both surveys.

Parts, types and rectangles stay. More points make only that share of a variance smaller which
follows from their scatter: the rest, such as that of a rectangle which is not fitted, stays. A
refined building is kept where its standard deviations are smaller than before.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from ..errors import HiproofError
from ..model import Building
from ..parametric.edit import rebuild
from ..parametric.refit import Z, measure_building, refit_parts, select_inside
from ..write.parameters import building_record
from .cells import SAME_SIGMAS
from .register import LEAST_M

REFINED = "refined with the points of"
"""Words in the detail of a building that was refined, before the date of the survey."""


def refine_building(
    building: Building, old: np.ndarray, new: np.ndarray, date: str
) -> Building | None:
    """Return the building fitted to the roof points of both surveys.

    `old` and `new` are points (n, 3) in world metres. None where that makes it no
    surer, or contradicts the earlier estimate.
    """
    record, roof = building_record(building), building.roof
    first, second = (select_inside(roof, points) for points in (old, new))
    both, fixed = np.concatenate([first, second]), list_fixed(record["parts"])
    try:
        alone, fitted = (refit_parts(roof, record["parts"], xyz, fixed) for xyz in (first, both))
        parts = [
            {**part, "sigma": combine_sigmas(before["sigma"], one["sigma"], part["sigma"])}
            for before, one, part in zip(record["parts"], alone, fitted, strict=True)
        ]
        if compare_sigmas(record["parts"], parts) >= 0.0 or has_moved(record["parts"], parts):
            return None
        fit = measure_building(rebuild(building, {**record, "parts": parts}), both)
    except HiproofError:
        return None
    detail = f"{building.detail.partition(f', {REFINED}')[0]}, {REFINED} {date}"
    return dataclasses.replace(fit, status=building.status, detail=detail)


def list_fixed(parts: list[dict[str, Any]]) -> dict[int, tuple[str, ...]]:
    """Return the parameters of each part that its points did not estimate."""
    return {
        number: (
            *(name for name in part["parameters"] if name not in part["sigma"]),
            *(() if "t_z" in part["sigma"] else (Z,)),
        )
        for number, part in enumerate(parts)
    }


def combine_sigmas(
    before: dict[str, float], alone: dict[str, float], both: dict[str, float]
) -> dict[str, float]:
    """Return the standard deviations of a part that both surveys are fitted to.

    `before` are those of the run, `alone` those by the scatter of the earlier points about the same
    part, and `both` those by the points of both surveys.
    """
    result = dict(before)
    for name, sigma in both.items():
        rest = max(before.get(name, 0.0) ** 2 - alone.get(name, math.inf) ** 2, 0.0)
        result[name] = math.sqrt(sigma**2 + rest)
    return result


def has_moved(before: list[dict[str, Any]], after: list[dict[str, Any]]) -> bool:
    """Return whether a fitted value lies beyond chance from what it was.

    Values whose standard deviation is unknown may move as far as those of points may lie apart.
    """
    for first, second in zip(before, after, strict=True):
        for name, value in (*first["parameters"].items(), ("t_z", first["position"][2])):
            fitted = second["position"][2] if name == "t_z" else second["parameters"][name]
            if abs(fitted - value) > SAME_SIGMAS * max(first["sigma"].get(name, 0.0), LEAST_M):
                return True
    return False


def compare_sigmas(before: list[dict[str, Any]], after: list[dict[str, Any]]) -> float:
    """Return how much larger the standard deviations are, as a mean of logarithms.

    Those count that a part has `before` and `after`; 0 is for none.
    """
    logs = [
        math.log(second["sigma"][name] / first["sigma"][name])
        for first, second in zip(before, after, strict=True)
        for name in first["sigma"].keys() & second["sigma"].keys()
        if first["sigma"][name] > 0.0 and second["sigma"][name] > 0.0
    ]
    return float(np.mean(logs)) if logs else 0.0
