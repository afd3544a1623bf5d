"""How much a building needs attention: a number, and the reasons.

They follow from what the run wrote of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import shapely

from ..log import count_things
from ..status import Change, Grade, Status
from ..status import Doubt as Remark
from ..write.attribute_list import ANGLES

UNSURE_GRADES = {Grade.FAIR.code: 0.5, Grade.POOR.code: 1.0}  # and how much each adds
CLOSE_CALL = 0.2  # by which the most probable type leads
LARGE_M2, LARGE_SHARE = 2.0, 0.05  # of area that the model does not explain
LOOSE_M = 0.3  # standard deviation of a part that few points support
UNSURE = (Status.SIMPLIFIED, Status.FLAT_FALLBACK, Status.NOT_BUILT, Status.NO_BUILDING)
# for what the run itself leaves in doubt: less than a poor outcome, more than a few stray points
REMARKED = 0.3
UNCERTAIN_CHANGE = 10.0  # more than all other scores together: a person has to decide


@dataclass(frozen=True)
class BuildingDoubt:
    """The doubt about a model: its `amount`, 0 for none, and `reasons` in short phrases."""

    amount: float
    reasons: tuple[str, ...]


def measure_doubt(record: Mapping[str, Any]) -> BuildingDoubt:
    """Return the doubt about a building, from its object in parameters.jsonl.

    >>> measure_doubt({"status": "modelled", "quality": "poor", "parts": [],
    ...     "residuals": {"share_within_20cm": 0.6}})
    BuildingDoubt(amount=1.4, reasons=('poor',))
    """
    detail, grade = record.get("detail") or "", record.get("quality")
    share = (record.get("residuals") or {}).get("share_within_20cm")
    status = {status.code: status.value for status in UNSURE}.get(record.get("status", ""))
    remarks = ", ".join(remark.told for remark in Remark if remark.value in detail)
    scores: list[tuple[float, str]] = []
    if (record.get("change") or {}).get("class") == Change.UNCERTAIN.code:
        scores.append((UNCERTAIN_CHANGE, "uncertain change"))
    if share is not None:  # buildings that fit well are sorted by it, too
        scores.append((1.0 - share, ""))
    if grade in UNSURE_GRADES:  # the detail says why
        scores.append((UNSURE_GRADES[grade], grade))
    if status is not None:
        scores.append((0.5, status.removeprefix("no model: ").split(":")[0].split(",")[0]))
    if remarks:
        scores.append((REMARKED, remarks))
    scores += filter(None, [score_unexplained(record), loose_parts(record), close_call(record)])
    return BuildingDoubt(
        round(sum(amount for amount, _ in scores), 4),
        tuple(reason for _, reason in scores if reason),
    )


def score_unexplained(record: Mapping[str, Any]) -> tuple[float, str] | None:
    """Score the area whose points lie more than half a metre off the roof."""
    area, rings = record.get("unexplained_area_m2"), record.get("outline")
    if not area or not rings:
        return None
    share = min(area / max(shapely.Polygon(rings[0]).area, 1.0), 1.0)
    is_large = area >= LARGE_M2 and share >= LARGE_SHARE
    return share, f"{area:.0f} m² of points off the roof" if is_large else ""


def loose_parts(record: Mapping[str, Any]) -> tuple[float, str] | None:
    """Score parts whose heights or lengths their points leave open."""
    parts = record.get("parts") or []
    loose = sum(is_loose(part.get("sigma") or {}) for part in parts)
    if not loose:
        return None
    return 0.3 * loose / len(parts), f"{loose} of {count_things(len(parts), 'part')} on few points"


def is_loose(sigma: Mapping[str, float]) -> bool:
    return any(
        value > LOOSE_M
        for name, value in sigma.items()
        if name != "rotation" and not name.startswith(ANGLES)
    )


def close_call(record: Mapping[str, Any]) -> tuple[float, str] | None:
    """Score two types that the fits or the network take for about as probable."""
    types = record.get("types") or record.get("recognised") or {}
    ranked = sorted(((value or 0.0, name) for name, value in types.items()), reverse=True)
    if len(ranked) < 2 or ranked[0][0] - ranked[1][0] >= CLOSE_CALL:
        return None
    return 0.2, f"{ranked[0][1]} or {ranked[1][1]}"
