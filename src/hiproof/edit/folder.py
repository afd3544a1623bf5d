"""The run's folder: its buildings sorted by doubt.

Each is read from parameters.jsonl when it is requested. The doubt about a building, a number with
reasons, follows from what the run wrote of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import shapely

from ..errors import InputError
from ..log import count_things
from ..parametric.file import DAMAGED, locate_parameters, read_at
from ..parametric.record import refuse_other_kinds
from ..read.models.damage import SkippedBuildings
from ..settings import Settings
from ..status import Attention, Change, Grade, Status, find_attention
from ..status import Doubt as Remark
from ..write.attribute_list import ANGLES
from ..write.head import FileHead
from .edits import read_stamp

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


PARAMETERS_FILE = "parameters.jsonl"
MOST_DOUBT = 100.0  # more than all reasons together


@dataclass(frozen=True)
class BuildingRow:
    """A building in the list: its place in the file, and its doubt."""

    id: str
    start: int
    type: str | None
    status: str
    share: float | None
    doubt: BuildingDoubt
    attention: tuple[Attention, ...] = ()


class RunFolder:
    """The buildings of a finished run. Raises InputError for a folder that holds none."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.path = folder, folder / PARAMETERS_FILE
        if not self.path.is_file():
            raise InputError(
                "expected the folder of a finished `hiproof reconstruct` or `hiproof build`, got "
                f"{folder} without {PARAMETERS_FILE}; check the path"
            )
        self.stamp: tuple[int, int, int] | None = None
        self.refresh()

    def refresh(self) -> None:
        """Read the file where a run has written it anew."""
        stamp = read_stamp(self.path)
        if stamp == self.stamp:
            return
        self.head, rows = read_rows(self.path)
        self.settings = replace(Settings(), compose=self.head.compose)
        self.rows = sorted(rows, key=lambda row: -row.doubt.amount)
        self.by_id, self.stamp = {row.id: row for row in rows}, stamp

    def record(self, id: str) -> dict[str, Any]:
        """Return the object of a building; raises InputError where the run does not have it."""
        self.refresh()
        row = self.by_id.get(id)
        if row is None:
            raise InputError(
                f"expected a building of the run in {self.folder}, got {id!r:.80}; choose one of "
                "the list"
            )
        try:
            record = read_at(self.path, row.start)
        except InputError:
            record = None
        if not isinstance(record, dict) or record.get("id") != id:
            raise InputError(
                f"expected {self.path} as it was, got another file; start `hiproof edit` again"
            )
        return record


def read_rows(path: Path) -> tuple[FileHead, list[BuildingRow]]:
    """Read the head of the parameters at `path`, and a row a building."""
    with locate_parameters(path, SkippedBuildings()) as (head, located):
        return head, [read_row(*place) for place in located if place[1] is not DAMAGED]


def read_row(start: int, record: dict[str, Any]) -> BuildingRow:
    """Return the row of a building's object, most doubtful where it cannot be read."""
    try:
        refuse_other_kinds(record)
    except InputError as error:
        return BuildingRow(
            record["id"],
            start,
            None,
            "damaged",
            None,
            BuildingDoubt(MOST_DOUBT, (f"cannot be read: {error}",)),
            (Attention.FAILED,),
        )
    share = (record.get("residuals") or {}).get("share_within_20cm")
    status, detail = record.get("status", ""), record.get("detail") or ""
    return BuildingRow(
        record["id"],
        start,
        record.get("type"),
        status,
        share,
        measure_doubt(record),
        find_attention(status, record.get("quality"), detail, share),
    )
