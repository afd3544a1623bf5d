"""Overrides of a run: read, matched to its buildings, and remembered.

A run with others redoes those buildings alone. Values of columns are converted to those of an
override.
"""

from __future__ import annotations

import functools
import json
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ...errors import InputError, InputWarning
from ...log import count_things
from ...masking import mask
from ...model import Footprint
from ...parametric.fallback import find_fallback_ranges, list_fallback_columns
from ...parametric.file import HEAD_KEY, objects
from ...parametric.override import KEYS, RANGES, Override, check_number, read_override
from ...read.models.damage import explain_unreadable
from ...read.numbers import (
    FIRST_YEAR,
    LAST_YEAR,
    NumberColumn,
    SkippedValues,
    is_empty,
    read_number,
    read_year,
    warn_of_values,
)
from ...read.outlines.attribute_columns import attribute_rows
from ...read.plausible import HIGHEST_BUILDING_M
from ...settings import ReadSettings
from ...write.files import save_text
from .work_plan import Job, WorkPlan

OVERRIDES_FILE, REDO = "overrides.jsonl", "redo.json"
TABLE_ENDINGS = (".csv", ".gpkg", ".geojson", ".shp", ".fgb", ".xlsx", ".ods")
MOST_SHOWN_IDS = 5  # ids in a sentence; more would hide what is said


def keep_overrides(path: str | None, plan: WorkPlan, state: Path) -> dict[int, dict[str, Any]]:
    """Keep the overrides at `path` for the workers, and return them by building.

    Raises InputError for a file that cannot be read or contradicts itself.
    """
    records = match_overrides(dict(read_overrides(path)) if path else {}, plan)
    lines = [json.dumps([i, record]) + "\n" for i, record in sorted(records.items())]
    save_text(state / OVERRIDES_FILE, "".join(lines))
    return records


def read_overrides(path: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield (id, record) of every override in a table, a JSONL file or a parameters.jsonl."""
    visited: dict[str, dict[str, Any]] = {}
    for where, record in override_records(path):
        try:
            id = read_override(record).id
        except InputError as error:
            raise InputError(f"{where}: {error}") from error
        if id in visited and visited[id] != record:
            raise InputError(
                f"expected one override a building in {path}, got two that differ of {id!r}; keep "
                "one"
            )
        visited[id] = record
        yield id, record


def override_records(path: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield (where, record) of every line or row."""
    if str(path).lower().endswith(TABLE_ENDINGS):
        yield from (
            (f"row {n} of {path}", record) for n, record in enumerate(table_records(path), 1)
        )
        return
    try:
        with Path(path).open("rb") as file:
            for number, _, record in objects(file, path):
                # the head and buildings without a model say nothing of how to build
                if not isinstance(record, dict) or not (
                    HEAD_KEY in record or ("status" in record and not record.get("parts"))
                ):
                    yield f"line {number} of {path}", record
    except (OSError, UnicodeDecodeError) as error:
        raise explain_unreadable(path, "overrides (JSONL or a table)", error) from error


def table_records(path: str) -> list[dict[str, Any]]:
    """Return the rows of a table.

    Numbers that a CSV holds as text become numbers.
    """
    from ...read.outlines.vector_file import read_layer, translate_read_errors  # GDAL

    with translate_read_errors(path):
        meta, numbers, _, columns, _ = read_layer(path, None, read_geometry=False)
    rows = attribute_rows(meta["fields"], columns, len(numbers))
    left_out = SkippedValues(mask(path))
    records = [select_possible(row, str(row.get("id", "")), left_out) for row in rows]
    left_out.warn()
    return records


def match_overrides(
    records: dict[str, dict[str, Any]], plan: WorkPlan
) -> dict[int, dict[str, Any]]:
    """Return overrides, those of footprints' columns too, by building, and report unknown ones."""
    names, result, remainder = pair_columns(plan), {}, dict(records)
    impossible = SkippedValues("columns of the footprints")
    for job in plan.jobs:
        override = merge_override(
            column_override(job, names, impossible), remainder.pop(job.id, {}), job.id
        )
        if override:
            result[job.index] = {**override, "id": job.id}
    impossible.warn()
    if remainder:
        subset = ", ".join(list(remainder)[:MOST_SHOWN_IDS]) + (
            " and others" if len(remainder) > MOST_SHOWN_IDS else ""
        )
        warnings.warn(
            f"no building of this run for {len(remainder)} of "
            f"{count_things(len(records), 'override')}: {subset}",
            InputWarning,
        )
    return result


def merge_override(of_columns: dict[str, Any], of_file: dict[str, Any], id: str) -> dict[str, Any]:
    """Merge a file's override of building `id` with that of columns.

    Values of columns stay that can stand beside the file's.

    Raises InputError where columns contradict themselves.

    >>> merge_override({"type": "hip", "z_ground": 2.5}, {"leave_out": True}, "a")
    {'leave_out': True, 'z_ground': 2.5}
    """
    if of_columns:
        read_override({**of_columns, "id": id})
    combined = dict(of_file)
    for key, value in of_columns.items():
        if of_file.get(key) in (None, "") and is_override({**combined, key: value, "id": id}):
            combined[key] = value
    return combined


def is_override(record: dict[str, Any]) -> bool:
    try:
        read_override(record)
    except InputError:
        return False
    return True


def pair_columns(plan: WorkPlan) -> list[tuple[str, str]]:
    """Pair columns of the footprints with keys of an override.

    The settings name the pairs.

    Raises InputError for those that are not there.
    """
    pairs = [pair.partition("=")[::2] for pair in plan.settings.read.override_columns]
    fallbacks = list_fallback_columns(plan.settings.read)
    if not plan.jobs or not (pairs or fallbacks):
        return []
    columns = {name for job in plan.jobs if job.footprint for name in job.footprint.attributes}
    for column in fallbacks:
        if column not in columns:
            raise InputError(
                f"expected a column of the footprints ({', '.join(sorted(columns)) or 'none'}) for "
                f"heights of buildings without points, got {column!r}; name one of these"
            )
    refuse_others([column for column, _ in pairs], sorted(columns), "columns of the footprints")
    refuse_others([key for _, key in pairs], KEYS, "keys of an override")
    return pairs


def refuse_others(names: list[str], allowed: Sequence[str], subject: str) -> None:
    """Raise InputError where something is told in the settings that is not `allowed`."""
    other = [name for name in names if name not in allowed]
    if other:
        raise InputError(
            f"expected {subject} ({', '.join(allowed) or 'there are none'}) in the setting "
            f"override_columns, got {other[0]!r}; "
            'write COLUMN=KEY, such as "daktype=type"'
        )


def column_override(
    job: Job, names: list[tuple[str, str]], impossible: SkippedValues
) -> dict[str, Any]:
    """Return the override in a footprint's columns, perhaps empty; note impossible values."""
    attributes = job.footprint.attributes if job.footprint else {}
    result = select_possible(
        {key: attributes[name] for name, key in names if name in attributes}, job.id, impossible
    )
    return {key: value for key, value in result.items() if (key, value) != ("leave_out", False)}


def load_redo(state: Path) -> dict[str, list[int]]:
    """Load the buildings to solve by tile, empty where whole tiles are to be solved."""
    path = state / REDO
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def load_overrides(state: Path) -> dict[int, Override]:
    """Load the overrides of a run by the number of their building.

    The run's state is in `state`; it is read once a process.
    """
    path = state / OVERRIDES_FILE
    return parse_overrides(path, path.stat().st_mtime_ns) if path.exists() else {}


@functools.lru_cache(maxsize=1)
def parse_overrides(path: Path, stamp: int) -> dict[int, Override]:
    with path.open(encoding="utf-8") as file:
        return {index: read_override(record) for index, record in map(json.loads, file)}


YES_OR_NO = dict.fromkeys(("1", "1.0", "true", "yes", "t", "y"), True) | dict.fromkeys(
    ("0", "0.0", "false", "no", "f", "n", ""), False
)
"""What tables say for true and false."""


def check_number_columns(footprints: Iterable[Footprint], read: ReadSettings) -> None:
    """Warn of numbers in columns of the footprints that are left out.

    Raises InputError for a year of construction that no footprint has.
    """
    if read.year_column:
        subject = "the footprints"
        refuse_missing_column(footprints, read.year_column, subject, "the year of construction")
    rows = ((footprint.id, footprint.attributes) for footprint in footprints)
    warn_of_values(rows, list_number_columns(read), "columns of the footprints")


def list_number_columns(read: ReadSettings) -> list[NumberColumn]:
    """Return the columns of footprints whose numbers the settings name."""
    ranges = {read.raised_column: (0.0, HIGHEST_BUILDING_M), **find_fallback_ranges(read)}
    columns = [
        NumberColumn(
            name,
            f"{name} from {least:g} to {greatest:g} m",
            functools.partial(read_number, least=least, greatest=greatest),
        )
        for name, (least, greatest) in ranges.items()
        if name
    ]
    if name := read.year_column:
        columns.append(
            NumberColumn(name, f"{name} as a year from {FIRST_YEAR} to {LAST_YEAR}", read_year)
        )
    return columns


def refuse_missing_column(
    features: Iterable[Footprint], column: str, subject: str, meaning: str
) -> None:
    """Raise InputError where no feature has a column."""
    columns = {name for feature in features for name in feature.attributes}
    if columns and column not in columns:
        raise InputError(
            f"expected a column {column} of {subject} ({', '.join(sorted(columns))}), got none; "
            f"name the one that holds {meaning}"
        )


def select_possible(record: Mapping[str, Any], id: str, skipped: SkippedValues) -> dict[str, Any]:
    """Return the record without empty and impossible values.

    The latter are noted in `skipped`.
    """
    result = {}
    for key, cell in record.items():
        value = convert_value(key, cell)
        if is_empty(value):
            continue
        try:
            if key in RANGES and not isinstance(value, list):
                check_number(key, value, id)
            result[key] = value
        except InputError:
            lower, upper = RANGES[key]
            skipped.note(f"{key} from {lower:g} to {upper:g}", value, id)
    return result


def convert_value(key: str, value: Any) -> Any:
    """Convert a table's value to that of the override's key.

    >>> convert_value("z_ground", "0,5 m"), convert_value("leave_out", "0"), convert_value("id", 7)
    (0.5, False, '7')
    """
    if key == "leave_out":
        return YES_OR_NO.get(str(value).strip().lower(), value)
    if key in RANGES and isinstance(value, str):
        number = read_number(value)
        return value if number is None else number
    return str(value) if key == "id" else value
