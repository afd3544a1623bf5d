"""The run's folder: its buildings sorted by doubt.

Each is read from parameters.jsonl when it is requested.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..parametric.file import DAMAGED, objects, parse_object, read_head
from ..parametric.record import refuse_other_kinds
from ..read.models.damage import SkippedBuildings, excerpt
from ..settings import Settings
from ..status import Attention, find_attention
from ..write.head import FileHead
from .doubt import BuildingDoubt, measure_doubt
from .edits import read_stamp

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
        with self.path.open("rb") as file:
            file.seek(row.start)
            line = file.readline()
        try:
            record = parse_object(line.decode(errors="replace").rstrip(), str(self.path))
        except InputError:
            record = None
        if not isinstance(record, dict) or record.get("id") != id:
            raise InputError(
                f"expected {self.path} as it was, got another file; start `hiproof edit` again"
            )
        return record


def read_rows(path: Path) -> tuple[FileHead, list[BuildingRow]]:
    """Read the head of the parameters at `path`, and a row a building."""
    starts: list[int] = []

    def lines(file: Any):
        place = 0
        for line in file:
            starts.append(place)
            place += len(line)
            yield line.decode()

    left_out = SkippedBuildings()
    try:
        with path.open("rb") as file:
            result = objects(lines(file), path, left_out)
            head = read_head(next(result, None), path)
            undamaged = ((number, record) for number, record in result if record is not DAMAGED)
            rows = [
                read_row(number, record, starts[number - 1], path) for number, record in undamaged
            ]
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"expected parameters that hiproof wrote at {path}, got: {error}; check the file"
        ) from error
    return head, rows


def read_row(number: int, record: Any, start: int, path: Path) -> BuildingRow:
    """Return the row of a building's object, most doubtful where it cannot be read."""
    if not isinstance(record, dict) or not isinstance(record.get("id"), str):
        raise InputError(
            f"expected a building in line {number} of {path}, got {excerpt(record)}; mend it there"
        )
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
