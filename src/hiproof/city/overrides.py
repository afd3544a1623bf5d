"""Overrides of a run: read, matched to its buildings, and remembered, so that a run with others
redoes those buildings alone.
"""

from __future__ import annotations

import functools
import hashlib
import json
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, InputWarning, OutputError
from ..log import LOGGER, counted
from ..masking import masked
from ..parametric.file import HEAD, objects
from ..parametric.override import KEYS, Override, override_of
from ..read.attribute_columns import as_declared, where_known
from ..read.footprints import attribute_rows, reading
from ..write.files import atomic
from .ledger import Ledger
from .merge import tile_parts
from .plan import Job, WorkPlan
from .table_values import LeftOut

FILE, REDO = "overrides.jsonl", "redo.json"
TABLES = (".csv", ".gpkg", ".geojson", ".shp", ".fgb", ".xlsx", ".ods")
SHOWN = 5  # ids in a sentence; more would hide what is said


def settle_overrides(
    path: str | None, plan: WorkPlan, state: Path, ledger: Ledger, fresh: bool
) -> None:
    """Keep the overrides at `path` for the workers; of a run that is not `fresh`, open the tiles of
    buildings whose override is another than before. Raises InputError for a file that cannot be
    read or contradicts itself.
    """
    records = matched(dict(read_overrides(path)) if path else {}, plan)
    digests = {index: digest_of(record) for index, record in records.items()}
    with atomic(state / FILE) as beside:
        Path(beside).write_text(
            "".join(json.dumps([i, record]) + "\n" for i, record in sorted(records.items())),
            encoding="utf-8",
        )
    known = ledger.overrides()
    changed = {index for index in digests | known if digests.get(index) != known.get(index)}
    if fresh or not changed:
        ledger.set_overrides(digests)
        return
    redo = tiles_to_redo(changed, plan, state, ledger)
    with atomic(state / REDO) as beside:
        Path(beside).write_text(json.dumps(redo), encoding="utf-8")
    LOGGER.info(
        "%s with another override than before to be redone", counted(len(changed), "building")
    )
    ledger.open_again([f"solve:{tile}" for tile in redo], digests)


def tiles_to_redo(
    changed: set[int], plan: WorkPlan, state: Path, ledger: Ledger
) -> dict[str, list[int]]:
    """By tile the buildings to solve: those `changed`, what a killed run left to redo, and all of a
    tile not solved yet.
    """
    finished = {task.name for task in ledger.tasks() if task.state == "done"}
    left, redo = load_redo(state), {}
    for tile, members in plan.tiles.items():
        own = changed.intersection(members)
        if not tile_parts(state, tile).exists():
            own = set(members)
        elif f"solve:{tile}" not in finished:
            own |= set(left.get(tile, members))
        if own:
            redo[tile] = sorted(own)
    return redo


def read_overrides(path: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """(id, record) of every override in a JSONL file or a table; those of a parameters.jsonl are
    lists of parts.
    """
    seen: dict[str, dict[str, Any]] = {}
    for where, record in override_records(path):
        try:
            id = override_of(record).id
        except InputError as error:
            raise InputError(f"{where}: {error}") from error
        if id in seen and seen[id] != record:
            raise InputError(
                f"expected one override a building in {path}, got two that differ of {id!r}; keep "
                "one"
            )
        seen[id] = record
        yield id, record


def override_records(path: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """(where, record) of every line or row."""
    if str(path).lower().endswith(TABLES):
        yield from (
            (f"row {n} of {path}", record) for n, record in enumerate(table_records(path), 1)
        )
        return
    try:
        # editors may begin it with a mark of the encoding
        with Path(path).open(encoding="utf-8-sig") as file:
            for number, record in objects(file, path):
                if not is_other_line(record):
                    yield f"line {number} of {path}", record
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"expected overrides (JSONL or a table) at {path}, got: {error}; check the path"
        ) from error


def is_other_line(record: Any) -> bool:
    """Whether a line of a parameters.jsonl says nothing of how to build: its head, and buildings
    without a model.
    """
    return isinstance(record, dict) and (
        HEAD in record or ("status" in record and not record.get("parts"))
    )


def table_records(path: str) -> list[dict[str, Any]]:
    """The rows of a table; numbers that a CSV holds as text become numbers."""
    import pyogrio

    def read(where: str | None = None) -> tuple[list[str], list[str], list[np.ndarray]]:
        meta, _, _, columns = reading(
            lambda: pyogrio.raw.read(str(path), read_geometry=False, where=where), path
        )
        return list(meta["fields"]), list(meta["dtypes"]), columns

    names, declared, columns = read()
    columns = as_declared(
        names, declared, columns, lambda name: read(where_known(name, None))[2][names.index(name)]
    )
    rows = attribute_rows(names, columns, len(columns[0]) if columns else 0)
    left_out = LeftOut(masked(path))
    records = [left_out.possible(row, str(row.get("id", ""))) for row in rows]
    left_out.warn()
    return records


def matched(records: dict[str, dict[str, Any]], plan: WorkPlan) -> dict[int, dict[str, Any]]:
    """The overrides by the number of their building, with those that columns of the footprints
    hold; unknown ones are told.
    """
    names, found, left = columns_of(plan), {}, dict(records)
    impossible = LeftOut("columns of the footprints")
    for job in plan.jobs:
        own = beside(column_override(job, names, impossible), left.pop(job.id, {}), job.id)
        if own:
            found[job.index] = {**own, "id": job.id}
    impossible.warn()
    if left:
        some = ", ".join(list(left)[:SHOWN]) + (" and others" if len(left) > SHOWN else "")
        warnings.warn(
            f"no building of this run for {len(left)} of {counted(len(records), 'override')}: "
            f"{some}",
            InputWarning,
        )
    return found


def beside(of_columns: dict[str, Any], of_file: dict[str, Any], id: str) -> dict[str, Any]:
    """What a file says of building `id`, and of what columns say that which can be beside it.

    Raises InputError where columns contradict themselves.

    >>> beside({"type": "hip", "z_ground": 2.5}, {"leave_out": True}, "a")
    {'leave_out': True, 'z_ground': 2.5}
    """
    if of_columns:
        override_of({**of_columns, "id": id})
    both = dict(of_file)
    for key, value in of_columns.items():
        if of_file.get(key) in (None, "") and is_override({**both, key: value, "id": id}):
            both[key] = value
    return both


def is_override(record: dict[str, Any]) -> bool:
    try:
        override_of(record)
    except InputError:
        return False
    return True


def columns_of(plan: WorkPlan) -> list[tuple[str, str]]:
    """(column of the footprints, key of an override) as the settings pair them.

    Raises InputError for those that are not there.
    """
    pairs = [pair.partition("=")[::2] for pair in plan.settings.read.override_columns]
    if not plan.jobs:
        return []
    known = {name for job in plan.jobs if job.footprint for name in job.footprint.attributes}
    refuse_others([column for column, _ in pairs], sorted(known), "columns of the footprints")
    refuse_others([key for _, key in pairs], KEYS, "keys of an override")
    return pairs


def refuse_others(told: list[str], known: Sequence[str], what: str) -> None:
    """Raise InputError where something is told in the settings that is not `known`."""
    other = [name for name in told if name not in known]
    if other:
        raise InputError(
            f"expected {what} ({', '.join(known) or 'there are none'}) in the setting "
            f"override_columns, got {other[0]!r}; "
            'write COLUMN=KEY, such as "daktype=type"'
        )


def column_override(job: Job, names: list[tuple[str, str]], impossible: LeftOut) -> dict[str, Any]:
    """The override in the columns of a building's footprint, empty where they say nothing; what
    cannot be is noted.
    """
    attributes = job.footprint.attributes if job.footprint else {}
    found = impossible.possible(
        {key: attributes[name] for name, key in names if name in attributes}, job.id
    )
    return {key: value for key, value in found.items() if (key, value) != ("leave_out", False)}


def digest_of(record: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(record, sort_keys=True, default=str).encode()).hexdigest()


def load_redo(state: Path) -> dict[str, list[int]]:
    """The buildings to redo by tile, empty where whole tiles are to be solved.

    Raises OutputError for a damaged file.
    """
    try:
        return json.loads((state / REDO).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except ValueError as error:
        raise OutputError(
            f"expected the buildings to redo in {state / REDO}, got: {error}; begin anew with "
            "--restart"
        ) from error


def load_overrides(state: Path) -> dict[int, Override]:
    """The overrides of the run whose state is in `state`, by the number of their building; read
    once a process.
    """
    path = state / FILE
    return overrides_at(path, path.stat().st_mtime_ns) if path.exists() else {}


@functools.lru_cache(maxsize=1)
def overrides_at(path: Path, stamp: int) -> dict[int, Override]:
    with path.open(encoding="utf-8") as file:
        return {index: override_of(record) for index, record in map(json.loads, file)}
